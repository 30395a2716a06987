"""The command `pftrack-sim`."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from pftrack_sim.core.errors import PftrackError
from pftrack_sim.core.inputs import keep_off_working_folder, read_bytes
from pftrack_sim.core.text import printable

_RUN_TRACKERS = ("bench", "evaluate", "follow", "limit", "render", "studio", "submit", "trax")
_FACTORY = re.compile(r"(?<![\w.])(?!trax:)[A-Za-z_][\w.]*:[A-Za-z_]")
_MAX_SUITE_BYTES = 1 << 20


def main() -> None:
    """Run the command line: a wrong input ends in one clear message and exit code 2, never in a traceback."""
    keep_off_working_folder()
    from pftrack_sim.cli.app import app

    if names_factory(sys.argv[1:]):
        # Last, so that it hides nothing installed.
        sys.path.append(os.getcwd())
    try:
        for word in sys.argv[1:]:
            if any(not character.isprintable() and character not in "\n\r\t" for character in word):
                raise PftrackError(f"an argument has characters that cannot be shown: {printable(word)}")
        app()
    except (PftrackError, OSError, MemoryError) as error:
        text = str(error) if isinstance(error, PftrackError) else _system_error(error)
        print(f"pftrack-sim: {text}", file=sys.stderr)  # noqa: T201 - this is the command line
        sys.exit(2)


def names_factory(words: Sequence[str]) -> bool:
    """Whether a command line asks to run a `module:factory`, which may lie in the working folder.

    Only then is that folder on the path: a folder of unknown origin may hold a module with the name of an optional one.

    >>> names_factory(["bench", "corridor", "--seeds", "0:3", "--trackers", "mine.tracker:make"])
    True
    >>> names_factory(["bench", "corridor", "--seeds", "0:3"]), names_factory(["report", "a:b"])
    (False, False)
    >>> names_factory(["bench", "corridor", "--trackers", "trax:python tracker.py"])
    False
    """
    if not words or words[0] not in _RUN_TRACKERS:
        return False
    return any(_FACTORY.search(text) for word in words[1:] for text in (word, _suite_text(word)))


def _suite_text(word: str) -> str:
    """The text of a TOML file, which may be a suite that names factories."""
    if not word.endswith(".toml"):
        return ""
    try:
        return read_bytes(Path(word), _MAX_SUITE_BYTES).decode(errors="replace")
    except OSError:
        return ""


def _system_error(error: OSError | MemoryError) -> str:
    if isinstance(error, MemoryError):
        return "out of memory"
    names = [printable(str(name)) for name in (error.filename, error.filename2) if name is not None]
    return f"{error.strerror or printable(str(error))}{': ' if names else ''}{', '.join(names)}"
