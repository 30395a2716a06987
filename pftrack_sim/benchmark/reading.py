"""Reading a run folder: its plan, its scores, and SQL on all of it. An unfinished run can be read too."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import islice
from pathlib import Path
from typing import Any

import duckdb
import numpy as np

from pftrack_sim.benchmark.columns import read_metadata
from pftrack_sim.benchmark.folder import episode_files, read_record, read_run_plan
from pftrack_sim.benchmark.plan import Plan
from pftrack_sim.core.errors import RunError
from pftrack_sim.score import Measures
from pftrack_sim.score.following import Following

_CHUNK = 500

# The types are said, because a column without any value has none of its own.
_CASTS = {
    "failure": "VARCHAR",
    "printed": "VARCHAR",
    "collided_with": "VARCHAR",
    "level_names": "VARCHAR[]",
    "level_values": "DOUBLE[]",
}


@dataclass(frozen=True)
class Result:
    """What one tracker scored in one episode.

    Attributes:
        scenario: Name of the scenario.
        condition: Name of the axis levels, `"base"` when there are none.
        seed: Root seed.
        tracker: The tracker, as tables call it.
        summary: Its scores.
        failure: What went wrong and at which frame, or None.
        following: How well it followed, where it drove the robot.
    """

    scenario: str
    condition: str
    seed: int
    tracker: str
    summary: Measures
    failure: str | None
    following: Following | None = None


class Run:
    """A run folder to read.

    Args:
        path: The folder.

    Raises:
        RunError: It is no run folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.record = read_record(path)

    @property
    def plan(self) -> Plan:
        """What was asked for."""
        return read_run_plan(self.path)

    @property
    def finished(self) -> bool:
        """Whether every episode is there."""
        return self.record["finished"] is not None

    def results(self) -> list[Result]:
        """One result for each finished episode and tracker, in the plan's order.

        Raises:
            RunError: A file cannot be read.
        """
        with self.open() as database:
            table = database.execute("SELECT * EXCLUDE levels FROM summary ORDER BY number, place")
            names = [one[0] for one in table.description or ()]
            scores = [one.name for one in fields(Measures)]
            followed = [one.name for one in fields(Following)]
            drove = "controller" in names
            return [
                Result(
                    row["scenario"],
                    row["condition"],
                    row["seed"],
                    row["tracker"],
                    Measures(**{name: row[name] for name in scores}),
                    row["failure"],
                    Following(**{name: row[f"follow_{name}"] for name in followed}) if drove else None,
                )
                for row in (dict(zip(names, values, strict=True)) for values in table.fetchall())
            ]

    def open(self) -> duckdb.DuckDBPyConnection:
        """A database with three views; the caller closes it.

        `frames` has a row for every tracker and frame, `summary` for every tracker and episode, `episodes` for every
        episode.

        Raises:
            RunError: There is no finished episode, or a file cannot be read.
        """
        if next(episode_files(self.path), None) is None:
            raise RunError(f"{self.path} has no finished episode yet")
        database = duckdb.connect()
        try:
            summary = self.path / "summary.parquet"
            if self.finished and summary.is_file():
                database.execute(f"CREATE VIEW summary AS FROM read_parquet({_quoted(summary)})")
            else:
                load_summary(database, self.path, self.plan)
            database.execute(
                f"CREATE VIEW frames AS FROM read_parquet({_quoted(self.path / 'episodes/*/*/*.parquet')}, "
                "hive_partitioning = false)"
            )
            database.execute(
                "CREATE VIEW episodes AS SELECT DISTINCT ON (number) number, kind, scenario, condition, levels, seed, "
                "episode_frames, rate_hz, frames_digest, content_sha256, graphics, version, file "
                "FROM summary ORDER BY number"
            )
        except duckdb.Error as error:
            database.close()
            raise RunError(f"{self.path} cannot be read: {error}") from None
        return database


def load_summary(database: duckdb.DuckDBPyConnection, path: Path, plan: Plan, *, hashes: bool = False) -> int:
    """Make a table `summary` of the finished episodes of a run folder, a few hundred at a time.

    Args:
        database: Where.
        path: The folder.
        plan: Its plan, which gives the order.
        hashes: Whether to compute the hash of every file.

    Returns:
        Number of episodes.
    """
    expected = enumerate(plan.episodes())
    present = ((number, one) for number, one in expected if (path / "episodes" / f"{one.path}.parquet").is_file())
    count = 0
    for chunk in _chunks(present):
        files = {path / "episodes" / f"{one.path}.parquet": number for number, one in chunk}
        rows: list[dict[str, Any]] = []
        for file, sums in read_metadata(database, list(files)):
            sha256 = hashlib.sha256(file.read_bytes()).hexdigest() if hashes else None
            rows += _rows(plan, files[file], file.relative_to(path).as_posix(), sums, sha256)
        columns = {name: _column([row[name] for row in rows]) for name in rows[0]}
        database.register("chunk", columns)
        chosen = ", ".join(f"{name}::{_CASTS[name]} AS {name}" if name in _CASTS else name for name in columns)
        select = (
            "SELECT * EXCLUDE (level_names, level_values), map(level_names, level_values) AS levels "
            f"FROM (SELECT {chosen} FROM chunk)"
        )
        database.execute(f"CREATE TABLE summary AS {select}" if not count else f"INSERT INTO summary BY NAME {select}")
        database.unregister("chunk")
        count += len(files)
    return count


def _rows(plan: Plan, number: int, file: str, sums: dict[str, Any], sha256: str | None) -> Iterator[dict[str, Any]]:
    for scores in sums["trackers"]:
        yield {
            "number": number,
            "place": plan.labels.index(scores["tracker"]),
            **scores,
            "level_names": list(sums["levels"]),
            "level_values": list(sums["levels"].values()),
            "episode_frames": sums["frames"],
            **{key: sums[key] for key in ("rate_hz", "frames_digest", "content_sha256", "graphics", "version")},
            "file": file,
            "file_sha256": sha256 or "",
        }


def _chunks(items: Iterator[Any]) -> Iterator[list[Any]]:
    while chunk := list(islice(items, _CHUNK)):
        yield chunk


def _column(values: Sequence[Any]) -> np.ndarray:
    if isinstance(values[0], list):
        made = np.empty(len(values), dtype=object)
        for index, value in enumerate(values):
            made[index] = value
        return made
    if any(isinstance(value, str) or value is None for value in values):
        return np.array(values, dtype=object)
    return np.array(values)


def _quoted(path: Path) -> str:
    return "'" + str(path).replace("'", "''") + "'"
