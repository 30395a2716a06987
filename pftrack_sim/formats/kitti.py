"""KITTI's format for tracking (Geiger et al. 2012): `image_02/NAME/000000.png`..., `label_02/NAME.txt`, `calib/`.

A line of labels is one person in one frame: frame, track, type, truncated, occluded, alpha, left, top, right, bottom,
height, width, length, x, y, z, rotation_y. Frames and pixels are counted from 0. The 3D box encloses the body and
stands on its own axes, not on the camera's: x, y, z is the middle of its lower face in the camera's frame [m],
rotation_y the direction of its x axis about the camera's y axis, which is exact where the camera does not tilt or roll.

Of occluded, 3 (unknown), which KITTI's scorers leave out, is a person of whom nothing shows. A sequence that is read is
that of track 1.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.formats.files import number, present_boxes, read_text
from pftrack_sim.formats.images import ImageFiles, numbered_images
from pftrack_sim.formats.sequence import TARGET, Annotations, Layout, PersonBox, RecordedSequence

_IMAGES = "image_02"
_LABELS, _CALIBRATION, _LIST = "label.txt", "calib.txt", "evaluate_tracking.seqmap.training"
_FULLY, _PARTLY, _LARGELY, _UNKNOWN = 0.95, 0.5, 0.0, 3
"""Visible share above which a person counts as fully visible (0), partly occluded (1), largely occluded (2)."""
_COLUMNS = (
    "frame, track, type, truncated, occluded, alpha, left, top, right, bottom, height, width, length, x, y, z, rotation"
)


def _label(person: PersonBox) -> str:
    assert person.solid is not None
    x, y, w, h = person.box
    height, width, length, *centre, turn = person.solid
    occluded = next(
        (level for level, share in enumerate((_FULLY, _PARTLY, _LARGELY)) if person.visible_fraction > share), _UNKNOWN
    )
    alpha = turn - math.atan2(centre[0], centre[2])
    alpha = math.remainder(alpha, 2.0 * math.pi)
    numbers = [alpha, x, y, x + w, y + h, height, width, length, *centre, turn]
    return f"Pedestrian {number(person.truncation)} {occluded} {' '.join(number(value) for value in numbers)}"


class _Kitti(Layout):
    title, expects = "KITTI", "a folder image_02/NAME/ of numbered images and label_02/NAME.txt"
    image, sequences, first, needs = "{:06d}", _IMAGES, 0, frozenset({"solids"})

    def matches(self, folder: Path) -> bool:
        above = folder.absolute().parent
        return above.name == _IMAGES and (above.parent / "label_02").is_dir()

    def read(self, folder: Path) -> RecordedSequence:
        paths = numbered_images(folder)
        labels = folder.absolute().parent.parent / "label_02" / f"{folder.absolute().name}.txt"
        first = int(paths[0].stem)
        truth = np.full((len(paths), 4), np.nan)
        for index, line in enumerate(read_text(labels).splitlines(), start=1):
            fields = line.split()
            try:
                frame, track, occluded = (int(fields[column]) for column in (0, 1, 4))
                left, top, right, bottom = (float(field) for field in fields[6:10])
            except (ValueError, IndexError):
                raise SequenceError(f"{labels}, line {index}: expected {_COLUMNS}, got {line.strip()[:60]!r}") from None
            if not first <= frame < first + len(paths):
                words = f"frame {frame}, but images are {first} to {first + len(paths) - 1}"
                raise SequenceError(f"{labels}, line {index}: {words}")
            if track == TARGET and occluded != _UNKNOWN:
                truth[frame - first] = left, top, right - left, bottom - top
        return RecordedSequence.checked(folder, str(labels), ImageFiles(paths), present_boxes(truth))

    def write(self, folder: Path, annotations: Annotations) -> None:
        with (folder / _LABELS).open("w") as written:
            for frame, people in enumerate(annotations.people):
                for one in people:
                    if one.solid is not None:
                        written.write(f"{frame} {one.identity} {_label(one)}\n")
        fx, fy, cx, cy = annotations.focal_and_centre_px
        projection = f"{fx:.6f} 0 {cx:.6f} 0 0 {fy:.6f} {cy:.6f} 0 0 0 1 0"
        lines = [f"P{camera}: {projection}" for camera in range(4)]
        lines += [
            "R_rect 1 0 0 0 1 0 0 0 1",
            "Tr_velo_cam 1 0 0 0 0 1 0 0 0 0 1 0",
            "Tr_imu_velo 1 0 0 0 0 1 0 0 0 0 1 0",
        ]
        (folder / _CALIBRATION).write_text("\n".join(lines) + "\n")

    def index(self, root: Path, names: Sequence[str]) -> Iterator[tuple[str, Iterator[str]]]:
        yield _LIST, (f"{name} empty {0:06d} {len(numbered_images(root / _IMAGES / name)):06d}\n" for name in names)
        for name in names:
            for folder, file in (("label_02", _LABELS), ("calib", _CALIBRATION)):
                yield f"{folder}/{name}.txt", iter([(root / _IMAGES / name / file).read_text()])


KITTI = _Kitti()
