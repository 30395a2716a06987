"""COCO's format for detection (Lin et al. 2014): `images/NAME/00000001.jpg`... and `annotations/instances.json`.

Every person of whom a pixel shows is an annotation: `bbox` and `area` are those of the visible pixels, `segmentation`
is their run-length code, column by column, as a list of counts. Besides COCO's keys: `track_id`, `amodal_bbox`,
`visible_fraction`, `truncation`, and `video` and `frame` of an image. Boxes are 0-based.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

from pftrack_sim.formats.sequence import Annotations, PersonBox

IMAGE = "{:08d}"
IMAGES = "images"
_IMAGES, _PEOPLE = "images.jsonl", "annotations.jsonl"
_FRAMES, _PERSONS = 1_000_000, 1_000
"""Most frames of a sequence, and most persons of a frame: numbers of images and annotations are counted in steps."""


def write(folder: Path, annotations: Annotations) -> None:
    """Write the annotations of a sequence beside its images, an entry in each line."""
    width, height = annotations.image_size_px
    suffix = next(path.suffix for path in sorted(folder.iterdir()) if path.suffix in (".jpg", ".png"))
    with (folder / _IMAGES).open("w") as images, (folder / _PEOPLE).open("w") as written:
        for frame, people in enumerate(annotations.people):
            image = annotations.number * _FRAMES + frame + 1
            name = f"{annotations.name}/{IMAGE.format(frame + 1)}{suffix}"
            entry = {"id": image, "file_name": name, "width": width, "height": height}
            images.write(json.dumps({**entry, "video": annotations.name, "frame": frame}) + "\n")
            for place, one in enumerate(one for one in people if one.mask):
                number = image * _PERSONS + place
                written.write(json.dumps(_annotation(number, image, one, (height, width))) + "\n")


def _annotation(number: int, image: int, person: PersonBox, size: tuple[int, int]) -> dict[str, object]:
    return {
        "id": number,
        "image_id": image,
        "category_id": 1,
        "bbox": list(person.visible_box),
        "area": sum(person.mask[1::2]),
        "iscrowd": 0,
        "segmentation": {"size": list(size), "counts": list(person.mask)},
        "track_id": person.identity,
        "amodal_bbox": [round(value, 5) for value in person.box],
        "visible_fraction": round(person.visible_fraction, 6),
        "truncation": round(person.truncation, 6),
    }


def index(root: Path, names: Sequence[str]) -> Iterator[tuple[str, Iterator[str]]]:
    """The annotations of all sequences in one file, copied line by line."""
    yield (
        "annotations/instances.json",
        chain(
            ['{"info": {"description": "pftrack-sim"}, "licenses": [],\n'],
            ['"categories": [{"id": 1, "name": "person", "supercategory": "person"}],\n"images": [\n'],
            _joined([root / IMAGES / name / _IMAGES for name in names]),
            ['],\n"annotations": [\n'],
            _joined([root / IMAGES / name / _PEOPLE for name in names]),
            ["]}\n"],
        ),
    )


def _joined(paths: Sequence[Path]) -> Iterator[str]:
    separator = ""
    for path in paths:
        with path.open() as lines:
            for line in lines:
                yield separator + line
                separator = ","
