"""The run folder while it is written: `run.json`, a Parquet file for each episode, videos, and at the end a summary.

run.json                                    the plan, its digest, versions, and every session that worked on it
episodes/<scenario>/<condition>/seed-N.parquet
videos/<scenario>/<condition>/seed-N.mp4
summary.parquet  tables/*.csv  tables/*.tex     made from the episodes when the last one is there
"""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import subprocess
import sys
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pftrack_sim.benchmark.atomic_write import remove_parts, write_whole
from pftrack_sim.benchmark.plan import Episode, Plan, differences, read_plan
from pftrack_sim.core.errors import RunError

FORMAT = 2
_REPORTED = ("pftrack-sim", "gymnasium", "mujoco", "numpy", "opencv-python-headless", "numba", "duckdb", "av")
_LOCK = ".lock"


class RunFolder:
    """A run folder, held by one writer at a time.

    Args:
        path: Where; absent, empty, or begun with the same plan.
        plan: What is run.

    Raises:
        RunError: It holds something else, another plan, or another writer, or cannot be written.
    """

    def __init__(self, path: Path, plan: Plan) -> None:
        self.path = path
        self.plan = plan
        begun = is_run(path)
        try:
            if not begun and path.exists() and not _is_free(path):
                raise RunError(f"{path} exists and is not an empty folder: choose another with --out")
            if begun:
                _check_same(path, plan)
            path.mkdir(parents=True, exist_ok=True)
            self._lock = _lock(path)
            remove_parts(path)
        except OSError as error:
            raise RunError(f"cannot make the run folder {path}: {error.strerror}") from None
        self._record = read_record(path) if begun else _new_record(plan)
        self._record["sessions"].append(_session())
        self._save()

    def episode_file(self, episode: Episode) -> Path:
        """Where an episode's rows lie, or will."""
        return self.path / "episodes" / f"{episode.path}.parquet"

    def has(self, episode: Episode) -> bool:
        """Whether an episode is finished."""
        return self.episode_file(episode).is_file()

    def add(self, episode: Episode, table: bytes, video: bytes | None) -> None:
        """Write what came of an episode. Its table comes last: when it is there, all is.

        Raises:
            RunError: It cannot be written.
        """
        if video is not None:
            write_whole(self.path / "videos" / f"{episode.path}.mp4", video)
        write_whole(self.episode_file(episode), table)

    def adopt(self, sessions: Sequence[dict[str, Any]]) -> None:
        """Remember the sessions of another folder whose episodes came in."""
        known = self._record["sessions"]
        known += [one for one in sessions if one not in known]

    def close(self, *, finished: bool) -> None:
        """Let others write, and say whether all is there."""
        if finished:
            self._record["finished"] = _now()
        self._save()
        self.release()

    def release(self) -> None:
        """Let others write."""
        os.close(self._lock)

    def _save(self) -> None:
        write_whole(self.path / "run.json", (json.dumps(self._record, indent=1) + "\n").encode())


def is_run(path: Path) -> bool:
    """Whether a folder holds a run."""
    return (path / "run.json").is_file()


def read_record(path: Path) -> dict[str, Any]:
    """What `run.json` says.

    Raises:
        RunError: There is none, or it is not one of this format.
    """
    try:
        record = json.loads((path / "run.json").read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise RunError(f"{path} is not a run folder: it has no run.json") from None
    except (OSError, ValueError) as error:
        raise RunError(f"{path / 'run.json'} cannot be read: {error}") from None
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        raise RunError(f"{path / 'run.json'} is not of format {FORMAT}, which this version reads")
    return record


def read_run_plan(path: Path) -> Plan:
    """The plan of a run folder.

    Raises:
        RunError: There is none, or it is damaged.
    """
    record = read_record(path)
    plan = read_plan(record.get("plan"), str(path / "run.json"))
    if plan.digest != record.get("plan_sha256"):
        raise RunError(f"{path / 'run.json'} was edited: its plan does not have the digest it names")
    return plan


def episode_files(path: Path) -> Iterator[Path]:
    """Every episode's file in a run folder, sorted within each of its folders."""
    for folder, below, names in os.walk(path / "episodes"):
        below.sort()
        for name in sorted(names):
            if name.endswith(".parquet") and not name.startswith("."):
                yield Path(folder) / name


def _check_same(path: Path, plan: Plan) -> None:
    there = read_run_plan(path)
    if there.digest != plan.digest:
        lines = "\n".join(f"  {line}" for line in differences(plan, there))
        raise RunError(f"{path} holds another plan: choose another folder with --out, or ask for the same\n{lines}")


def _is_free(path: Path) -> bool:
    """Whether nothing in a folder is worth keeping: what a run leaves that is killed before it has begun."""
    return path.is_dir() and all(one.name == _LOCK or one.name.startswith(".run.json.") for one in path.iterdir())


def _lock(path: Path) -> int:
    """Hold the folder until this process ends, however it ends."""
    opened = os.open(path / _LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    if sys.platform != "win32":
        import fcntl

        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(opened)
            raise RunError(f"another process is writing to {path}") from None
        except OSError:
            pass  # a file system that cannot lock: files still appear whole
    return opened


def _new_record(plan: Plan) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "plan_sha256": plan.digest,
        "finished": None,
        "sessions": [],
        "plan": plan.model_dump(mode="json"),
    }


def _session() -> dict[str, Any]:
    return {
        "began": _now(),
        "command": sys.argv,
        "versions": {name: found for name in _REPORTED if (found := _version(name))},
        "commit": _commit(),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cores": os.cpu_count(),
    }


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def _commit() -> str | None:
    """The commit of a checkout, with a `+` where files were changed since; None for an installed package."""
    root = Path(__file__).resolve().parents[2]
    if not (root / ".git").exists():
        return None
    try:
        said = subprocess.run(
            ["git", "describe", "--always", "--abbrev=40", "--dirty=+", "--exclude=*"],
            cwd=root,
            capture_output=True,
            text=True,
            timeout=10,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return said.stdout.strip() or None
