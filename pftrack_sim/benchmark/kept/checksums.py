"""Checksums of a run folder: `SHA256SUMS`, in the form that `sha256sum --check` reads.

A file of a result gets its line before it is written, so that a file without a line is none of the run's; of several
lines about one file, which an interrupted session leaves, the last one counts. At its end a session writes the list
whole, with `run.json` and all that was derived from the results. Checksums find accidents, not attacks: write access to
the folder includes them. No table is read before its checksum was verified: DuckDB can crash on a damaged Parquet file.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from pftrack_sim.benchmark.kept.files import write_bytes
from pftrack_sim.core.code_digest import file_digest
from pftrack_sim.core.errors import RunError
from pftrack_sim.core.inputs import is_file, read_bytes

SUMS = "SHA256SUMS"
RECORD = "run.json"
TABLES_OF_RESULTS = ("episodes/", "frames/")

DERIVED = (RECORD, "summary.parquet", "report.html", "limits.json", "limits.html", "comparison.html", "tables/")
FOLDERS = ("episodes/", "frames/", "tables/", "videos/", "logs/", "errors/")
_MAX_SUMS_BYTES = 1 << 30
_LINE = re.compile(r"([0-9a-f]{64}) [ *](.+)")


class Checksums:
    """Checksums of a run folder.

    Attributes:
        known: SHA-256 of files by their paths within the folder; empty in a folder without a list.

    Raises:
        RunError: The list is damaged.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.known: dict[str, str] = {}
        if not os.path.lexists(folder / SUMS):
            return
        try:
            lines = read_bytes(folder / SUMS, _MAX_SUMS_BYTES).decode().split("\n")
        except (OSError, UnicodeDecodeError):
            raise RunError(f"{folder / SUMS} cannot be read") from None
        # What stands after the last end of a line was being written when its session was killed.
        matches = [_LINE.fullmatch(line) for line in lines[:-1]]
        if None in matches:
            raise RunError(f"{folder / SUMS}: line {matches.index(None) + 1} is damaged")
        self.known = {match[2]: match[1] for match in matches if match}

    @property
    def complete(self) -> bool:
        """Whether a session has ended, so that every file has a line."""
        return RECORD in self.known

    def begin(self) -> None:
        """Write the list as a session begins: of results and what shows them."""
        kept = (name for name in self.known if not name.startswith(DERIVED) and self._is_file(name))
        self._write({name: self.known[name] for name in kept})

    def add(self, contents: Mapping[str, bytes]) -> None:
        """Add lines about files that are written next; raises RunError."""
        added = {name: hashlib.sha256(content).hexdigest() for name, content in contents.items()}
        try:
            with open(self._folder / SUMS, "ab") as opened:
                opened.write(_text(added))
                opened.flush()
                os.fsync(opened.fileno())
        except OSError as error:
            raise RunError(f"cannot write {self._folder / SUMS}: {error.strerror}") from None
        self.known |= added

    def end(self) -> None:
        """Write the list of all files at the end of a session; tables of results without a line get none.

        Raises:
            RunError: A file cannot be read, or the list cannot be written.
        """
        known = {name: one for name, one in self.known.items() if not name.startswith(DERIVED)}
        names = [name for name in self.there() if name in known or not name.startswith(TABLES_OF_RESULTS)]
        try:
            self._write({name: known.get(name) or file_digest(self._folder / name) for name in names})
        except OSError as error:
            raise RunError(f"{self._folder} cannot be read: {error.strerror}") from None

    def update(self, name: str) -> None:
        """Note a file that was written anew; nothing while a session writes."""
        if self.complete:
            self._write({**self.known, name: file_digest(self._folder / name)})

    def changes(self, names: Iterable[str] | None = None) -> dict[str, str]:
        """What is wrong with each of these files, or with all that have a line.

        In a list that is not complete, a line may be about a file that has not been written.
        """
        if names is None:
            names = sorted({*self.known, *self.there()} if self.complete else filter(self._is_file, self.known))
        found: dict[str, str] = {}
        for name in names:
            if name not in self.known:
                found[name] = "added since the run was finished"
            elif not self._is_file(name):
                found[name] = "missing"
            elif file_digest(self._folder / name) != self.known[name]:
                found[name] = "changed since it was written"
        return found

    def _is_file(self, name: str) -> bool:
        return is_file(self._folder / name)

    def there(self) -> list[str]:
        """Files of a run that are there."""
        found = [name for name in DERIVED if self._is_file(name)]
        for top in FOLDERS:
            for path in (self._folder / top).rglob("*"):
                if not path.name.startswith(".") and is_file(path):
                    found.append(path.relative_to(self._folder).as_posix())
        return found

    def _write(self, sums: dict[str, str]) -> None:
        write_bytes(self._folder / SUMS, _text({name: sums[name] for name in sorted(sums)}))
        self.known = sums


def _text(sums: Mapping[str, str]) -> bytes:
    return "".join(f"{one}  {name}\n" for name, one in sums.items()).encode()
