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
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.records import Image
from pftrack_sim.formats.files import SUFFIXES, JsonBox, JsonNumber, json_content, present_boxes
from pftrack_sim.formats.sequence import Annotations, PersonBox, RecordedSequence, decoded_image

EXPECTS = "a file frames.tar of images, each with a .json of the same name"
IMAGE = "{:08d}"
SHARD = "frames.tar"
TARGET = 1
_MAX_SAMPLE_BYTES = 1 << 20


class _Sample(BaseModel):
    frame: int
    time_s: JsonNumber
    box: JsonBox | None


@dataclass(frozen=True, eq=False)
class _ShardSequence(RecordedSequence):
    """Images are read from the shard when they are asked for.

    Attributes:
        members: Name of each image, where it begins in the shard, and its size [bytes].
    """

    members: tuple[tuple[str, int, int], ...] = ()

    def _read_image(self, index: int) -> Image:
        name, start, size = self.members[index]
        try:
            with self.paths[index].open("rb") as shard:
                shard.seek(start)
                return decoded_image(f"{self.paths[index]}: {name}", shard.read(size))
        except OSError as error:
            raise SequenceError(f"{self.paths[index]}: cannot be read: {error.strerror}") from None


def matches(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return (folder / SHARD).is_file()


def read(folder: Path) -> RecordedSequence:
    """Read the samples of a shard in the order of their frames; see `formats.read_sequence`."""
    path = folder / SHARD
    images: dict[str, tuple[str, int, int]] = {}
    samples: dict[str, _Sample] = {}
    try:
        with tarfile.open(path, "r:") as shard:
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
    except OSError as error:
        raise SequenceError(f"{path}: cannot be read: {error.strerror or error}") from None
    if lonely := sorted(images.keys() ^ samples.keys()):
        raise SequenceError(f"{path}: {lonely[0]} has no {'json' if lonely[0] in images else 'image'}")
    ordered = sorted(samples, key=lambda name: samples[name].frame)
    for number, name in enumerate(ordered):
        if samples[name].frame != number:
            raise SequenceError(f"{path}: {name} has frame {samples[name].frame}, expected {number}: one is missing")
    rows = [samples[name].box or (np.nan,) * 4 for name in ordered]
    truth = present_boxes(np.array(rows, dtype=np.float64).reshape(-1, 4))
    span_s = samples[ordered[-1]].time_s - samples[ordered[0]].time_s if ordered else 0.0
    rate_hz = (len(ordered) - 1) / span_s if span_s > 0.0 else None
    whole = RecordedSequence.checked(folder, SHARD, [path] * len(ordered), truth, rate_hz)
    members = tuple(images[name] for name in ordered[whole.start :])
    return _ShardSequence(whole.name, whole.paths, whole.truth, rate_hz, whole.start, members=members)


def write(folder: Path, annotations: Annotations) -> None:
    """Do nothing: every sample holds its own annotations."""


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


def index(root: Path, names: Sequence[str]) -> Iterator[tuple[str, Iterator[str]]]:
    """The list of the shards."""
    yield "shards.txt", (f"{name}/{SHARD}\n" for name in names)
