"""Layout of the VOT challenges (Kristan et al.): `color/00000001.jpg`..., `groundtruth.txt` with 0-based boxes.

The file `sequence` names the channels and tells rate, size and length; every attribute has a file `NAME.tag` with a
flag per line. `0,0,0,0` means absent, NaN unknown; `occlusion.tag` marks frames in which less than half shows. Regions
that are no rectangles (polygons of 8 or more numbers) become the boxes around them.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats.files import box_lines, numbered_images, present_boxes, read_text
from pftrack_sim.formats.sequence import Annotations, RecordedSequence

EXPECTS = "a folder color/ of numbered images and the files groundtruth.txt and sequence"
IMAGE = "color/{:08d}"
_TRUTH, _SEQUENCE = "groundtruth.txt", "sequence"
_OCCLUDED_BELOW = 0.5


def matches(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return (folder / _TRUTH).exists() and ((folder / _SEQUENCE).is_file() or (folder / "color").is_dir())


def read(folder: Path) -> RecordedSequence:
    """Read a sequence; see `formats.read_sequence`."""
    lines = read_text(folder / _TRUTH).rstrip().splitlines()
    rows = [_box(folder / _TRUTH, index, line) for index, line in enumerate(lines, start=1)]
    truth = present_boxes(np.array(rows, dtype=np.float64).reshape(-1, 4))
    rate_hz = None
    if (folder / _SEQUENCE).is_file():
        found = re.search(r"^fps=(.*)$", read_text(folder / _SEQUENCE), re.MULTILINE)
        try:
            rate_hz = float(found[1]) if found else None
        except ValueError:
            raise SequenceError(f"{folder / _SEQUENCE}: fps must be a number") from None
    images = folder / "color"
    paths = numbered_images(images if images.is_dir() else folder)
    return RecordedSequence.checked(folder, _TRUTH, paths, truth, rate_hz)


def _box(path: Path, number: int, line: str) -> list[float]:
    try:
        values: FloatArray = np.array([float(field) for field in line.split(",")])
    except ValueError:
        values = np.zeros(0)
    if values.size == 4 and not np.isinf(values).any():
        return values.tolist()
    if values.size >= 6 and values.size % 2 == 0 and np.isfinite(values).all():
        corners = values.reshape(-1, 2)
        low, high = corners.min(axis=0), corners.max(axis=0)
        return [*low.tolist(), *(high - low).tolist()]
    shown = line.strip()[:60]
    raise SequenceError(f"{path}, line {number}: expected a rectangle x,y,w,h or a polygon x,y,x,y,..., got {shown!r}")


def write(folder: Path, annotations: Annotations) -> None:
    """Write the annotations beside the images."""
    (folder / _TRUTH).write_text(box_lines(annotations.boxes), encoding="utf-8")
    suffix = next(path.suffix for path in sorted((folder / "color").iterdir()))
    width, height = annotations.image_size_px
    values = {
        "name": annotations.name,
        "channels.color": f"color/%08d{suffix}",
        "fps": f"{annotations.rate_hz:g}",
        "format": "default",
        "width": width,
        "height": height,
        "length": len(annotations),
    }
    (folder / _SEQUENCE).write_text("".join(f"{key}={value}\n" for key, value in values.items()), encoding="utf-8")
    tags = {"occlusion": annotations.visible_fraction < _OCCLUDED_BELOW, **annotations.tags}
    for name, flags in tags.items():
        (folder / f"{name}.tag").write_text("".join(f"{int(flag)}\n" for flag in flags), encoding="utf-8")
