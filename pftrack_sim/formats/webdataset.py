"""Shards for training as WebDataset reads them: `NAME/frames.tar` with a sample for every frame.

A sample is an image and `.json` with the same name: sequence, frame, time_s, the target's box and everybody in view
(0-based boxes); maps, where they are asked for, are `.depth.png`, `.masks.png` and `.flow.png`. `shards.txt` lists the
shards.
"""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.image_files import MAX_FILE_BYTES
from pftrack_sim.core.records import Image
from pftrack_sim.formats.files import JsonBox, JsonNumber, json_content, present_boxes, reading
from pftrack_sim.formats.images import SUFFIXES, Images, decoded_image
from pftrack_sim.formats.sequence import TARGET, Annotations, Layout, PersonBox, RecordedSequence

SHARD = "frames.tar"
_MAX_SAMPLE_BYTES = 1 << 20


class _Sample(BaseModel):
    frame: int
    time_s: JsonNumber
    box: JsonBox | None


class _ShardImages(Images):
    """Images of a shard; of each the name, where it begins, and its size [bytes]."""

    def __init__(self, path: Path, members: Sequence[tuple[str, int, int]]) -> None:
        self._path, self._members = path, members

    def __len__(self) -> int:
        return len(self._members)

    def read(self, index: int) -> Image:
        _, start, size = self._members[index]
        if size > MAX_FILE_BYTES:
            raise SequenceError(f"{self.where(index)}: larger than {MAX_FILE_BYTES} bytes, the most that is read")
        with reading(self._path), self._path.open("rb") as shard:
            shard.seek(start)
            return decoded_image(self.where(index), shard.read(size))

    def where(self, index: int) -> str:
        return f"{self._path}: {self._members[index][0]}"


def sample(name: str, frame: int, time_s: float, people: Sequence[PersonBox]) -> bytes:
    """The JSON of a frame; `box` is null where no pixel of the target is visible."""
    listed = [
        {
            "identity": one.identity,
            "box": [round(value, 5) for value in one.box],
            "visible_box": list(one.visible_box) or None,
            "visible_fraction": round(one.visible_fraction, 6),
            "truncation": round(one.truncation, 6),
        }
        for one in people
    ]
    box = next((one["box"] for one in listed if one["identity"] == TARGET and one["visible_box"]), None)
    content = {"sequence": name, "frame": frame, "time_s": round(time_s, 9), "box": box, "people": listed}
    return json.dumps(content).encode()


def add_member(shard: tarfile.TarFile, name: str, content: bytes) -> None:
    """Append a file with the same header whenever and by whomever it is written."""
    member = tarfile.TarInfo(name)
    member.size = len(content)
    shard.addfile(member, io.BytesIO(content))


class _WebDataset(Layout):
    title, expects = "WebDataset", "a file frames.tar of images, each with a .json of the same name"
    image, packed = "{:08d}", True

    def matches(self, folder: Path) -> bool:
        return (folder / SHARD).is_file()

    def read(self, folder: Path) -> RecordedSequence:
        path = folder / SHARD
        images: dict[str, tuple[str, int, int]] = {}
        samples: dict[str, _Sample] = {}
        try:
            with reading(path), tarfile.open(path, "r:") as shard:
                for member in shard:
                    stem, dot, suffix = member.name.rpartition(".")
                    if member.isreg() and f"{dot}{suffix}" in SUFFIXES and "." not in Path(stem).name:
                        images[stem] = (member.name, member.offset_data, member.size)
                    elif member.isreg() and suffix == "json":
                        opened = shard.extractfile(member)
                        content = opened.read(_MAX_SAMPLE_BYTES) if opened is not None else b""
                        samples[stem] = json_content(f"{path}: {member.name}", content, _Sample)
        except tarfile.TarError as error:
            raise SequenceError(f"{path}: is no tar file, or it is damaged: {error}") from None
        if lonely := sorted(images.keys() ^ samples.keys()):
            raise SequenceError(f"{path}: {lonely[0]} has no {'json' if lonely[0] in images else 'image'}")
        ordered = sorted(samples, key=lambda name: samples[name].frame)
        for number, name in enumerate(ordered):
            if samples[name].frame != number:
                raise SequenceError(
                    f"{path}: {name} has frame {samples[name].frame}, expected {number}: one is missing"
                )
        rows = [samples[name].box or (np.nan,) * 4 for name in ordered]
        truth = present_boxes(np.array(rows, dtype=np.float64).reshape(-1, 4))
        span_s = samples[ordered[-1]].time_s - samples[ordered[0]].time_s if ordered else 0.0
        rate_hz = (len(ordered) - 1) / span_s if span_s > 0.0 else None
        shard_images = _ShardImages(path, [images[name] for name in ordered])
        return RecordedSequence.checked(folder, SHARD, shard_images, truth, rate_hz)

    def write(self, folder: Path, annotations: Annotations) -> None:
        """Do nothing: every sample holds its own annotations."""

    def index(self, root: Path, names: Sequence[str]) -> Iterator[tuple[str, Iterator[str]]]:
        yield "shards.txt", (f"{name}/{SHARD}\n" for name in names)


WEBDATASET = _WebDataset()
