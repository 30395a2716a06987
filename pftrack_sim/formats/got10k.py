"""Layout of GOT-10k (Huang et al. 2019): `00000001.jpg`... beside `groundtruth.txt` with 0-based boxes.

`absence.label` and `cut_by_image.label` hold a flag per line, `cover.label` the visible share in eighths, rounded up,
so that a target of which one pixel shows has 1; `meta_info.ini` tells the rate. The benchmark's scorer leaves out the
first frame and those with cover 0.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.formats.files import box_lines, number_rows, numbered_images, present_boxes, read_text
from pftrack_sim.formats.sequence import Annotations, RecordedSequence

EXPECTS = "numbered images beside groundtruth.txt, absence.label, cut_by_image.label, cover.label and meta_info.ini"
IMAGE = "{:08d}"
_TRUTH, _ABSENCE, _COVER, _META = "groundtruth.txt", "absence.label", "cover.label", "meta_info.ini"
_EIGHTHS = 8


def matches(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return (folder / _TRUTH).exists() and any((folder / name).exists() for name in (_ABSENCE, _COVER, _META))


def read(folder: Path) -> RecordedSequence:
    """Read a sequence; see `formats.read_sequence`. Frames with an absent or entirely covered target have no box."""
    truth = present_boxes(number_rows(folder / _TRUTH, "four numbers x, y, w, h", 4))
    for name, gone in ((_ABSENCE, 1.0), (_COVER, 0.0)):
        if (folder / name).exists():
            flags = number_rows(folder / name, "one number", 1)[:, 0]
            if len(flags) != len(truth):
                raise SequenceError(f"{folder / name}: {len(flags)} labels but {len(truth)} boxes in {_TRUTH}")
            truth[flags == gone] = np.nan
    rate_hz = None
    if (folder / _META).exists():
        found = re.search(r"^anno_fps:\s*([0-9.]+)\s*Hz", read_text(folder / _META), re.MULTILINE)
        rate_hz = float(found[1]) if found and float(found[1]) > 0.0 else None
    return RecordedSequence.checked(folder, _TRUTH, numbered_images(folder), truth, rate_hz)


def index(root: Path, names: Sequence[str]) -> Iterator[tuple[str, Iterator[str]]]:
    """The list of sequences."""
    yield "val/list.txt", (f"{name}\n" for name in names)


def write(folder: Path, annotations: Annotations) -> None:
    """Write the annotations beside the images."""
    (folder / _TRUTH).write_text(box_lines(annotations.boxes), encoding="utf-8")
    absent = annotations.absent
    cover = [0 if gone else max(1, math.ceil(_EIGHTHS * share)) for gone, share in zip(
        absent, annotations.visible_fraction, strict=True
    )]  # fmt: skip
    labels = {_ABSENCE: absent, "cut_by_image.label": annotations.truncation > 0.0, _COVER: np.array(cover)}
    for name, values in labels.items():
        (folder / name).write_text("".join(f"{int(value)}\n" for value in values), encoding="utf-8")
    width, height = annotations.image_size_px
    meta = (
        f"[METAINFO]\nurl: none\nbegin: 00:00:00\nend: 00:00:00\nanno_fps: {annotations.rate_hz:g}Hz\n"
        "object_class: person\nmotion_class: walking\nmajor_class: person\nroot_class: person\n"
        f"motion_adverb: simulated\nresolution: ({width}, {height})\n"
    )
    (folder / _META).write_text(meta, encoding="utf-8")
