"""The run folder: `run.json`, a Parquet file for each episode and tracker, `summary.parquet`, videos.

Files are written under another name and renamed when complete, so that a reader never sees half a file.
"""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import duckdb
import numpy as np

from pftrack_sim.bench.contest import Entry
from pftrack_sim.bench.plan import Plan, slug
from pftrack_sim.errors import RunError
from pftrack_sim.records import Truth

FORMAT = 1
_BOXES = ("box", "amodal_box", "visible_box", "swept_box")
_REPORTED = ("pftrack-sim", "gymnasium", "mujoco", "numpy", "opencv-python-headless", "numba", "duckdb", "av")


class RunFolder:
    """A run folder under construction.

    Args:
        path: Folder to make; it must be absent or empty.

    Raises:
        RunError: It holds something already, or cannot be written to.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            if path.exists() and (not path.is_dir() or any(path.iterdir())):
                raise RunError(f"{path} exists and is not an empty folder: choose another with --out")
            (path / "episodes").mkdir(parents=True)
        except OSError as error:
            raise RunError(f"cannot make the run folder {path}: {error.strerror}") from None
        self._database = duckdb.connect()
        self._summary: list[dict[str, Any]] = []
        self._files: list[dict[str, Any]] = []

    def add_episode(
        self,
        key: Mapping[str, Any],
        episode_name: str,
        truths: Sequence[Truth],
        entry: Entry,
        overlap: np.ndarray,
        centre_error_px: np.ndarray,
        summary: Mapping[str, Any],
    ) -> None:
        """Write what one tracker did in one episode.

        Args:
            key: Scenario, condition, seed, tracker, preset.
            episode_name: Safe for a file's name.
            truths: The target's, one for each frame.
            entry: The tracker's answers.
            overlap: `(N,)` with the truth's box, 0 where there was no answer.
            centre_error_px: `(N,)`.
            summary: The episode's scores.
        """
        name = f"episodes/{episode_name}__{slug(entry.name)}.parquet"
        columns = {**_truth_columns(truths), **_estimate_columns(entry)}
        columns |= {"overlap": overlap, "centre_error_px": centre_error_px, "ms": np.array(entry.ms)}
        self._write(name, columns)
        self._files.append({**key, "file": name})
        self._summary.append({**key, **summary, "failure": entry.failure, "file": name})

    def finish(self, plan: Plan, graphics: str, digests: Mapping[str, str]) -> None:
        """Write `summary.parquet` and `run.json`: the run is complete.

        Args:
            plan: What was run.
            graphics: What drew the frames.
            digests: For each episode's name, a digest of all its pixels.
        """
        keys = list(self._summary[0])
        self._write("summary.parquet", {key: _column([row[key] for row in self._summary]) for key in keys})
        by_name = {f"{e.scenario.name} [{e.condition.name}]": e.scenario for e in plan.episodes}
        record = {
            "format": FORMAT,
            "finished": datetime.now(UTC).isoformat(timespec="seconds"),
            "command": sys.argv,
            "versions": {name: importlib.metadata.version(name) for name in _REPORTED if _installed(name)},
            "python": platform.python_version(),
            "platform": platform.platform(),
            "graphics": graphics,
            "trackers": list(plan.trackers),
            "preset": plan.preset,
            "seeds": sorted({episode.seed for episode in plan.episodes}),
            "scenarios": {name: {"sha256": one.digest, "tree": one.tree} for name, one in by_name.items()},
            "episodes": self._files,
            "frames_digest": dict(digests),
        }
        part = self.path / ".run.json.part"
        part.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
        os.replace(part, self.path / "run.json")
        self._database.close()

    def _write(self, name: str, columns: Mapping[str, np.ndarray]) -> None:
        target = self.path / name
        part = target.with_name(f".{target.name}.part")
        table = dict(columns)
        self._database.register("rows", table)
        try:
            quoted = str(part).replace("'", "''")
            self._database.execute(f"COPY (SELECT * FROM rows) TO '{quoted}' (FORMAT parquet)")
            os.replace(part, target)
        except (OSError, duckdb.Error) as error:
            part.unlink(missing_ok=True)
            raise RunError(f"cannot write {target}: {error}") from None
        finally:
            self._database.unregister("rows")


def _truth_columns(truths: Sequence[Truth]) -> dict[str, np.ndarray]:
    columns: dict[str, np.ndarray] = {"frame": np.arange(len(truths))}
    for key in ("time_s", "state", "visible_fraction", "truncation", "distance_m", "image_motion_px", "luminance"):
        columns[key] = _column([getattr(truth, key) for truth in truths])
    columns["scored"] = np.array([truth.scored for truth in truths])
    columns["occluders"] = _lists([list(truth.occluders) for truth in truths])
    for key in (*_BOXES, "T_world_camera", "T_world_target", "K", "distortion"):
        columns[key] = _lists([getattr(truth, key).ravel().tolist() for truth in truths])
    return columns


def _estimate_columns(entry: Entry) -> dict[str, np.ndarray]:
    said = entry.estimates
    return {
        "estimate": _lists(entry.boxes.tolist()),
        "confidence": np.array([np.nan if one is None else one.confidence for one in said]),
        "estimate_occluded": np.array([one is not None and one.occluded for one in said]),
        "answered": np.array([one is not None for one in said]),
    }


def _lists(rows: Sequence[Sequence[Any]]) -> np.ndarray:
    # Filled by hand: numpy would make a table out of rows of equal length.
    column = np.empty(len(rows), dtype=object)
    for index, row in enumerate(rows):
        column[index] = list(row)
    return column


def _column(values: Sequence[Any]) -> np.ndarray:
    if any(isinstance(value, str) or value is None for value in values):
        return np.array(values, dtype=object)
    return np.array(values)


def _installed(name: str) -> bool:
    try:
        importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True
