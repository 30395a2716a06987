"""Layouts of data sets by name: how sequences are found, read and written."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pftrack_sim.core.arguments import checked
from pftrack_sim.core.errors import SequenceError, UnknownNameError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats import ros2
from pftrack_sim.formats.coco import COCO
from pftrack_sim.formats.files import number_rows, present_boxes
from pftrack_sim.formats.images import video
from pftrack_sim.formats.kitti import KITTI
from pftrack_sim.formats.mot import MOT
from pftrack_sim.formats.sequence import Layout, RecordedSequence
from pftrack_sim.formats.single_target import GOT10K, LASOT, OTB, VOT
from pftrack_sim.formats.webdataset import WEBDATASET

_DEPTH = 3
"""Folders below a data set in which its sequences are looked for."""


LAYOUTS: dict[str, Layout] = {
    "otb": OTB,
    "mot": MOT,
    "got10k": GOT10K,
    "vot": VOT,
    "lasot": LASOT,
    "coco": COCO,
    "kitti": KITTI,
    "webdataset": WEBDATASET,
}
"""In the order in which they are looked for: `groundtruth.txt` alone does not tell GOT-10k, VOT and LaSOT apart."""


@checked
def find_sequences(root: str | Path, layout: str | None = None) -> list[tuple[Path, str]]:
    """Folders of the sequences of a data set, sorted by name, each with its layout.

    Args:
        root: Folder of the data set, or of one sequence.
        layout: One of `LAYOUTS`; None finds out by the files that are there.

    Raises:
        UnknownNameError: No such layout.
        SequenceError: The folder is missing, or nothing in it is a sequence.
    """
    top = _checked_folder(root, layout)
    known = LAYOUTS if layout is None else {layout: LAYOUTS[layout]}
    found: list[tuple[Path, str]] = []
    for text, below, _ in os.walk(top):
        folder = Path(text)
        name = next((name for name, one in known.items() if one.matches(folder)), None)
        if name is not None:
            found.append((folder, name))
        if name is not None or len(folder.relative_to(top).parts) >= _DEPTH:
            below.clear()
        below[:] = [one for one in below if not one.startswith(".")]
    if not found:
        raise SequenceError(f"{top}: no sequence in a known layout ({_expected(known.values())})")
    return sorted(found)


def _checked_folder(path: str | Path, layout: str | None) -> Path:
    folder = Path(path)
    if layout is not None and layout not in LAYOUTS:
        raise UnknownNameError("layout", layout, LAYOUTS)
    if not folder.is_dir():
        raise SequenceError(f"{folder}: {'is not a folder' if folder.exists() else 'no such folder'}")
    return folder


def _expected(known: Iterable[Layout]) -> str:
    return "; ".join(f"{one.title}: {one.expects}" for one in known)


@checked
def read_sequence(
    path: str | Path, layout: str | None = None, topics: Sequence[str] = (), boxes: FloatArray | None = None
) -> RecordedSequence:
    """Read a recorded sequence, from its first frame with a true box on.

    Args:
        path: Its folder; or an MCAP file, a ROS 2 bag or its folder, or a video file.
        layout: One of `LAYOUTS`; None finds out by the files that are there.
        topics: Of images and of boxes in an MCAP file or a bag, where there are several.
        boxes: `(1, 4)` box of a video's first frame [px], or `(N, 4)` boxes of all its frames.

    Raises:
        UnknownNameError: No such layout.
        RunError: The library for MCAP files and bags is missing.
        SequenceError: The folder is missing or has another layout; images or boxes are missing, damaged, or differ in
            number.
    """
    if layout is None and (file := ros2.find(Path(path))) is not None:
        return ros2.read(file, topics)
    if layout is None and Path(path).is_file():
        if boxes is None:
            words = "is not a folder, and a video needs the box of its first frame: --box x,y,w,h or a file of boxes"
            raise SequenceError(f"{path}: {words}")
        return read_video(Path(path), boxes)
    folder = _checked_folder(path, layout)
    for known in LAYOUTS.values() if layout is None else [LAYOUTS[layout]]:
        if layout is not None or known.matches(folder):
            return known.read(folder)
    raise SequenceError(f"{folder}: not a sequence in a known layout ({_expected(LAYOUTS.values())})")


@checked
def read_sequences(
    path: str | Path, layout: str | None = None, topics: Sequence[str] = (), boxes: FloatArray | None = None
) -> list[RecordedSequence]:
    """Read a sequence, or all of a data set's; arguments and errors are those of `read_sequence`."""
    top = Path(path)
    if not top.is_dir() or ros2.find(top) is not None or not any(entry.is_dir() for entry in top.iterdir()):
        return [read_sequence(path, layout, topics, boxes)]
    try:
        found = find_sequences(path, layout)
    except SequenceError:
        return [read_sequence(path, layout)]  # its message names what is missing
    return [read_sequence(folder, known) for folder, known in found]


def read_video(path: Path, boxes: FloatArray | None = None) -> RecordedSequence:
    """A video with the `(1, 4)` box [px] of its first frame, which gives nothing to score, or `(N, 4)` boxes of all.

    Without boxes it has all its frames, and none is known.

    Raises:
        SequenceError: It is no video, or the boxes are neither one nor as many as its frames, or none is one.
    """
    images, rate_hz = video(path)
    truth = np.full((len(images), 4), np.nan)
    if boxes is None:
        return RecordedSequence(path.stem, images, truth, rate_hz)
    if len(boxes) not in (1, len(images)):
        words = f"{len(images)} frames but {len(boxes)} boxes; give one for the first frame, or all"
        raise SequenceError(f"{path}: {words}")
    truth[: len(boxes)] = boxes
    return replace(RecordedSequence.checked(path, "", images, truth, rate_hz), name=path.stem)


def given_boxes(text: str) -> FloatArray:
    """`(1, 4)` or `(N, 4)` boxes [px] given as `x,y,w,h` or as a file with such a line for one or every frame.

    Raises:
        SequenceError: The file is missing or holds something else.
    """
    try:
        box = [float(one) for one in text.split(",")]
    except ValueError:
        return present_boxes(number_rows(Path(text), "four numbers x, y, w, h", 4))
    if len(box) != 4 or not np.isfinite(box).all() or min(box[2:]) <= 0.0:
        raise SequenceError(f"a box is x,y,w,h in pixels, with a width and height above 0; got {text!r}")
    return np.array([box])
