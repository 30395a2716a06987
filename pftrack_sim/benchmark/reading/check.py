"""Verify a run folder: every result that is asked for is there, unchanged, and the summary is what they lead to."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import duckdb

from pftrack_sim.benchmark.asked.plan import AskedResult
from pftrack_sim.benchmark.kept.checksums import FOLDERS, SUMS
from pftrack_sim.benchmark.kept.files import query_deadline
from pftrack_sim.benchmark.kept.folder import SUMMARY, RunFolder
from pftrack_sim.benchmark.kept.tables import MAX_BYTES, parquet
from pftrack_sim.benchmark.reading.summary import load_summary, tables_of
from pftrack_sim.core.errors import RunError
from pftrack_sim.core.inputs import is_file, read_bytes
from pftrack_sim.core.text import one_line

_MOST_NAMED = 1000
"""Episodes that are missing, or files that are none of the run's."""


@dataclass(frozen=True)
class CheckReport:
    """Result of a check: how many episodes of the plan are intact, and one line for each problem.

    `beside` has a line for each file that is none of the run's and lies beside its folders, which harms nothing.
    """

    path: Path
    episodes: int
    total: int
    problems: tuple[str, ...]
    beside: tuple[str, ...] = ()

    @property
    def good(self) -> bool:
        """Whether every episode is intact and there is no problem."""
        return not self.problems and self.episodes == self.total

    def lines(self) -> Iterator[str]:
        """The report as text."""
        yield from (*self.problems, *self.beside)
        verdict = "the run is complete" if self.good else "the run is not complete"
        yield f"{self.path}: {self.episodes} of {self.total} episodes are intact; {verdict}"


def check(path: Path) -> CheckReport:
    """Verify a run folder: every file's checksum, every result's key, and what was derived from the results.

    Raises:
        RunError: It is no run folder, or its plan or its checksums are damaged.
    """
    folder = RunFolder(path)
    plan, present, changes = folder.plan, folder.present, folder.checksums.changes()
    missing = [one for key, one in plan.asked.items() if key not in present]
    foreign = sorted(folder.foreign, key=lambda name: not name.startswith(FOLDERS))
    # These are named by their episodes, or as foreign.
    named = {*foreign}.union(*(one.tables for one in missing))
    problems = [f"{name}: {problem}" for name, problem in changes.items() if name not in named]
    if not os.path.lexists(path / SUMS):
        problems.append(f"{SUMS}: missing")
    damaged = [one for one in plan.asked.values() if not changes.keys().isdisjoint(one.tables)]
    if present and not damaged and not (folder.finished and missing):
        problems += [one for one in _derived_problems(folder, present.values()) if one.partition(":")[0] not in changes]
    lacking: dict[int, list[AskedResult]] = {}
    for one in missing:
        lacking.setdefault(one.episode.number, []).append(one)
    for results in list(lacking.values())[:_MOST_NAMED]:
        episode = results[0].episode
        labels = f", {', '.join(one.tracker.label for one in results)}" if len(results) < len(episode.trackers) else ""
        problems.append(f"missing: {episode.name}{labels}")
    if len(lacking) > _MOST_NAMED:
        problems.append(f"missing: {len(lacking) - _MOST_NAMED} episodes more")
    unknown = [f"unknown file: {one_line(name)}" for name in foreign[:_MOST_NAMED]]
    if len(foreign) > _MOST_NAMED:
        unknown.append(f"unknown files: {len(foreign) - _MOST_NAMED} more")
    within = sum(name.startswith(FOLDERS) for name in foreign)
    problems += unknown[:within]
    harmed = {one.episode.number for one in (*missing, *damaged)}
    intact, beside = plan.episode_count - len(harmed), tuple(unknown[within:])
    return CheckReport(path, intact, plan.episode_count, tuple(problems), beside)


def _derived_problems(folder: RunFolder, present: Iterable[AskedResult]) -> Iterator[str]:
    """A result that is of another episode; the summary or a table if it is not what the results lead to."""
    path = folder.path / SUMMARY
    with duckdb.connect() as database:
        try:
            load_summary(database, folder, present)
        except RunError as error:
            yield str(error).removeprefix(f"{folder.path}/")
            return
        if not folder.finished and not os.path.lexists(path):
            return
        if not is_file(path):
            yield f"{SUMMARY}: is not a regular file"
            return
        if folder.checksums.changes([SUMMARY]):
            return
        try:
            with query_deadline(database):
                same = all(
                    str(database.execute(query.format(parquet([path]))).fetchall())
                    == str(database.execute(query.format("summary")).fetchall())
                    for query in ("DESCRIBE FROM {}", "FROM {} ORDER BY number, place")
                )
        except duckdb.Error:
            same = False
        if not same:
            yield f"{SUMMARY}: is not what the episodes lead to"
            return
        for name, content in tables_of(database):
            if not is_file(folder.path / name) or read_bytes(folder.path / name, MAX_BYTES) != content:
                yield f"{name}: is not what the summary leads to"
