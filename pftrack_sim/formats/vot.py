"""Layout of the VOT challenges (Kristan et al.): `color/00000001.jpg`..., `groundtruth.txt` with 0-based boxes.

The file `sequence` names the channels and tells rate, size and length; every attribute has a file `NAME.tag` with a
flag per line. `0,0,0,0` means absent, NaN unknown; `occlusion.tag` marks frames in which less than half shows, and
`visibility.value` holds the visible share. Regions that are no rectangles (polygons of 6 or more numbers, masks) become
the boxes around them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from pftrack_sim.core.boxes import mask_box, polygon_box
from pftrack_sim.core.errors import SequenceError
from pftrack_sim.formats.files import box_lines, number, numbered_images, present_boxes, read_text
from pftrack_sim.formats.sequence import Annotations, RecordedSequence

EXPECTS = "a folder color/ of numbered images and the files groundtruth.txt and sequence"
IMAGE = "color/{:08d}"
_TRUTH, _SEQUENCE = "groundtruth.txt", "sequence"
_OCCLUDED_BELOW = 0.5
_STACK = "pftrack-sim.yaml"
EXPERIMENT = "unsupervised"
"""Name of the experiment: the tracker starts once and is not reset."""


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


def region_box(text: str) -> list[float] | None:
    """Box x, y, w, h [px] around a region as VOT writes them, or None where the text is none.

    Regions are rectangles `x,y,w,h`, polygons `x,y,x,y,...` and masks `mX,Y,W,H,N,N,...`, whose numbers of pixels off
    and on alternate row by row from the corner X, Y on. A mask without pixels and a polygon with NaN have NaN.

    >>> region_box("10,20,30,25,28,40"), region_box("m3,4,4,2,1,2,2,1,2"), region_box("1,2,x,4")
    ([10.0, 20.0, 20.0, 20.0], [4.0, 4.0, 2.0, 2.0], None)
    """
    is_mask = text.startswith("m")
    try:
        values = np.array([float(field) for field in text.removeprefix("m").split(",")])
    except ValueError:
        return None
    if np.isinf(values).any():
        return None
    if is_mask:
        box = mask_box(values)
        return box if box is None else box.tolist() if box[2:].all() else [np.nan] * 4
    if values.size == 4:
        return values.tolist()
    if values.size >= 6 and values.size % 2 == 0:
        return polygon_box(values).tolist()
    return None


def _box(path: Path, line_number: int, line: str) -> list[float]:
    box = region_box(line.strip())
    if box is not None:
        return box
    shown = line.strip()[:60]
    raise SequenceError(
        f"{path}, line {line_number}: expected a rectangle x,y,w,h, a polygon x,y,x,y,... or a mask m..., got {shown!r}"
    )


def index(root: Path, names: Sequence[str]) -> Iterator[tuple[str, Iterator[str]]]:
    """The list of sequences, and the workspace around it: experiments and where trackers are described.

    The experiment runs a tracker once from the first frame on; without `vot initialize` nothing is downloaded.
    """
    yield "sequences/list.txt", (f"{name}\n" for name in names)
    yield "config.yaml", iter([f"stack: {_STACK}\nregistry:\n- ./trackers.ini\nsequences: sequences\n"])
    analyses = (
        "    - type: average_accuracy\n      name: accuracy\n      burnin: 1\n"
        "    - type: vot.analysis.longterm.AccuracyRobustness\n      name: ar\n"
    )
    experiment = f"experiments:\n  {EXPERIMENT}:\n    type: unsupervised\n    repetitions: 1\n    analyses:\n"
    yield _STACK, iter(["title: pftrack-sim\n", experiment, analyses])


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
    shares = "".join(f"{number(share)}\n" for share in annotations.visible_fraction.tolist())
    (folder / "visibility.value").write_text(shares, encoding="utf-8")
