"""KITTI's format for tracking (Geiger et al. 2012): `image_02/NAME/000000.png`..., `label_02/NAME.txt`, `calib/`.

A line of labels is one person in one frame: frame, track, type, truncated, occluded, alpha, left, top, right, bottom,
height, width, length, x, y, z, rotation_y. Frames and pixels are counted from 0. The 3D box encloses the body and
stands on its own axes, not on the camera's: x, y, z is the middle of its lower face in the camera's frame [m],
rotation_y the direction of its x axis about the camera's y axis, which is exact where the camera does not tilt or roll.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from pftrack_sim.formats.files import number
from pftrack_sim.formats.sequence import Annotations, PersonBox

IMAGE = "{:06d}"
IMAGES = "image_02"
_LABELS, _CALIBRATION = "label.txt", "calib.txt"
_FULLY, _PARTLY, _LARGELY = 0.95, 0.5, 0.0
"""Visible share above which a person counts as fully visible (0), partly occluded (1), largely occluded (2)."""


def write(folder: Path, annotations: Annotations) -> None:
    """Write labels and calibration beside the images."""
    with (folder / _LABELS).open("w") as written:
        for frame, people in enumerate(annotations.people):
            for one in people:
                if one.solid is not None:
                    written.write(f"{frame} {one.identity} {_label(one)}\n")
    fx, fy, cx, cy = annotations.focal_and_centre_px
    projection = f"{fx:.6f} 0 {cx:.6f} 0 0 {fy:.6f} {cy:.6f} 0 0 0 1 0"
    lines = [f"P{camera}: {projection}" for camera in range(4)]
    lines += ["R_rect 1 0 0 0 1 0 0 0 1", "Tr_velo_cam 1 0 0 0 0 1 0 0 0 0 1 0", "Tr_imu_velo 1 0 0 0 0 1 0 0 0 0 1 0"]
    (folder / _CALIBRATION).write_text("\n".join(lines) + "\n")


def _label(person: PersonBox) -> str:
    assert person.solid is not None
    x, y, w, h = person.box
    height, width, length, *centre, turn = person.solid
    occluded = next(
        (level for level, share in enumerate((_FULLY, _PARTLY, _LARGELY)) if person.visible_fraction > share), 2
    )
    alpha = turn - math.atan2(centre[0], centre[2])
    alpha = math.remainder(alpha, 2.0 * math.pi)
    numbers = [alpha, x, y, x + w, y + h, height, width, length, *centre, turn]
    return f"Pedestrian {number(person.truncation)} {occluded} {' '.join(number(value) for value in numbers)}"


def index(root: Path, names: Sequence[str]) -> Iterator[tuple[str, Iterator[str]]]:
    """Labels and calibrations of all sequences where KITTI has them."""
    for name in names:
        for folder, file in (("label_02", _LABELS), ("calib", _CALIBRATION)):
            yield f"{folder}/{name}.txt", iter([(root / IMAGES / name / file).read_text()])
