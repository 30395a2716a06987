"""Verify a run folder: every result that is asked for is there, unchanged, and the summary is what they lead to."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import duckdb

from pftrack_sim.benchmark import keys
from pftrack_sim.benchmark.asked.plan import AskedResult
from pftrack_sim.benchmark.kept.checksums import SUMS, changed, read_sums
from pftrack_sim.benchmark.kept.episode_file import content_digests, read_metadata
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
    """Verify a run folder: every file's checksum, every result's content, and what was derived from the results.

    Args:
        path: The folder.

    Raises:
        RunError: It is no run folder, or its plan is damaged.
    """
    store = RunStore(path)
    plan, present = store.plan, store.present
    changes = _changes(path)
    problems = dict.fromkeys(changes.values())
    missing = keys.missing(plan.asked, store.kept)
    harmed: set[int] = set()
    schema: list[Any] = []
    with duckdb.connect() as database:
        for file, one in present.items():
            name = file.relative_to(path).as_posix()
            problem = None if name in changes else _problem(database, one, file, schema)
            problems |= {f"{name}: {problem}": None} if problem else {}
            harmed |= {one.episode.number} if problem or name in changes else set[int]()
        if present and not harmed:
            summary = path / "summary.parquet"
            if os.path.lexists(summary) or store.finished:
                problem = summary_problem(database, path, plan, present)
                problems |= {problem: None} if problem and problem.partition(":")[0] not in changes else {}
    for one in missing.values():
        problems.pop(changes.get(store.result_file(one).relative_to(path).as_posix(), ""), None)
        harmed.add(one.episode.number)
    lacking: dict[int, list[AskedResult]] = {}
    for one in missing.values():
        lacking.setdefault(one.episode.number, []).append(one)
    for count, results in enumerate(lacking.values()):
        if count == _MOST_MISSING:
            problems[f"missing: {len(lacking) - count} episodes more"] = None
            break
        episode = results[0].episode
        labels = f", {', '.join(one.tracker.label for one in results)}" if len(results) < len(episode.trackers) else ""
        problems[f"missing: {episode.name}{labels}"] = None
    for file in (file for file in store.result_files() if file not in present):
        name = file.relative_to(path).as_posix()
        problems.pop(changes.get(name, ""), None)
        problems[f"not in the plan: {name}"] = None
    return CheckReport(path, plan.episode_count - len(harmed), plan.episode_count, tuple(problems))


def _changes(path: Path) -> dict[str, str]:
    """Lines about files that differ from `SHA256SUMS`, by the files' names."""
    try:
        return {line.partition(": ")[0]: line for line in changed(path, None, read_sums(path))}
    except RunError as error:
        return {SUMS: str(error)}


def _problem(database: duckdb.DuckDBPyConnection, asked: AskedResult, file: Path, schema: list[Any]) -> str | None:
    """The problem of a result's file, or None; the columns of the first file are those that all must have."""
    table = f"read_parquet({sql_text(file)}, hive_partitioning = false)"
    try:
        ((_, metadata),) = read_metadata(database, {file: asked})
        with query_deadline(database):
            columns = database.execute(f"DESCRIBE FROM {table}").fetchall()
            identity = "kind, scenario, condition, seed, label"
            counts = database.execute(
                f"SELECT count(*), count(DISTINCT frame), min(frame), max(frame), {identity} "
                f"FROM {table} GROUP BY {identity}"
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
    frames, episode = metadata["frames"], asked.episode
    wanted = (frames, frames, 0, frames - 1, episode.kind, episode.spec.name, episode.condition.name, episode.seed)
    return None if counts == [(*wanted, asked.tracker.label)] else "does not have every frame once"
