"""Atomic writes, locks, and what SQL and CSV need."""

from __future__ import annotations

import contextlib
import csv
import io
import os
import secrets
import sys
import threading
from collections.abc import Generator, Iterable, Sequence
from pathlib import Path

import duckdb

from pftrack_sim.core.errors import RunError

LOCK = ".lock"
"""Name of the file that a process locks while it writes to a folder."""

_PART = ".part"
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
READ_LIMIT_S = 120.0
"""Time for reading one file of a run."""


@contextlib.contextmanager
def atomic_write(path: Path) -> Generator[Path]:
    """Temporary path to write to in the block; at its end the file is moved to `path` and synced to the disk.

    Raises:
        RunError: It cannot be written; nothing is left behind, and an earlier file stays.
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


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file atomically."""
    with atomic_write(path) as part:
        part.write_bytes(content)


def remove_parts(folder: Path) -> None:
    """Remove the temporary files of writers that were killed."""
    for part in folder.rglob(f".*{_PART}"):
        part.unlink(missing_ok=True)


def lock_folder(folder: Path) -> int:
    """Lock a folder until the descriptor returned is closed; raises RunError while another process holds the lock."""
    opened = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    if sys.platform != "win32":
        import fcntl

        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(opened)
            raise RunError(f"another process is writing to {folder}") from None
        except OSError:
            pass  # a file system without locks: files are still written atomically
    return opened


def _sync_folder(folder: Path) -> None:
    # Without this a crash of the machine may lose the new name. Some systems cannot sync folders.
    with contextlib.suppress(OSError):
        opened = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(opened)
        finally:
            os.close(opened)


@contextlib.contextmanager
def query_deadline(database: duckdb.DuckDBPyConnection, limit_s: float | None = READ_LIMIT_S) -> Generator[None]:
    """Interrupt the database's query when the block takes longer; it raises `duckdb.InterruptException` then."""
    if limit_s is None:
        yield
        return
    timer = threading.Timer(limit_s, database.interrupt)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def csv_text(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    r"""A table as CSV. Text that a spreadsheet would take for a formula gets an apostrophe before it.

    >>> print(csv_text(["tracker", "overlap"], [["=1+1", -0.5], [None, 1.0]]), end="")
    tracker,overlap
    '=1+1,-0.5
    ,1.0
    """
    written = io.StringIO()
    writer = csv.writer(written, lineterminator="\n")
    writer.writerow(heads)
    for row in rows:
        writer.writerow(["'" + cell if isinstance(cell, str) and cell.startswith(_FORMULA) else cell for cell in row])
    return written.getvalue()


def sql_text(value: object) -> str:
    """A string or path as SQL writes it."""
    return "'" + str(value).replace("'", "''") + "'"
