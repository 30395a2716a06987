"""Whether a run folder is whole and unharmed."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import duckdb

from pftrack_sim.benchmark.columns import content_digest, read_metadata
from pftrack_sim.benchmark.folder import episode_files
from pftrack_sim.benchmark.plan import Episode
from pftrack_sim.benchmark.reading import Run
from pftrack_sim.core.errors import RunError


@dataclass(frozen=True)
class Finding:
    """What was found.

    Attributes:
        path: The folder.
        episodes: Episodes that are there and whole.
        total: Episodes of the plan.
        problems: What is wrong, one line each.
    """

    path: Path
    episodes: int
    total: int
    problems: tuple[str, ...]

    @property
    def good(self) -> bool:
        """Whether every episode is there once and nothing is wrong."""
        return not self.problems and self.episodes == self.total

    def lines(self) -> Iterator[str]:
        """For people."""
        yield from self.problems
        verdict = "all is well" if self.good else "not whole"
        yield f"{self.path}: {self.episodes} of {self.total} episodes are there and unharmed; {verdict}"


def check(path: Path) -> Finding:
    """Verify a run folder: its plan, and of every episode the schema, the frames, the digest and the file's hash.

    Args:
        path: The folder.

    Raises:
        RunError: It is no run folder, or its plan is damaged.
    """
    run = Run(path)
    plan = run.plan
    problems: list[str] = []
    whole = 0
    expected: set[Path] = set()
    schema: list[Any] = []
    with duckdb.connect() as database:
        hashes = _hashes(database, run, problems)
        for episode in plan.episodes():
            file = path / "episodes" / f"{episode.path}.parquet"
            expected.add(file)
            if not file.is_file():
                problems.append(f"missing: {episode.name}")
                continue
            wrong = _wrong(database, episode, file, schema, hashes.get(file.relative_to(path).as_posix()))
            if wrong:
                problems.append(f"{file.relative_to(path).as_posix()}: {wrong}")
            else:
                whole += 1
    problems += [
        f"not in the plan: {one.relative_to(path).as_posix()}" for one in episode_files(path) if one not in expected
    ]
    return Finding(path, whole, plan.episode_count, tuple(problems))


def _hashes(database: duckdb.DuckDBPyConnection, run: Run, problems: list[str]) -> dict[str, str]:
    if not run.finished:
        return {}
    summary = str(run.path / "summary.parquet").replace("'", "''")
    try:
        found = dict(database.execute(f"SELECT DISTINCT file, file_sha256 FROM '{summary}'").fetchall())
    except duckdb.Error as error:
        problems.append(f"summary.parquet: {str(error).splitlines()[0]}")
        return {}
    if len(found) != run.plan.episode_count:
        problems.append(f"summary.parquet: {len(found)} episodes instead of {run.plan.episode_count}")
    return found


def _wrong(
    database: duckdb.DuckDBPyConnection,
    episode: Episode,
    file: Path,
    schema: list[Any],
    sha256: str | None,
) -> str | None:
    """What is wrong with an episode's file, or None. The first one's columns are what all must have."""
    if sha256 is not None and hashlib.sha256(file.read_bytes()).hexdigest() != sha256:
        return "changed since the run was finished"
    table = f"read_parquet('{str(file).replace(chr(39), chr(39) * 2)}', hive_partitioning = false)"
    try:
        ((_, sums),) = read_metadata(database, [file])
        columns = database.execute(f"DESCRIBE FROM {table}").fetchall()
        counts = database.execute(
            f"SELECT tracker, count(*), count(DISTINCT frame), min(frame), max(frame) FROM {table} GROUP BY tracker"
        ).fetchall()
        digest = content_digest(database, table)
    except (RunError, duckdb.Error) as error:
        return f"cannot be read: {str(error).splitlines()[0]}"
    if digest != sums["content_sha256"]:
        return "its rows do not have the digest they were written with"
    if (sums["scenario"], sums["condition"], sums["seed"]) != (
        episode.scenario.name,
        episode.condition.name,
        episode.seed,
    ):
        return f"is of another episode: {sums['scenario']} {sums['condition']} seed {sums['seed']}"
    schema[:] = schema or columns
    if columns != schema:
        return "has other columns than the rest"
    frames = sums["frames"]
    wanted = {(label, frames, frames, 0, frames - 1) for label in episode.labels}
    return None if set(counts) == wanted else "does not have every frame of every tracker once"
