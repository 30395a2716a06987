"""Layouts of data sets by name: how sequences are found, read and written."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pftrack_sim.core.errors import SequenceError, UnknownNameError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats import coco, got10k, kitti, lasot, mot, otb, ros2, video, vot, webdataset
from pftrack_sim.formats.sequence import Annotations, RecordedSequence

_DEPTH = 3
"""Folders below a data set in which its sequences are looked for."""


def _no_index(root: Path, names: Sequence[str]) -> Iterator[tuple[str, Iterator[str]]]:
    yield from ()


@dataclass(frozen=True)
class Layout:
    """How a data set lays out its sequences.

    Attributes:
        title: The data set.
        expects: Files of a sequence, for messages.
        matches: Whether a folder has this layout.
        read: Reads the sequence in a folder.
        write: Writes the annotations of a sequence into the folder that holds its images.
        image: Path of an image within the folder without its suffix, formatted with its number.
        sequences: Folder of the sequences within the data set.
        index: Files of the data set besides its sequences, in pieces, by their path; from the folder of the data set,
            whose sequences are there, and their names.
        first: Number of the first image.
        needs: `"masks"` and `"solids"`: what of `PersonBox` it writes besides boxes.
        packed: Whether a sequence is a shard: an archive with a text for each image.
        video: Whether a video may stand for the images: no public tool that reads the layout opens or counts them.
    """

    title: str
    expects: str
    matches: Callable[[Path], bool]
    read: Callable[[Path], RecordedSequence]
    write: Callable[[Path, Annotations], None]
    image: str
    sequences: str = "."
    index: Callable[[Path, Sequence[str]], Iterator[tuple[str, Iterator[str]]]] = _no_index
    first: int = 1
    needs: frozenset[str] = frozenset()
    packed: bool = False
    video: bool = False


def _layout(title: str, module: Any, sequences: str = ".", **options: Any) -> Layout:
    parts = (module.EXPECTS, module.matches, module.read, module.write, module.IMAGE)
    return Layout(title, *parts, sequences, getattr(module, "index", _no_index), **options)


LAYOUTS: dict[str, Layout] = {
    "otb": _layout("OTB", otb),
    "mot": _layout("MOTChallenge", mot, "pftrack-train", video=True),
    "got10k": _layout("GOT-10k", got10k, "val"),
    "vot": _layout("VOT", vot, "sequences"),
    "lasot": _layout("LaSOT", lasot, video=True),
    "coco": _layout("COCO", coco, coco.IMAGES, needs=frozenset({"masks"})),
    "kitti": _layout("KITTI", kitti, kitti.IMAGES, first=0, needs=frozenset({"solids"})),
    "webdataset": _layout("WebDataset", webdataset, packed=True),
}
"""In the order in which they are looked for: `groundtruth.txt` alone does not tell GOT-10k, VOT and LaSOT apart."""


def find_sequences(root: str | Path, layout: str | None = None) -> list[tuple[Path, str]]:
    """Folders of the sequences of a data set, sorted by name, each with its layout.

    Args:
        root: Folder of the data set, or of one sequence.
        layout: One of `LAYOUTS`; None finds out by the files that are there.

    Raises:
        UnknownNameError: No such layout.
        SequenceError: The folder is missing, or nothing in it is a sequence.
    """
    top = _checked_folder(root, layout)
    known = LAYOUTS if layout is None else {layout: LAYOUTS[layout]}
    found: list[tuple[Path, str]] = []
    for text, below, _ in os.walk(top):
        folder = Path(text)
        name = next((name for name, one in known.items() if one.matches(folder)), None)
        if name is not None:
            found.append((folder, name))
        if name is not None or len(folder.relative_to(top).parts) >= _DEPTH:
            below.clear()
        below[:] = [one for one in below if not one.startswith(".")]
    if not found:
        raise SequenceError(f"{top}: no sequence in a known layout ({_expected(known.values())})")
    return sorted(found)


def _checked_folder(path: str | Path, layout: str | None) -> Path:
    folder = Path(path)
    if layout is not None and layout not in LAYOUTS:
        raise UnknownNameError("layout", layout, LAYOUTS)
    if not folder.is_dir():
        raise SequenceError(f"{folder}: {'is not a folder' if folder.exists() else 'no such folder'}")
    return folder


def _expected(known: Iterable[Layout]) -> str:
    return "; ".join(f"{one.title}: {one.expects}" for one in known)


def read_sequence(
    path: str | Path, layout: str | None = None, topics: Sequence[str] = (), boxes: FloatArray | None = None
) -> RecordedSequence:
    """Read a recorded sequence, from its first frame with a true box on.

    Args:
        path: Its folder; or an MCAP file, a ROS 2 bag or its folder, or a video file.
        layout: One of `LAYOUTS`; None finds out by the files that are there.
        topics: Of images and of boxes in an MCAP file or a bag, where there are several.
        boxes: `(1, 4)` box of a video's first frame [px], or `(N, 4)` boxes of all its frames.

    Raises:
        UnknownNameError: No such layout.
        RunError: The library for MCAP files and bags is missing.
        SequenceError: The folder is missing or has another layout; images or boxes are missing, damaged, or differ in
            number.
    """
    if layout is None and (file := ros2.find(Path(path))) is not None:
        return ros2.read(file, topics)
    if layout is None and Path(path).is_file():
        if boxes is None:
            words = "is not a folder, and a video needs the box of its first frame: --box x,y,w,h or a file of boxes"
            raise SequenceError(f"{path}: {words}")
        return video.read(Path(path), boxes)
    folder = _checked_folder(path, layout)
    if layout is not None:
        return video.decoded(LAYOUTS[layout].read(folder))
    for known in LAYOUTS.values():
        if known.matches(folder):
            return video.decoded(known.read(folder))
    raise SequenceError(f"{folder}: not a sequence in a known layout ({_expected(LAYOUTS.values())})")


def read_sequences(
    path: str | Path, layout: str | None = None, topics: Sequence[str] = (), boxes: FloatArray | None = None
) -> list[RecordedSequence]:
    """Read a sequence, or all of a data set's; arguments and errors are those of `read_sequence`."""
    top = Path(path)
    if not top.is_dir() or ros2.find(top) is not None or not any(entry.is_dir() for entry in top.iterdir()):
        return [read_sequence(path, layout, topics, boxes)]
    try:
        found = find_sequences(path, layout)
    except SequenceError:
        return [read_sequence(path, layout)]  # its message names what is missing
    return [read_sequence(folder, known) for folder, known in found]
