"""Sequences in video files, with the box of the first frame or of every frame given apart. Boxes are 0-based."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats.files import VIDEO, decode, number_rows, present_boxes, probe
from pftrack_sim.formats.sequence import RecordedSequence


@dataclass(frozen=True, eq=False)
class _VideoSequence(RecordedSequence):
    """Frames of one file, decoded one after the other; going back begins anew."""

    decoder: list[tuple[int, Generator[Image]]] = field(default_factory=list[tuple[int, Generator[Image]]])

    def _read_image(self, index: int) -> Image:
        at, frames = self.decoder.pop() if self.decoder else (0, decode(self.paths[0]))
        if at > self.start + index:
            frames.close()
            at, frames = 0, decode(self.paths[0])
        for number, image in enumerate(frames, start=at):
            if number == self.start + index:
                self.decoder.append((number + 1, frames))
                return image
        raise SequenceError(f"{self.paths[0]}: frame {self.start + index + 1} cannot be decoded")


def given_boxes(text: str) -> FloatArray:
    """`(1, 4)` or `(N, 4)` boxes [px] given as `x,y,w,h` or as a file with such a line for one or every frame.

    Raises:
        SequenceError: The file is missing or holds something else.
    """
    numbers = text.split(",")
    try:
        box = [float(one) for one in numbers]
    except ValueError:
        return present_boxes(number_rows(Path(text), "four numbers x, y, w, h", 4))
    if len(box) != 4 or not np.isfinite(box).all() or min(box[2:]) <= 0.0:
        raise SequenceError(f"a box is x,y,w,h in pixels, with a width and height above 0; got {text!r}")
    return np.array([box])


def read(path: Path, boxes: FloatArray) -> RecordedSequence:
    """Read a video.

    Args:
        path: Any file that FFmpeg decodes.
        boxes: `(N, 4)` a box for every frame, NaN where the target is absent; or `(1, 4)` that of the first frame,
            which gives nothing to score.

    Raises:
        SequenceError: It is no video, or the boxes are neither one nor as many as its frames.
    """
    count, rate_hz = probe(path)
    if len(boxes) not in (1, count):
        raise SequenceError(f"{path}: {count} frames but {len(boxes)} boxes; give one for the first frame, or all")
    truth = np.full((count, 4), np.nan)
    truth[: len(boxes)] = boxes
    known = np.flatnonzero(np.isfinite(truth).all(axis=1))
    if not known.size:
        raise SequenceError(f"{path}: no frame has a box")
    first = int(known[0])
    return _VideoSequence(path.stem, (path,) * (count - first), truth[first:], rate_hz, first)


def decoded(sequence: RecordedSequence) -> RecordedSequence:
    """The sequence of a layout; where its images are in a video, one that decodes it."""
    if sequence.paths[0].name != VIDEO:
        return sequence
    return _VideoSequence(**{one.name: getattr(sequence, one.name) for one in fields(sequence)})
