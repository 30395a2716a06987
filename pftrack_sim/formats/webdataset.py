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

from pftrack_sim.formats.sequence import Annotations, PersonBox

IMAGE = "{:08d}"
SHARD = "frames.tar"
TARGET = 1


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
