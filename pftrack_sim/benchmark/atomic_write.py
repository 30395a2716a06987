"""Files that are there whole or not at all, whatever happens while they are written."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from pftrack_sim.core.errors import RunError

_PART = ".part"


@contextlib.contextmanager
def appearing(path: Path) -> Iterator[Path]:
    """A name to write to in the block; at its end the file appears under its own, safely on the disk.

    Args:
        path: The file's own name; its folder is made.

    Raises:
        RunError: It cannot be written. Nothing is left behind then, and what was there before stays.
    """
    part = path.with_name(f".{path.name}.{secrets.token_hex(4)}{_PART}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        with open(part, "rb+") as written:
            os.fsync(written.fileno())
        os.replace(part, path)
        _sync_folder(path.parent)
    except OSError as error:
        raise RunError(f"cannot write {path}: {error.strerror or error}") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def write_whole(path: Path, content: bytes) -> None:
    """Write a file at once; see `appearing`."""
    with appearing(path) as part:
        part.write_bytes(content)


def remove_parts(folder: Path) -> None:
    """Remove what a killed writer left half-written."""
    for part in folder.rglob(f".*{_PART}"):
        part.unlink(missing_ok=True)


def _sync_folder(folder: Path) -> None:
    # Without this a crash of the machine may forget the new name. Not every system can do it to a folder.
    with contextlib.suppress(OSError):
        opened = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(opened)
        finally:
            os.close(opened)
