"""Layouts of data sets by name: how sequences are found, read and written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pftrack_sim.core.errors import SequenceError, UnknownNameError
from pftrack_sim.formats import got10k, lasot, mot, otb, vot
from pftrack_sim.formats.sequence import Annotations, RecordedSequence


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
        index: Path of the list of sequences within the data set; None where the layout has none.
        index_head: First line of that list.
    """

    title: str
    expects: str
    matches: Callable[[Path], bool]
    read: Callable[[Path], RecordedSequence]
    write: Callable[[Path, Annotations], None]
    image: str
    sequences: str = "."
    index: str | None = None
    index_head: str = ""


LAYOUTS: dict[str, Layout] = {
    "otb": Layout("OTB", otb.EXPECTS, otb.matches, otb.read, otb.write, otb.IMAGE),
    "mot": Layout(
        "MOTChallenge", mot.EXPECTS, mot.matches, mot.read, mot.write, mot.IMAGE,
        "pftrack-train", "seqmaps/pftrack-train.txt", "name\n",
    ),
    "got10k": Layout(
        "GOT-10k", got10k.EXPECTS, got10k.matches, got10k.read, got10k.write, got10k.IMAGE, "val", "val/list.txt"
    ),
    "vot": Layout("VOT", vot.EXPECTS, vot.matches, vot.read, vot.write, vot.IMAGE, "sequences", "sequences/list.txt"),
    "lasot": Layout("LaSOT", lasot.EXPECTS, lasot.matches, lasot.read, lasot.write, lasot.IMAGE),
}  # fmt: skip
"""In the order in which they are looked for: `groundtruth.txt` alone does not tell GOT-10k, VOT and LaSOT apart."""


def read_sequence(path: str | Path, layout: str | None = None) -> RecordedSequence:
    """Read a recorded sequence, from its first frame with a true box on.

    Args:
        path: Its folder.
        layout: One of `LAYOUTS`; None finds out by the files that are there.

    Raises:
        UnknownNameError: No such layout.
        SequenceError: The folder is missing or has another layout; images or boxes are missing, damaged, or differ in
            number.
    """
    folder = Path(path)
    if layout is not None and layout not in LAYOUTS:
        raise UnknownNameError("layout", layout, LAYOUTS)
    if not folder.is_dir():
        raise SequenceError(f"{folder}: {'is not a folder' if folder.exists() else 'no such folder'}")
    if layout is not None:
        return LAYOUTS[layout].read(folder)
    for known in LAYOUTS.values():
        if known.matches(folder):
            return known.read(folder)
    listed = "; ".join(f"{known.title}: {known.expects}" for known in LAYOUTS.values())
    raise SequenceError(f"{folder}: not a sequence in a known layout ({listed})")
