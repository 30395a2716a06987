"""Which layout a folder has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.formats import otb
from pftrack_sim.formats.sequence import RecordedSequence


@dataclass(frozen=True)
class SequenceFormat:
    """One way to lay a sequence out on disk.

    Attributes:
        expects: What a folder of this layout holds, for the message when none fits.
        recognises: Whether a folder looks like this layout, complete or not.
        read: Read it; raises SequenceError.
    """

    expects: str
    recognises: Callable[[Path], bool]
    read: Callable[[Path], RecordedSequence]


LAYOUTS = {"otb": SequenceFormat(otb.EXPECTS, otb.recognises, otb.read)}


def read_sequence(path: str | Path) -> RecordedSequence:
    """Read a recorded sequence, of whichever layout it is.

    Frames before the first one with truth are left out: a tracker cannot start there.

    Args:
        path: Its folder.

    Raises:
        SequenceError: No such folder, no known layout, or something in it is missing or wrong.
    """
    folder = Path(path)
    if not folder.is_dir():
        raise SequenceError(f"{folder}: {'is not a folder' if folder.exists() else 'no such folder'}")
    for layout in LAYOUTS.values():
        if layout.recognises(folder):
            return layout.read(folder)
    known = "; ".join(f"{name}: {layout.expects}" for name, layout in LAYOUTS.items())
    raise SequenceError(f"{folder}: no layout of a sequence that is known here ({known})")
