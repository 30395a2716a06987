"""Verify a run folder: every episode of the plan is there once, unchanged, and the summary is what they lead to."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import duckdb

from pftrack_sim.benchmark.asked.plan import Episode
from pftrack_sim.benchmark.kept.checksums import SUMS, changed, read_sums
from pftrack_sim.benchmark.kept.episode_file import content_digests, missing_trackers, read_metadata
from pftrack_sim.benchmark.kept.files import query_deadline, sql_text
from pftrack_sim.benchmark.kept.store import RunStore
from pftrack_sim.benchmark.reading.summary import summary_problem
from pftrack_sim.core.errors import RunError
from pftrack_sim.core.text import one_line

_MOST_MISSING = 1000


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
    """Verify a run folder: every file's checksum, every episode's content, and what was derived from the episodes.

    Args:
        path: The folder.

    Raises:
        RunError: It is no run folder, or its plan is damaged.
    """
    store = RunStore(path)
    plan = store.plan
    changes = _changes(path)
    problems = dict.fromkeys(changes.values())
    intact = 0
    expected: set[Path] = set()
    schema: list[Any] = []
    with duckdb.connect() as database:
        for _, episode in store.episodes():
            file = store.episode_file(episode)
            name = file.relative_to(path).as_posix()
            expected.add(file)
            if name not in changes and (problem := _problem(database, episode, file, schema)):
                problems[f"{name}: {problem}"] = None
            else:
                intact += name not in changes
        missing = (one for one in plan.episodes() if store.episode_file(one) not in expected)
        for episode in islice(missing, min(plan.episode_count - len(expected), _MOST_MISSING)):
            problems[f"missing: {episode.name}"] = None
            changes.pop(store.episode_file(episode).relative_to(path).as_posix(), None)
        more = plan.episode_count - len(expected) - _MOST_MISSING
        problems |= {f"missing: {more} episodes more": None} if more > 0 else {}
        if intact and intact == len(expected):
            summary = path / "summary.parquet"
            if os.path.lexists(summary) or store.finished:
                problem = summary_problem(database, path, plan, store.episodes())
                problems |= {problem: None} if problem and problem.partition(":")[0] not in changes else {}
    for file in store.episode_files():
        name = file.relative_to(path).as_posix()
        if file not in expected:
            problems.pop(changes.get(name, ""), None)
            problems[f"not in the plan: {name}"] = None
    return CheckReport(path, intact, plan.episode_count, tuple(problems))


def _changes(path: Path) -> dict[str, str]:
    """Lines about files that differ from `SHA256SUMS`, by the files' names."""
    try:
        return {line.partition(": ")[0]: line for line in changed(path, None, read_sums(path))}
    except RunError as error:
        return {SUMS: str(error)}


def _problem(database: duckdb.DuckDBPyConnection, episode: Episode, file: Path, schema: list[Any]) -> str | None:
    """The problem of an episode's file, or None; the columns of the first file are those that all must have."""
    table = f"read_parquet({sql_text(file)}, hive_partitioning = false)"
    try:
        ((_, metadata),) = read_metadata(database, {file: episode})
        with query_deadline(database):
            columns = database.execute(f"DESCRIBE FROM {table}").fetchall()
            keys = "kind, scenario, condition, seed"
            counts = database.execute(
                f"SELECT label, count(*), count(DISTINCT frame), min(frame), max(frame), {keys} "
                f"FROM {table} GROUP BY label, {keys}"
            ).fetchall()
            digests = content_digests(database, table)
    except RunError as error:
        return str(error).removeprefix(f"{file}: ")
    except duckdb.Error as error:
        return f"cannot be read: {one_line(str(error).splitlines()[0])}"
    if digests != {name: metadata.get(name) for name in digests}:
        return "its rows do not have the digest they were written with"
    schema[:] = schema or columns
    if columns != schema:
        return "has other columns than the rest"
    lacking = missing_trackers(metadata, episode)
    if lacking:
        return f"lacks {', '.join(tracker.label for tracker in lacking)}"
    frames = metadata["frames"]
    identity = (episode.kind, episode.scenario.name, episode.condition.name, episode.seed)
    wanted = {(label, frames, frames, 0, frames - 1, *identity) for label in episode.labels}
    return None if set(counts) == wanted else "does not have every frame of every tracker once"
