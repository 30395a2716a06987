"""`run.json`: the plan of a run, its digest, and every session that worked on it."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal, cast

from pydantic import ValidationError

from pftrack_sim.benchmark.asked.plan import Plan
from pftrack_sim.benchmark.kept.files import write_bytes
from pftrack_sim.benchmark.keys import package_version
from pftrack_sim.core.errors import RunError
from pftrack_sim.core.inputs import check_tree, parse_json, read_bytes
from pftrack_sim.core.text import one_line
from pftrack_sim.scenario.section import Section

FORMAT = 7
"""Format of run folders."""
_MAX_RECORD_BYTES = 64 << 20
_MAX_RECORD_VALUES = 5_000_000
_VERSIONS_OF = ("pftrack-sim", "gymnasium", "mujoco", "numpy", "opencv-python-headless", "numba", "duckdb", "av")


class _Session(Section):
    """A session that worked on a run, as `run.json` holds it."""

    began: str
    command: tuple[str, ...]
    versions: dict[str, str]
    commit: str | None
    python: str
    platform: str
    cores: int | None


class _Record(Section):
    """Content of `run.json`; the plan is validated where it is used."""

    format: Literal[7]
    plan_sha256: str
    finished: str | None
    sessions: tuple[_Session, ...]
    plan: dict[str, Any]


def read_record(path: Path) -> dict[str, Any]:
    """Read and validate the record of a run folder.

    Raises:
        RunError: There is none, or it is damaged or of another format.
    """
    source = path / "run.json"
    try:
        record: object = parse_json(read_bytes(source, _MAX_RECORD_BYTES))
        check_tree(record, _MAX_RECORD_VALUES)
    except FileNotFoundError:
        raise RunError(f"{path} is not a run folder: it has no run.json") from None
    except (OSError, ValueError) as error:
        raise RunError(f"{source} cannot be read: {one_line(str(error))}") from None
    if not isinstance(record, dict) or cast("dict[str, Any]", record).get("format") != FORMAT:
        raise RunError(f"{source} is not of format {FORMAT}, which this version reads")
    try:
        _Record.model_validate(record)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise RunError(f"{source} is damaged: {one_line(where)}: {one_line(str(first['msg']))}") from None
    return cast("dict[str, Any]", record)


def stored_plan(record: dict[str, Any], source: Path) -> Plan:
    """The plan of a record.

    Raises:
        RunError: It is no plan, or was edited.
    """
    try:
        plan = Plan.model_validate(record["plan"])
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise RunError(f"{source}: not a plan this version can read: {where or 'plan'}: {first['msg']}") from None
    if plan.digest != record["plan_sha256"]:
        raise RunError(f"{source} was edited: its plan does not have the digest it names")
    return plan


def write_record(path: Path, record: dict[str, Any]) -> None:
    """Write the record of a run folder; raises RunError."""
    write_bytes(path / "run.json", (json.dumps(record, indent=1) + "\n").encode())


def new_record(plan: Plan) -> dict[str, Any]:
    """The record of a run without a session."""
    return {
        "format": FORMAT,
        "finished": None,
        "sessions": [],
        **plan_record(plan),
    }


def plan_record(plan: Plan) -> dict[str, Any]:
    """The entries of the record that hold the plan."""
    return {"plan_sha256": plan.digest, "plan": plan.model_dump(mode="json")}


def session() -> dict[str, Any]:
    """Where and with what this process works on a run."""
    return {
        "began": now(),
        "command": [one_line(word) for word in sys.argv],
        "versions": {name: version for name in _VERSIONS_OF if (version := package_version(name))},
        "commit": _commit(),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cores": os.cpu_count(),
    }


def now() -> str:
    """The time, UTC, in ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def _commit() -> str | None:
    """The commit of a checkout, with a `+` where files were changed since; None for an installed package."""
    root = Path(__file__).resolve().parents[3]
    if not (root / ".git").exists():
        return None
    try:
        described = subprocess.run(
            ["git", "describe", "--always", "--abbrev=40", "--dirty=+", "--exclude=*"],
            cwd=root,
            capture_output=True,
            text=True,
            timeout=10,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return described.stdout.strip() or None
