"""Machine code that Numba keeps of third-party trackers, by the contents of the files that they load and open.

Numba itself sees changes in the file of a compiled function only, not in what it calls or reads from others.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import secrets
import shutil
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pftrack_sim.core.code_digest import opened_digest, opened_file
from pftrack_sim.core.data_files import cache_dir
from pftrack_sim.core.inputs import parse_json, read_bytes
from pftrack_sim.trackers.registry import code_digest

_FILES = "files.json"
_MAX_BYTES = 16 << 20
_KEPT_S = 30 * 24 * 3600.0


class MachineCode:
    """Where machine code of a tracker is kept: `<cache>/compiled/<name and code>/<changes of its other files>`.

    `files.json` beside it holds what these files were when they were first opened.

    Attributes:
        folder: For `NUMBA_CACHE_DIR`.

    Raises:
        OSError: It cannot be written.
    """

    def __init__(self, name: str) -> None:
        root = Path(os.environ.get("NUMBA_CACHE_DIR") or cache_dir()) / "compiled"
        self._tracker = root / _digest([name, code_digest(name)])
        self._known: dict[str, str] = {}
        with contextlib.suppress(OSError, ValueError):
            self._known = parse_json(read_bytes(self._tracker / _FILES, _MAX_BYTES))
        now = {file: opened_digest(opened_file(file)) for file in self._known}
        self.folder = self._tracker / _digest(sorted(now.items() - self._known.items()))
        self.folder.mkdir(parents=True, exist_ok=True)
        os.utime(self._tracker)
        _remove_unused(root)

    def note(self, opened: Mapping[str, str]) -> None:
        """Note files that were opened, with their digests."""
        if opened.keys() <= self._known.keys():
            return
        self._known = {**opened, **self._known}
        part = self._tracker / f".{_FILES}.{secrets.token_hex(4)}"
        with contextlib.suppress(OSError):  # a full disk: Numba cannot keep anything either
            part.write_text(json.dumps(self._known), encoding="utf-8")
            os.replace(part, self._tracker / _FILES)


def _digest(parts: Any) -> str:
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]


def _remove_unused(root: Path) -> None:
    for folder in root.iterdir():
        with contextlib.suppress(OSError):  # another process removes it
            if folder.stat().st_mtime < time.time() - _KEPT_S:
                shutil.rmtree(folder)
