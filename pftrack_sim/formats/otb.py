"""Layout of the OTB benchmark (Wu, Lim & Yang 2013): `img/0001.jpg`... and `groundtruth_rect.txt`.

One line per image: x, y, w, h, separated by commas, tabs or spaces. Boxes are 1-based: x = 1, w = 10 covers the first
ten columns, which is x = 0, w = 10 here. NaN or a size that is not positive means that the target is absent.
"""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats.sequence import RecordedSequence

IMAGES = "img"
TRUTH = "groundtruth_rect.txt"
EXPECTS = f"a folder {IMAGES}/ of numbered images and a file {TRUTH}"
SUFFIXES = (".bmp", ".jpeg", ".jpg", ".png")


def read_sequence(path: str | Path) -> RecordedSequence:
    """Read a recorded sequence in OTB layout, from its first frame with a true box on.

    Args:
        path: The folder above `img/`.

    Raises:
        SequenceError: The folder is missing or has another layout; images or boxes are missing, damaged, or differ in
            number.
    """
    folder = Path(path)
    if not folder.is_dir():
        raise SequenceError(f"{folder}: {'is not a folder' if folder.exists() else 'no such folder'}")
    if not (folder / IMAGES).is_dir() and not (folder / TRUTH).exists():
        raise SequenceError(f"{folder}: not a sequence in OTB layout, which is {EXPECTS}")
    paths = _image_paths(folder / IMAGES)
    truth = _truth(folder / TRUTH)
    if len(paths) != len(truth):
        raise SequenceError(f"{folder}: {len(paths)} images in {IMAGES}/ but {len(truth)} boxes in {TRUTH}")
    known = np.flatnonzero(np.isfinite(truth).all(axis=1))
    if known.size == 0:
        raise SequenceError(f"{folder / TRUTH}: no frame has a box")
    first = int(known[0])
    return RecordedSequence(folder.resolve().name, tuple(paths[first:]), truth[first:])


def _image_paths(folder: Path) -> list[Path]:
    """Images in the order of their numbers, without gaps."""
    if not folder.is_dir():
        raise SequenceError(f"{folder}: no such folder; {EXPECTS} are expected")
    try:
        found = [
            entry for entry in folder.iterdir() if entry.suffix.lower() in SUFFIXES and not entry.name.startswith(".")
        ]
    except OSError as error:
        raise SequenceError(f"{folder}: cannot be read: {error.strerror}") from None
    if not found:
        raise SequenceError(f"{folder}: no images ({', '.join(SUFFIXES)})")
    for entry in found:
        if not (entry.stem.isascii() and entry.stem.isdigit()):
            raise SequenceError(f"{entry}: an image's name must be its number, like 0001.jpg")
    numbered = sorted((int(entry.stem), entry) for entry in found)
    for (number, path), (following, other) in pairwise(numbered):
        if following == number:
            raise SequenceError(f"{folder}: {path.name} and {other.name} have the same number")
        if following != number + 1:
            raise SequenceError(f"{folder}: image {number + 1} is missing between {path.name} and {other.name}")
    return [path for _, path in numbered]


def _truth(path: Path) -> FloatArray:
    """`(N, 4)` 0-based boxes [px], NaN rows where the target is absent."""
    if not path.is_file():
        raise SequenceError(f"{path}: no such file; {EXPECTS} are expected")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise SequenceError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SequenceError(f"{path}: is not a text file") from None
    if not text.strip():
        raise SequenceError(f"{path}: is empty")
    rows = [_box(path, number, line) for number, line in enumerate(text.rstrip().splitlines(), start=1)]
    return np.array(rows, dtype=np.float64)


def _box(path: Path, number: int, line: str) -> list[float]:
    fields = re.split(r"\s*,\s*|\s+", line.strip())
    try:
        x, y, w, h = (float(field) for field in fields)
    except ValueError:
        shown = line.strip()[:60]
        raise SequenceError(f"{path}, line {number}: expected four numbers x, y, w, h, got {shown!r}") from None
    if np.isinf([x, y, w, h]).any():
        raise SequenceError(f"{path}, line {number}: expected finite numbers or NaN, got {line.strip()!r}")
    if np.isnan([x, y, w, h]).any() or w <= 0.0 or h <= 0.0:
        return [np.nan] * 4
    return [x - 1.0, y - 1.0, w, h]
