"""Layout of LaSOT (Fan et al. 2019): `img/00000001.jpg`... and `groundtruth.txt` with 1-based boxes as in OTB.

`full_occlusion.txt` and `out_of_view.txt` hold a flag per image on one line, separated by commas.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.formats.files import box_lines, number_rows, numbered_images, present_boxes, read_text
from pftrack_sim.formats.sequence import Annotations, RecordedSequence

EXPECTS = "a folder img/ of numbered images and the files groundtruth.txt, full_occlusion.txt and out_of_view.txt"
IMAGE = "img/{:08d}"
_TRUTH, _OCCLUSION, _OUT = "groundtruth.txt", "full_occlusion.txt", "out_of_view.txt"


def matches(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return (folder / _TRUTH).exists() and ((folder / _OCCLUSION).exists() or (folder / "img").is_dir())


def read(folder: Path) -> RecordedSequence:
    """Read a sequence; see `formats.read_sequence`. Frames with either flag have no box."""
    truth = present_boxes(number_rows(folder / _TRUTH, "four numbers x, y, w, h", 4), first_pixel=1.0)
    for name in (_OCCLUSION, _OUT):
        if (folder / name).exists():
            fields = read_text(folder / name).replace("\n", ",").split(",")
            flags = [field.strip() for field in fields if field.strip()]
            if len(flags) != len(truth) or not set(flags) <= {"0", "1"}:
                raise SequenceError(f"{folder / name}: expected {len(truth)} flags 0 or 1, got {len(flags)} values")
            truth[np.array(flags) == "1"] = np.nan
    return RecordedSequence.checked(folder, _TRUTH, numbered_images(folder / "img"), truth)


def write(folder: Path, annotations: Annotations) -> None:
    """Write the annotations beside the images."""
    (folder / _TRUTH).write_text(box_lines(annotations.boxes, first_pixel=1.0), encoding="utf-8")
    out = annotations.out_of_view
    for name, flags in ((_OCCLUSION, annotations.absent & ~out), (_OUT, out)):
        (folder / name).write_text(",".join(str(int(flag)) for flag in flags) + "\n", encoding="utf-8")
