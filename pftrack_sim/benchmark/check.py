"""Verify a run folder: every episode of the plan is there once, unchanged, with the same columns."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import duckdb

from pftrack_sim.benchmark.episode_file import content_digest, read_metadata
from pftrack_sim.benchmark.files import sql_text
from pftrack_sim.benchmark.plan import Episode
from pftrack_sim.benchmark.store import RunStore
from pftrack_sim.core.errors import RunError


@dataclass(frozen=True)
class CheckReport:
    """Result of a check: how many episodes of the plan are intact, and one line for each problem."""

    path: Path
    episodes: int
    total: int
    problems: tuple[str, ...]

    @property
    def good(self) -> bool:
        """Whether every episode is intact and there is no problem."""
        return not self.problems and self.episodes == self.total

    def lines(self) -> Iterator[str]:
        """The report as text."""
        yield from self.problems
        verdict = "the run is complete" if self.good else "the run is not complete"
        yield f"{self.path}: {self.episodes} of {self.total} episodes are intact; {verdict}"


def check(path: Path) -> CheckReport:
    """Verify a run folder: its plan, and of every episode the columns, the frames, the digest and the file's hash.

    Args:
        path: The folder.

    Raises:
        RunError: It is no run folder, or its plan is damaged.
    """
    store = RunStore(path)
    plan = store.plan
    problems: list[str] = []
    intact = 0
    expected: set[Path] = set()
    schema: list[Any] = []
    with duckdb.connect() as database:
        hashes = _hashes(database, store, problems)
        for episode in plan.episodes():
            file = store.episode_file(episode)
            name = file.relative_to(path).as_posix()
            expected.add(file)
            if not file.is_file():
                problems.append(f"missing: {episode.name}")
            elif problem := _problem(database, episode, file, schema, hashes.get(name)):
                problems.append(f"{name}: {problem}")
            else:
                intact += 1
    unexpected = [file for file in store.episode_files() if file not in expected]
    problems += [f"not in the plan: {file.relative_to(path).as_posix()}" for file in unexpected]
    return CheckReport(path, intact, plan.episode_count, tuple(problems))


def _hashes(database: duckdb.DuckDBPyConnection, store: RunStore, problems: list[str]) -> dict[str, str]:
    if not store.finished:
        return {}
    try:
        summary = sql_text(store.path / "summary.parquet")
        hashes = dict(database.execute(f"SELECT DISTINCT file, file_sha256 FROM {summary}").fetchall())
    except duckdb.Error as error:
        problems.append(f"summary.parquet: {str(error).splitlines()[0]}")
        return {}
    if len(hashes) != store.plan.episode_count:
        problems.append(f"summary.parquet: {len(hashes)} episodes instead of {store.plan.episode_count}")
    return hashes


def _problem(
    database: duckdb.DuckDBPyConnection, episode: Episode, file: Path, schema: list[Any], sha256: str | None
) -> str | None:
    """The problem of an episode's file, or None; the columns of the first file are those that all must have."""
    if sha256 is not None and hashlib.sha256(file.read_bytes()).hexdigest() != sha256:
        return "changed since the run was finished"
    table = f"read_parquet({sql_text(file)}, hive_partitioning = false)"
    try:
        ((_, metadata),) = read_metadata(database, [file])
        columns = database.execute(f"DESCRIBE FROM {table}").fetchall()
        counts = database.execute(
            f"SELECT label, count(*), count(DISTINCT frame), min(frame), max(frame) FROM {table} GROUP BY label"
        ).fetchall()
        digest = content_digest(database, table)
    except (RunError, duckdb.Error) as error:
        return f"cannot be read: {str(error).splitlines()[0]}"
    if digest != metadata["content_sha256"]:
        return "its rows do not have the digest they were written with"
    found = metadata["scenario"], metadata["condition"], metadata["seed"]
    if found != (episode.scenario.name, episode.condition.name, episode.seed):
        return f"is of another episode: {found[0]} {found[1]} seed {found[2]}"
    schema[:] = schema or columns
    if columns != schema:
        return "has other columns than the rest"
    frames = metadata["frames"]
    wanted = {(label, frames, frames, 0, frames - 1) for label in episode.labels}
    return None if set(counts) == wanted else "does not have every frame of every tracker once"
