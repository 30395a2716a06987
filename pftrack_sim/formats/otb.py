"""Layout of the OTB benchmark (Wu, Lim & Yang 2013): `img/0001.jpg`... and `groundtruth_rect.txt`.

One line per image: x, y, w, h, separated by commas, tabs or spaces. Boxes are 1-based: x = 1, w = 10 covers the first
ten columns, which is x = 0, w = 10 here. NaN or a size that is not positive means that the target is absent; the
benchmark's own scorer also takes x <= 0 for absent, which no 1-based box inside the image has.
"""

from __future__ import annotations

from pathlib import Path

from pftrack_sim.formats.files import box_lines, number_rows, numbered_images, present_boxes
from pftrack_sim.formats.sequence import Annotations, RecordedSequence

EXPECTS = "a folder img/ of numbered images and a file groundtruth_rect.txt"
IMAGE = "img/{:04d}"
_TRUTH = "groundtruth_rect.txt"


def matches(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return (folder / _TRUTH).exists()


def read(folder: Path) -> RecordedSequence:
    """Read a sequence; see `formats.read_sequence`."""
    truth = present_boxes(number_rows(folder / _TRUTH, "four numbers x, y, w, h", 4), first_pixel=1.0)
    return RecordedSequence.checked(folder, _TRUTH, numbered_images(folder / "img"), truth)


def write(folder: Path, annotations: Annotations) -> None:
    """Write the annotations beside the images."""
    (folder / _TRUTH).write_text(box_lines(annotations.boxes, first_pixel=1.0), encoding="utf-8")
