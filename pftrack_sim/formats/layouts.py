"""Layouts of data sets by name: how sequences are found, read and written."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pftrack_sim.core.errors import SequenceError, UnknownNameError
from pftrack_sim.formats import got10k, lasot, mcap, mot, otb, vot
from pftrack_sim.formats.sequence import Annotations, RecordedSequence

_DEPTH = 3
"""Folders below a data set in which its sequences are looked for."""


@dataclass(frozen=True)
class Layout:
    """How a data set lays out a sequence.

    Attributes:
        title: The data set.
        expects: Files of a sequence, for messages.
        matches: Whether a folder has this layout.
        read: Reads the sequence in a folder.
        write: Writes the annotations of a sequence into the folder that holds its images.
        image: Path of an image within the folder without its suffix, formatted with its number from 1.
        sequences: Folder of the sequences within the data set.
        index: Files of the data set besides its sequences, by their path, from the sequences' names.
    """

    title: str
    expects: str
    matches: Callable[[Path], bool]
    read: Callable[[Path], RecordedSequence]
    write: Callable[[Path, Annotations], None]
    image: str
    sequences: str = "."
    index: Callable[[Sequence[str]], Mapping[str, str]] = lambda names: {}


LAYOUTS: dict[str, Layout] = {
    "otb": Layout("OTB", otb.EXPECTS, otb.matches, otb.read, otb.write, otb.IMAGE),
    "mot": Layout(
        "MOTChallenge", mot.EXPECTS, mot.matches, mot.read, mot.write, mot.IMAGE,
        "pftrack-train", mot.index,
    ),
    "got10k": Layout(
        "GOT-10k", got10k.EXPECTS, got10k.matches, got10k.read, got10k.write, got10k.IMAGE, "val", got10k.index
    ),
    "vot": Layout("VOT", vot.EXPECTS, vot.matches, vot.read, vot.write, vot.IMAGE, "sequences", vot.index),
    "lasot": Layout("LaSOT", lasot.EXPECTS, lasot.matches, lasot.read, lasot.write, lasot.IMAGE),
}  # fmt: skip
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


def read_sequence(path: str | Path, layout: str | None = None, topics: Sequence[str] = ()) -> RecordedSequence:
    """Read a recorded sequence, from its first frame with a true box on.

    Args:
        path: Its folder; or an MCAP file, or the folder of a ROS 2 bag.
        layout: One of `LAYOUTS`; None finds out by the files that are there.
        topics: Of images and of boxes in an MCAP file, where there are several.

    Raises:
        UnknownNameError: No such layout.
        RunError: The library for MCAP files is missing.
        SequenceError: The folder is missing or has another layout; images or boxes are missing, damaged, or differ in
            number.
    """
    if layout is None and (file := mcap.find(Path(path))) is not None:
        return mcap.read(file, topics)
    folder = _checked_folder(path, layout)
    if layout is not None:
        return LAYOUTS[layout].read(folder)
    for known in LAYOUTS.values():
        if known.matches(folder):
            return known.read(folder)
    raise SequenceError(f"{folder}: not a sequence in a known layout ({_expected(LAYOUTS.values())})")
