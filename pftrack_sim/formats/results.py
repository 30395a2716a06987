"""Result files of trackers, as the toolkits of public benchmarks write and read them.

    otb     TRACKER/SEQUENCE.txt                              x,y,w,h in the convention of the data set
    got10k  GOT-10k/TRACKER/SEQUENCE/SEQUENCE_001.txt         the same, 0-based
    vot     results/TRACKER/EXPERIMENT/SEQUENCE/SEQUENCE_001.txt    1 where the tracker is given the box, then regions
    mot     pftrack-train/TRACKER/data/SEQUENCE.txt           frame,identity,left,top,w,h,confidence,-1,-1,-1; 1-based

A frame without an estimate has `0,0,0,0`, or no line in MOT. Times are seconds, in files beside them. The VOT toolkit
writes `SEQUENCE_001.bin` unless it is told otherwise; both are read.
"""

from __future__ import annotations

import io
import re
import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from pftrack_sim.core.boxes import NO_BOX, Box
from pftrack_sim.core.errors import SequenceError, UnknownNameError
from pftrack_sim.core.inputs import read_bytes
from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats.files import MAX_BYTES, box_lines, number, number_rows, read_text, reading
from pftrack_sim.formats.mot import read_boxes
from pftrack_sim.formats.sequence import TARGET
from pftrack_sim.formats.single_target import VOT_EXPERIMENT, region_box

ResultFormat: TypeAlias = Literal["otb", "got10k", "vot", "mot"]

RESULT_FORMATS: tuple[ResultFormat, ...] = get_args(ResultFormat)
_BINARY = ".bin"
_ONE_BASED = ("otb", "lasot", "mot")
"""Layouts of data sets whose boxes are 1-based."""


@dataclass(frozen=True, eq=False)
class TrackerResult:
    """What one tracker said on one sequence.

    Attributes:
        boxes: `(N, 4)` boxes [px], one row per image; NaN rows are misses.
        ms: `(N,)` time per frame; NaN where it is not known.
        confidence: `(N,)` in [0, 1]; NaN where it is not known.
        first: Frame in which the tracker was given the box.
        rows: `(M, 6)` frame from 0, identity and box of every track, where the format has several; otherwise None.
    """

    boxes: FloatArray
    ms: FloatArray
    confidence: FloatArray
    first: int = 0
    rows: FloatArray | None = None


@dataclass(frozen=True)
class ResultFile:
    """One file of results.

    Attributes:
        tracker: Name of the tracker; with the experiment where VOT's is not `unsupervised`.
        repetition: Number of the run of this tracker on this sequence, from 1.
    """

    path: Path
    form: ResultFormat
    tracker: str
    sequence: str
    repetition: int = 1


def check_format(form: str) -> ResultFormat:
    """Return a format of result files; raises UnknownNameError for any other name."""
    for known in RESULT_FORMATS:
        if form == known:
            return known
    raise UnknownNameError("format of results", form, RESULT_FORMATS)


def result_files(form: ResultFormat, tracker: str, sequence: str, result: TrackerResult) -> Iterator[tuple[str, str]]:
    """Paths within the folder of results and contents of the files of one tracker on one sequence.

    Boxes of `otb` are written 1-based, as its data sets have them.
    """
    seconds = [1e-3 * ms for ms in result.ms.tolist()]
    if form == "otb":
        yield f"{tracker}/{sequence}.txt", box_lines(result.boxes, first_pixel=1.0)
        yield f"{tracker}/times/{sequence}_time.txt", _lines(seconds)
    elif form == "got10k":
        below = f"GOT-10k/{tracker}/{sequence}/{sequence}"
        yield f"{below}_001.txt", box_lines(result.boxes)
        yield f"{below}_time.txt", _lines(seconds)
    elif form == "vot":
        below = f"results/{tracker}/{VOT_EXPERIMENT}/{sequence}/{sequence}_001"
        lines = box_lines(result.boxes).splitlines(keepends=True)
        # Not initialised yet is unknown, which the toolkit leaves out.
        lines[: result.first + 1] = ["0\n"] * result.first + ["1\n"]
        yield f"{below}.txt", "".join(lines)
        yield f"{below}_time.value", _lines(seconds)
        yield f"{below}_confidence.value", "\n" + _lines(result.confidence.tolist()[1:])
    elif result.rows is not None:
        lines = box_lines(result.rows[:, 2:6], first_pixel=1.0).splitlines()
        rows = zip(result.rows[:, :2].astype(int).tolist(), lines, strict=True)
        text = "".join(f"{frame + 1},{identity},{line},1,-1,-1,-1\n" for (frame, identity), line in rows)
        yield f"pftrack-train/{tracker}/data/{sequence}.txt", text
    else:
        kept = np.flatnonzero(np.isfinite(result.boxes).all(axis=1) & (result.boxes[:, 2:] > 0.0).all(axis=1))
        lines = box_lines(result.boxes[kept], first_pixel=1.0).splitlines()
        confidence = [number(value) for value in np.nan_to_num(result.confidence[kept], nan=1.0).tolist()]
        rows = zip(kept.tolist(), lines, confidence, strict=True)
        text = "".join(f"{frame + 1},{TARGET},{line},{sure},-1,-1,-1\n" for frame, line, sure in rows)
        yield f"pftrack-train/{tracker}/data/{sequence}.txt", text


def _lines(values: list[float]) -> str:
    return "".join(f"{value:.8f}\n" for value in values)


def find_results(root: Path, sequences: Collection[str], form: ResultFormat | None = None) -> list[ResultFile]:
    """Files of results below a folder, sorted by tracker, sequence and repetition.

    Args:
        root: The folder.
        sequences: Names of the sequences; other files are ignored.
        form: Format; None finds it out for each file by its name and first line.

    Raises:
        SequenceError: There is no such folder, it has no results of these sequences, or two of the same.
    """
    if not root.is_dir():
        raise SequenceError(f"{root}: {'is not a folder' if root.exists() else 'no such folder'}")
    paths = sorted([*root.rglob("*.txt"), *root.rglob(f"*{_BINARY}")])
    found = [one for path in paths if (one := _result_file(root, path, sequences, form))]
    if not found:
        raise SequenceError(f"{root}: no results of {', '.join(sorted(sequences)[:3])}{', ...' * (len(sequences) > 3)}")
    by_key: dict[tuple[str, str, int], Path] = {}
    for one in found:
        key = (one.tracker, one.sequence, one.repetition)
        if key in by_key:
            raise SequenceError(f"{one.path} and {by_key[key]} are both results of {one.tracker} on {one.sequence}")
        by_key[key] = one.path
    return sorted(found, key=lambda one: (one.tracker, one.sequence, one.repetition))


def _result_file(root: Path, path: Path, sequences: Collection[str], form: ResultFormat | None) -> ResultFile | None:
    folders = [root.resolve().name, *path.relative_to(root).parts[:-1]]
    numbered = re.fullmatch(r"(.+)_(\d{3})", path.stem)
    if numbered and numbered[1] in sequences and folders[-1] == numbered[1]:
        chosen = form or ("vot" if path.suffix == _BINARY or "," not in _first_line(path) else "got10k")
        if chosen == "got10k" and len(folders) >= 2:
            return ResultFile(path, chosen, folders[-2], numbered[1], int(numbered[2]))
        if chosen == "vot" and len(folders) >= 3:
            experiment = "" if folders[-2] == VOT_EXPERIMENT else f" {folders[-2]}"
            return ResultFile(path, chosen, folders[-3] + experiment, numbered[1], int(numbered[2]))
    elif path.stem in sequences and path.suffix != _BINARY:
        chosen = form or ("mot" if _first_line(path).count(",") >= 5 else "otb")
        inner = chosen == "mot" and folders[-1] == "data" and len(folders) >= 2
        if chosen in ("otb", "mot"):
            return ResultFile(path, chosen, folders[-2] if inner else folders[-1], path.stem)
    return None


def _first_line(path: Path) -> str:
    return next(iter(read_text(path).splitlines()), "")


def read_result(file: ResultFile, count: int, layout: str) -> TrackerResult:
    """Read results.

    Args:
        file: From `find_results`.
        count: Number of images of the sequence.
        layout: Of the data set, one of `LAYOUTS`: it tells where pixels are counted from in files of four numbers.

    Raises:
        SequenceError: The file has other than `count` frames, holds something else, or was written with resets.
    """
    if file.form == "mot":
        return _read_mot(file.path, count)
    first = 0
    if file.form == "vot":
        rows, first = _read_vot(file.path)
    else:
        rows = number_rows(file.path, "four numbers x, y, w, h", 4)
    if len(rows) != count:
        raise SequenceError(f"{file.path}: {len(rows)} lines but {count} images in {file.sequence}")
    shift = 1.0 if file.form == "otb" and layout in _ONE_BASED else 0.0
    boxes = rows - np.array([shift, shift, 0.0, 0.0])
    # A box without extent is an estimate, unless it is all zero: that is how a miss is written.
    boxes[np.isnan(rows).any(axis=1) | (rows == 0.0).all(axis=1) | (rows[:, 2:] < 0.0).any(axis=1)] = np.nan
    return TrackerResult(boxes, _read_ms(file, count), np.full(count, np.nan), first)


def _read_vot(path: Path) -> tuple[FloatArray, int]:
    rows: list[Box] = []
    first = 0
    lines = _binary_lines(path) if path.suffix == _BINARY else read_text(path).splitlines()
    for index, line in enumerate(lines):
        if line.strip() == "2":
            raise SequenceError(f"{path}, line {index + 1}: the tracker was reset; only runs without resets are scored")
        if line.strip() in ("0", "1"):
            first = index if line.strip() == "1" else first
            rows.append(NO_BOX)
            continue
        box = region_box(line.strip())
        if box is None:
            raise SequenceError(f"{path}, line {index + 1}: expected a region, got {line.strip()[:60]!r}")
        rows.append(box)
    return np.array(rows, dtype=np.float64).reshape(-1, 4), first


def _binary_lines(path: Path) -> list[str]:
    """Regions of a binary file of the VOT toolkit as the lines of a text file.

    Little-endian: version 1, the number of regions, and of each a byte: 0 code, 1 rectangle, 2 polygon, 3 mask.
    """
    with reading(path):
        content = io.BytesIO(read_bytes(path, MAX_BYTES))

    def read(form: str) -> tuple[Any, ...]:
        return struct.unpack(f"<{form}", content.read(struct.calcsize(f"<{form}")))

    lines: list[str] = []
    try:
        version, count = read("hI")
        for _ in range(count if version == 1 else 0):
            (kind,) = read("B")
            if kind == 3:
                *frame, length = read("hhHHH")
                values = [*frame, *read(f"{length}H")]
            else:
                values = read({0: "I", 1: "4f", 2: f"{2 * read('H')[0]}f" if kind == 2 else ""}[kind])
            lines.append("m" * (kind == 3) + ",".join(map(str, values)))
    except (struct.error, KeyError):
        version = 0
    if version != 1 or content.read(1):
        raise SequenceError(f"{path}: is no file of regions of the VOT toolkit, or it is damaged")
    return lines


def _read_mot(path: Path, count: int) -> TrackerResult:
    rows = read_boxes(path, count)
    boxes, confidence = np.full((count, 4), np.nan), np.full(count, np.nan)
    # One track: of a single-object tracker. Of several, the caller chooses.
    if len(np.unique(rows[:, 1])) == 1:
        boxes[rows[:, 0].astype(int)], confidence[rows[:, 0].astype(int)] = rows[:, 2:6], rows[:, 6]
    return TrackerResult(boxes, np.full(count, np.nan), confidence, 0, rows[:, :6])


def _read_ms(file: ResultFile, count: int) -> FloatArray:
    """Times of a result, NaN where there are none: a toolkit without them is no error, a broken file is."""
    sequence, folder = file.sequence, file.path.parent
    path = {
        "otb": folder / "times" / f"{sequence}_time.txt",
        "got10k": folder / f"{sequence}_time.txt",
        "vot": file.path.with_name(f"{file.path.stem}_time.value"),
    }[file.form]
    if not path.is_file():
        return np.full(count, np.nan)
    lines = [line.replace(",", " ").split() for line in read_text(path).splitlines()]
    column = file.repetition - 1 if file.form == "got10k" else 0
    try:
        seconds = [float(fields[min(column, len(fields) - 1)]) if fields else np.nan for fields in lines]
    except ValueError:
        seconds = [-1.0]
    if any(one < 0.0 or one == np.inf for one in seconds):
        raise SequenceError(f"{path}: expected seconds, one line per frame")
    if len(seconds) != count:
        raise SequenceError(f"{path}: {len(seconds)} lines but {count} images in {sequence}")
    return 1e3 * np.array(seconds)
