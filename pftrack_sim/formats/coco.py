"""COCO's format for detection (Lin et al. 2014): `images/NAME/00000001.jpg`... and `annotations/instances.json`.

Every person of whom a pixel shows is an annotation: `bbox` and `area` are those of the visible pixels, `segmentation`
is their run-length code, column by column, as a list of counts. Besides COCO's keys: `track_id`, `amodal_bbox`,
`visible_fraction`, `truncation`, and `video` and `frame` of an image. Boxes are 0-based.

A sequence that is read is a folder of images: those of the annotations whose `file_name` ends in it, in the order of
their numbers. The target is `track_id` 1; its box is `amodal_bbox`, or `bbox` where there is none.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import chain
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.inputs import read_bytes
from pftrack_sim.formats.files import JsonBox, json_content, present_boxes, reading
from pftrack_sim.formats.images import ImageFiles, image_suffix, numbered_images
from pftrack_sim.formats.sequence import TARGET, Annotations, Layout, PersonBox, RecordedSequence

_INSTANCES = "annotations/instances.json"
_MAX_INSTANCES_BYTES = 1 << 30
_LISTED, _PEOPLE = "images.jsonl", "annotations.jsonl"
_FRAMES, _PERSONS = 1_000_000, 1_000
"""Most frames of a sequence, and most persons of a frame: numbers of images and annotations are counted in steps."""


class _Image(BaseModel):
    id: int
    file_name: str


class _Person(BaseModel):
    image_id: int
    bbox: JsonBox
    amodal_bbox: JsonBox | None = None
    track_id: int | None = None


class _Instances(BaseModel):
    images: list[_Image]
    annotations: list[_Person]


@lru_cache(maxsize=1)
def _targets(source: Path, changed: tuple[int, int]) -> Mapping[str, Mapping[str, JsonBox | None]]:
    """Box of the target by name of the image, by its folder; cached: one file holds all sequences of a data set."""
    found = json_content(source, read_bytes(source, _MAX_INSTANCES_BYTES), _Instances)
    boxes = {one.image_id: one.amodal_bbox or one.bbox for one in found.annotations if one.track_id == TARGET}
    targets: dict[str, dict[str, JsonBox | None]] = {}
    for image in found.images:
        path = Path(image.file_name)
        targets.setdefault(path.parent.name, {})[path.name] = boxes.get(image.id)
    return targets


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


def _joined(paths: Sequence[Path]) -> Iterator[str]:
    separator = ""
    for path in paths:
        with path.open() as lines:
            for line in lines:
                yield separator + line
                separator = ","


class _Coco(Layout):
    title, expects = "COCO", "a folder images/NAME/ of numbered images and annotations/instances.json"
    image, sequences, needs = "{:08d}", "images", frozenset({"masks"})

    def matches(self, folder: Path) -> bool:
        above = folder.absolute().parent
        return above.name == "images" and (above.parent / "annotations").is_dir()

    def read(self, folder: Path) -> RecordedSequence:
        paths = numbered_images(folder)
        source = folder.absolute().parent.parent / _INSTANCES
        with reading(source):
            changed = source.stat()
            targets = _targets(source, (changed.st_mtime_ns, changed.st_size))
        listed = targets.get(folder.absolute().name) or {}
        if missing := sorted({path.name for path in paths} ^ listed.keys()):
            words = "is not listed" if missing[0] not in listed else "is listed, but there is no such image"
            raise SequenceError(f"{source}: {folder / missing[0]} {words}")
        rows = [listed[path.name] or (np.nan,) * 4 for path in paths]
        truth = present_boxes(np.array(rows, dtype=np.float64))
        return RecordedSequence.checked(folder, str(source), ImageFiles(paths), truth)

    def write(self, folder: Path, annotations: Annotations) -> None:
        width, height = annotations.image_size_px
        suffix = image_suffix(folder)
        with (folder / _LISTED).open("w") as images, (folder / _PEOPLE).open("w") as written:
            for frame, people in enumerate(annotations.people):
                image = annotations.number * _FRAMES + frame + 1
                name = f"{annotations.name}/{self.image.format(frame + 1)}{suffix}"
                entry = {"id": image, "file_name": name, "width": width, "height": height}
                images.write(json.dumps({**entry, "video": annotations.name, "frame": frame}) + "\n")
                for place, one in enumerate(one for one in people if one.mask):
                    number = image * _PERSONS + place
                    written.write(json.dumps(_annotation(number, image, one, (height, width))) + "\n")

    def index(self, root: Path, names: Sequence[str]) -> Iterator[tuple[str, Iterator[str]]]:
        head = (
            '{"info": {"description": "pftrack-sim"}, "licenses": [],\n'
            '"categories": [{"id": 1, "name": "person", "supercategory": "person"}],\n"images": [\n'
        )
        images, people = (_joined([root / "images" / name / file for name in names]) for file in (_LISTED, _PEOPLE))
        yield _INSTANCES, chain([head], images, ['],\n"annotations": [\n'], people, ["]}\n"])


COCO = _Coco()
