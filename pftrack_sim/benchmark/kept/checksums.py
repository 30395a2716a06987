"""Checksums of a run folder: `SHA256SUMS`, in the form that `sha256sum --check` reads.

They are written at the end of a session and removed when the next one begins. They find accidents, not attacks:
write access to the folder includes them.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from pftrack_sim.benchmark.kept.files import write_bytes
from pftrack_sim.core.errors import RunError
from pftrack_sim.core.inputs import is_file, read_bytes

SUMS = "SHA256SUMS"
_SINGLE = ("run.json", "summary.parquet", "report.html")
_FOLDERS = ("episodes", "tables", "videos", "logs", "errors")
_MAX_SUMS_BYTES = 1 << 30
_LINE = re.compile(r"([0-9a-f]{64}) [ *](.+)")


def sha256_of(path: Path) -> str:
    """SHA-256 of a file's bytes; raises OSError."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_sums(folder: Path) -> None:
    """Write the checksums of all files of a run.

    Raises:
        RunError: A file cannot be read, or the checksums cannot be written.
    """
    try:
        _write(folder, {name: sha256_of(folder / name) for name in _names(folder)})
    except OSError as error:
        raise RunError(f"{folder} cannot be read: {error.strerror}") from None


def update_sum(folder: Path, name: str) -> None:
    """Note a file that was written anew; nothing where the folder has no checksums."""
    known = read_sums(folder)
    if known is not None:
        _write(folder, {**known, name: sha256_of(folder / name)})


def read_sums(folder: Path) -> dict[str, str] | None:
    """The checksums by the files' paths within the folder; None without any.

    Raises:
        RunError: The file is damaged.
    """
    if not is_file(folder / SUMS):
        return None
    try:
        lines = read_bytes(folder / SUMS, _MAX_SUMS_BYTES).decode().splitlines()
    except (OSError, UnicodeDecodeError):
        raise RunError(f"{folder / SUMS} cannot be read") from None
    matches = [_LINE.fullmatch(line) for line in lines]
    if None in matches:
        raise RunError(f"{folder / SUMS}: line {matches.index(None) + 1} is damaged")
    return {match[2]: match[1] for match in matches if match}


def changed(folder: Path, names: Iterable[str] | None, known: Mapping[str, str] | None) -> Iterator[str]:
    """Files that are not what they were when the checksums were written: a line for each.

    Args:
        folder: The run folder.
        names: Paths within it that are compared; None: all.
        known: From `read_sums`; nothing is compared with None.
    """
    if known is None:
        return
    for name in {*known, *_names(folder)} if names is None else names:
        path = folder / name
        if name not in known:
            yield f"{name}: added since the run was finished"
        elif not is_file(path):
            yield f"{name}: missing"
        elif sha256_of(path) != known[name]:
            yield f"{name}: changed since the run was finished"


def _names(folder: Path) -> list[str]:
    found = [name for name in _SINGLE if is_file(folder / name)]
    for top in _FOLDERS:
        for path in (folder / top).rglob("*"):
            if not path.name.startswith(".") and is_file(path):
                found.append(path.relative_to(folder).as_posix())
    return sorted(found)


def _write(folder: Path, sums: dict[str, str]) -> None:
    write_bytes(folder / SUMS, "".join(f"{sums[name]}  {name}\n" for name in sorted(sums)).encode())
