"""`run.json`: the plan of a run, and every session that worked on it."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from pydantic import ValidationError

from pftrack_sim.benchmark.asked.plan import Plan
from pftrack_sim.benchmark.kept.checksums import RECORD
from pftrack_sim.benchmark.kept.files import write_bytes
from pftrack_sim.benchmark.keys import package_version
from pftrack_sim.core.errors import RunError
from pftrack_sim.core.inputs import check_tree, parse_json, read_bytes
from pftrack_sim.core.text import one_line
from pftrack_sim.scenario.section import Section

FORMAT = 8
"""Format of run folders."""
_MAX_RECORD_BYTES = 64 << 20
_MAX_RECORD_VALUES = 5_000_000
_VERSIONS_OF = ("pftrack-sim", "gymnasium", "mujoco", "numpy", "opencv-python-headless", "numba", "duckdb", "av")


class Session(Section):
    """Where and with what a process worked on a run."""

    began: str
    command: tuple[str, ...]
    versions: dict[str, str]
    commit: str | None
    python: str
    platform: str
    cores: int | None


class Record(Section):
    """Content of `run.json`: the plan, when the last of its results was there, and the sessions."""

    format: Literal[8] = FORMAT
    finished: str | None
    sessions: tuple[Session, ...]
    plan: Plan


def read_record(path: Path) -> Record:
    """Read the record of a run folder.

    Raises:
        RunError: There is none, or it is damaged or of another format.
    """
    source = path / RECORD
    try:
        tree: object = parse_json(read_bytes(source, _MAX_RECORD_BYTES))
        check_tree(tree, _MAX_RECORD_VALUES)
    except (FileNotFoundError, NotADirectoryError):
        raise RunError(f"{path} is not a run folder: it has no {RECORD}") from None
    except (OSError, ValueError) as error:
        raise RunError(f"{source} cannot be read: {one_line(str(error))}") from None
    try:
        return Record.model_validate(tree)
    except ValidationError as error:
        first = error.errors()[0]
        if not isinstance(tree, dict) or first["loc"] == ("format",):
            raise RunError(f"{source} is not of format {FORMAT}, which this version reads") from None
        where = ".".join(str(part) for part in first["loc"])
        raise RunError(f"{source} is damaged: {one_line(where)}: {one_line(str(first['msg']))}") from None


def write_record(path: Path, record: Record) -> None:
    """Write the record of a run folder; raises RunError."""
    write_bytes(path / RECORD, (record.model_dump_json(indent=1) + "\n").encode())


def session() -> Session:
    """This process, now."""
    return Session(
        began=now(),
        command=tuple(one_line(word) for word in sys.argv),
        versions={name: version for name in _VERSIONS_OF if (version := package_version(name))},
        commit=_commit(),
        python=platform.python_version(),
        platform=platform.platform(),
        cores=os.cpu_count(),
    )


def now() -> str:
    """The time, UTC, in ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def _commit() -> str | None:
    """The commit of a checkout, with a `+` where files were changed since; None for an installed package."""
    root = Path(__file__).resolve().parents[3]
    if not (root / ".git").exists():
        return None
    words = ["git", "describe", "--always", "--abbrev=40", "--dirty=+", "--exclude=*"]
    try:
        described = subprocess.run(words, cwd=root, capture_output=True, text=True, timeout=10)
    except (OSError, subprocess.SubprocessError):
        return None
    return described.stdout.strip() or None
