"""Layout of MOTChallenge (Milan et al. 2016): `img1/000001.jpg`..., `gt/gt.txt`, `seqinfo.ini`.

A line of `gt.txt` is one person in one frame: frame, identity, left, top, width, height, considered, class, visibility;
frames, identities, left and top are 1-based. `det/det.txt`, where it is there, holds what a detector found: frame, -1,
left, top, width, height, score. Who is not in a frame has no line. Identity 1 is the target of a sequence
that is read for tracking one person.
"""

from __future__ import annotations

import configparser
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.records import Detections
from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats.files import box_lines, number, number_rows, read_text
from pftrack_sim.formats.images import image_suffix, images_in
from pftrack_sim.formats.sequence import TARGET, Annotations, Layout, RecordedSequence

_TRUTH, _INFO, _DETECTIONS = "gt/gt.txt", "seqinfo.ini", "det/det.txt"
_PEDESTRIAN = 1
_COLUMNS = "frame, identity, left, top, width, height, considered, class, visibility"


def read_boxes(path: Path, count: int) -> FloatArray:
    """`(M, 7)` frame from 0, identity, box [px] and score of what trackers or detectors found in `count` images.

    Raises:
        SequenceError: The file is missing, or a line has another frame, no whole number as identity, or no box.
    """
    what = "frame, identity, left, top, width, height, confidence"
    rows = number_rows(path, what, 7, more=True) if read_text(path).strip() else np.empty((0, 7))
    outside = (rows[:, 0] < 1) | (rows[:, 0] > count) | (rows[:, :2] % 1 != 0).any(axis=1)
    no_box = ~np.isfinite(rows[:, 2:7]).all(axis=1) | (rows[:, 4:6] < 0.0).any(axis=1)
    for index in np.flatnonzero(outside | no_box)[:1].tolist():
        words = f"frame {rows[index, 0]:g} or identity {rows[index, 1]:g} is wrong"
        if not outside[index]:
            words = f"a box has finite numbers and a width and height >= 0, got {rows[index, 2:7]}"
        raise SequenceError(f"{path}, line {index + 1}: {words}")
    return rows - np.array([1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0])


def _read_detections(folder: Path, count: int) -> tuple[Detections, ...] | None:
    """Detections of each of `count` images; None without a file. Scores outside [0, 1] are mapped to it linearly."""
    if not (folder / _DETECTIONS).is_file():
        return None
    rows = read_boxes(folder / _DETECTIONS, count)
    scores = rows[:, 6]
    if len(scores) and (scores.min() < 0.0 or scores.max() > 1.0):
        scores = (scores - scores.min()) / max(float(np.ptp(scores)), 1e-9)
    frames = [rows[:, 0] == frame for frame in range(count)]
    return tuple(Detections(rows[here, 2:6], scores[here]) for here in frames)


def read_people(folder: Path) -> FloatArray:
    """`(M, 6)` frame from 0, identity and box [px] of every pedestrian that is marked to be considered.

    Raises:
        SequenceError: The file is missing or holds something else.
    """
    rows = number_rows(folder / _TRUTH, _COLUMNS, 9)
    rows = rows[(rows[:, 6] != 0.0) & (rows[:, 7] == _PEDESTRIAN)]
    return rows[:, :6] - np.array([1.0, 0.0, 1.0, 1.0, 0.0, 0.0])


class _Mot(Layout):
    title, expects = "MOTChallenge", "a folder img1/ of numbered images and the files gt/gt.txt and seqinfo.ini"
    image, sequences, video = "img1/{:06d}", "pftrack-train", True

    def matches(self, folder: Path) -> bool:
        return (folder / _TRUTH).exists() or (folder / _INFO).is_file()

    def read(self, folder: Path) -> RecordedSequence:
        images = images_in(folder / "img1")
        rows = number_rows(folder / _TRUTH, _COLUMNS, 9)
        truth = np.full((len(images), 4), np.nan)
        for row in rows[(rows[:, 1] == TARGET) & (rows[:, 8] > 0.0)]:
            if not 1 <= row[0] <= len(images):
                raise SequenceError(f"{folder / _TRUTH}: frame {row[0]:g} of {len(images)} images")
            truth[int(row[0]) - 1] = row[2:6] - [1.0, 1.0, 0.0, 0.0]
        rate_hz = None
        if (folder / _INFO).is_file():
            parser = configparser.ConfigParser(interpolation=None)
            try:
                parser.read_string(read_text(folder / _INFO))
                rate_hz = parser.getfloat("Sequence", "frameRate", fallback=None)
            except (configparser.Error, ValueError) as error:
                raise SequenceError(f"{folder / _INFO}: {str(error).splitlines()[0]}") from None
        return RecordedSequence.checked(folder, _TRUTH, images, truth, rate_hz, _read_detections(folder, len(images)))

    def index(self, root: Path, names: Sequence[str]) -> Iterator[tuple[str, Iterator[str]]]:
        yield "seqmaps/pftrack-train.txt", (f"{name}\n" for name in ("name", *names))

    def write(self, folder: Path, annotations: Annotations) -> None:
        (folder / "gt").mkdir(exist_ok=True)
        with (folder / _TRUTH).open("w", encoding="utf-8") as written:
            for frame, people in enumerate(annotations.people, start=1):
                for one in people:
                    x, y, w, h = one.box
                    numbers = ",".join(number(value) for value in (x + 1.0, y + 1.0, w, h))
                    written.write(f"{frame},{one.identity},{numbers},1,{_PEDESTRIAN},{number(one.visible_fraction)}\n")
        if annotations.detections:
            (folder / "det").mkdir(exist_ok=True)
            with (folder / _DETECTIONS).open("w", encoding="utf-8") as written:
                for frame, found in enumerate(annotations.detections, start=1):
                    lines = box_lines(found.boxes, first_pixel=1.0).splitlines()
                    for line, score in zip(lines, found.scores, strict=True):
                        written.write(f"{frame},-1,{line},{number(float(score))},-1,-1,-1\n")
        width, height = annotations.image_size_px
        info = (
            f"[Sequence]\nname={annotations.name}\nimDir=img1\nframeRate={annotations.rate_hz:g}\n"
            f"seqLength={len(annotations)}\nimWidth={width}\nimHeight={height}\nimExt={image_suffix(folder / 'img1')}\n"
        )
        (folder / _INFO).write_text(info, encoding="utf-8")


MOT = _Mot()
