"""The run folder: written result by result, read at any time, also unfinished.

run.json                                    what is asked for, its digest, and every session that worked on it
episodes/<scenario>/<condition>/seed-N-<tracker>-<key>.parquet      a tracker's result in an episode
errors/<scenario>/<condition>/seed-N-<tracker>-<key>.png and .txt   of trackers that ended with an error
videos/<scenario>/<condition>/seed-N-<key>.mp4                      of all trackers that share the frames
logs/<scenario>/<condition>/seed-N-<key>.rrd and .mcap
summary.parquet  tables/*.csv  tables/*.tex     made from the results at the end of a session
SHA256SUMS                                      of all of these, written last
.scratch                                        what workers are writing; swept when a session begins
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import duckdb

from pftrack_sim.benchmark import keys
from pftrack_sim.benchmark.asked.plan import AskedResult, Episode, Plan
from pftrack_sim.benchmark.asked.union import contradictions, united
from pftrack_sim.benchmark.kept.checksums import SUMS, changed, read_sums, write_sums
from pftrack_sim.benchmark.kept.episode_file import content_digests, create_frame_views
from pftrack_sim.benchmark.kept.files import LOCK, lock_folder, query_deadline, remove_parts, sql_text, write_bytes
from pftrack_sim.benchmark.kept.record import (
    new_record,
    now,
    plan_record,
    read_record,
    session,
    stored_plan,
    write_record,
)
from pftrack_sim.benchmark.reading.losses import create_loss_views
from pftrack_sim.benchmark.reading.summary import TABLE_FILES, Result, load_summary, results_of, write_summary
from pftrack_sim.core.errors import ParameterError, RunError
from pftrack_sim.core.inputs import is_file
from pftrack_sim.core.text import one_line
from pftrack_sim.logs import FORMATS

SCRATCH = ".scratch"
"""Folder of a run for the temporary files of its workers."""

_DERIVED = ("summary.parquet", *(f"tables/{name}" for name in TABLE_FILES))


@dataclass(frozen=True)
class QueryResult:
    """Rows that SQL returned, and the names of their columns."""

    columns: tuple[str, ...]
    rows: list[tuple[Any, ...]]


class RunStore:
    """A run folder to read; `RunStore.begin` opens one to write.

    Args:
        path: The folder.

    Raises:
        RunError: It is no run folder, or one of another format.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.record = read_record(path)
        self._lock: int | None = None
        self._derived_removed = False

    @classmethod
    def begin(cls, path: Path, plan: Plan, *, refresh: bool = False, running: bool = False) -> RunStore:
        """Open a run folder to write. It is locked until `close`, or until this process ends in any way.

        Args:
            path: Absent, empty, or a run folder.
            plan: What is asked for; `store.plan` then has what is there already, too.
            refresh: Remove results that have the same name and another key, instead of an error.
            running: Whether results will be run: all trackers of the folder count with the code of today.

        Raises:
            RunError: It holds something else, results of the same name with another key, or has another writer, or
                cannot be written.
        """
        lock: int | None = None
        try:
            _check_usable(path)
            path.mkdir(parents=True, exist_ok=True)
            lock = lock_folder(path)
            # Only under the lock is it certain what the folder holds: another process may have begun it just now.
            _check_usable(path)
            if is_run(path):
                _continue(cls(path), plan, refresh, running)
            else:
                write_record(path, new_record(plan))
            remove_parts(path)
            shutil.rmtree(path / SCRATCH, ignore_errors=True)
            (path / SCRATCH).mkdir(exist_ok=True)
            store = cls(path)
            (path / SUMS).unlink(missing_ok=True)
            store.record["sessions"].append(session())
            write_record(path, store.record)
        except BaseException as error:
            if lock is not None:
                os.close(lock)
            if isinstance(error, OSError):
                raise RunError(f"cannot make the run folder {path}: {error.strerror}") from None
            raise
        store._lock = lock
        return store

    @cached_property
    def plan(self) -> Plan:
        """What is asked for.

        Raises:
            RunError: It was edited.
        """
        plan = stored_plan(self.record, self.path / "run.json")
        self._verify(["run.json"])
        return plan

    def _verify(self, names: Sequence[str]) -> None:
        """Raise RunError where one of these files, in paths within the folder, differs from `SHA256SUMS`."""
        for line in changed(self.path, names, self.sums):
            raise RunError(f"{self.path}/{line}; pftrack-sim check lists all problems")

    @cached_property
    def sums(self) -> Mapping[str, str] | None:
        """Checksums by path within the folder; None while a session writes, and after one that was interrupted."""
        return read_sums(self.path)

    @property
    def finished(self) -> bool:
        """Whether every episode is there."""
        return self.record["finished"] is not None

    def result_file(self, asked: AskedResult) -> Path:
        """Path of a result's table."""
        return self.path / "episodes" / f"{asked.file}.parquet"

    def video_file(self, episode: Episode) -> Path:
        """Path of an episode's video."""
        return self.path / "videos" / f"{episode.path}.mp4"

    def result_files(self) -> Iterator[Path]:
        """Paths of all results' tables, sorted within each folder."""
        for folder, below, names in os.walk(self.path / "episodes"):
            below.sort()
            for name in sorted(names):
                if name.endswith(".parquet") and not name.startswith("."):
                    yield Path(folder) / name

    @property
    def kept(self) -> set[str]:
        """Short keys of the results that are there, asked for or not."""
        return {keys.key_of(file) for file in self.result_files()}

    @property
    def present(self) -> dict[Path, AskedResult]:
        """The results that are asked for and there, by their files, in the plan's order."""
        return {self.result_file(one): one for one in keys.present(self.plan.asked, self.kept).values()}

    def add(self, files: Mapping[str, bytes]) -> None:
        """Write files, by their paths within the folder; tables come last, so that a result with a table is complete.

        Raises:
            RunError: They cannot be written.
        """
        if not self._derived_removed:
            for name in _DERIVED:  # they would speak of fewer episodes
                (self.path / name).unlink(missing_ok=True)
            self._derived_removed = True
        for name in sorted(files, key=lambda name: name.startswith("episodes/")):
            write_bytes(self.path / name, files[name])

    def add_sessions(self, sessions: Sequence[dict[str, Any]]) -> None:
        """Record the sessions of another folder whose episodes were added."""
        known = self.record["sessions"]
        known += [session for session in sessions if session not in known]
        write_record(self.path, self.record)

    def write_summary(self) -> None:
        """Write the summary and the tables of the episodes that are there; mark the run finished if all are."""
        if write_summary(self.path, self.plan, self.present) == len(self.plan.asked):
            self.record["finished"] = self.record["finished"] or now()
            write_record(self.path, self.record)
        write_sums(self.path)

    def close(self) -> None:
        """Unlock the folder. Closing twice is fine."""
        if self._lock is not None:
            shutil.rmtree(self.path / SCRATCH, ignore_errors=True)
            os.close(self._lock)
            self._lock = None

    def __enter__(self) -> RunStore:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def database(self) -> duckdb.DuckDBPyConnection:
        """A database with views; the caller closes it.

        `frames` has a row per tracker and frame, `summary` per tracker and episode, `episodes` per episode, `losses`
        per loss of the target with what happened then, `moments` per tracker and frame with what happens there,
        `people` per person in view and frame; in closed loop with `label`, since each tracker leads elsewhere.

        Raises:
            RunError: There is no finished episode, or a file cannot be read.
        """
        files = self.present
        if not files:
            raise RunError(f"{self.path} has no finished episode yet")
        self._verify([file.relative_to(self.path).as_posix() for file in files])
        database = duckdb.connect()
        try:
            summary = self.path / "summary.parquet"
            if self.finished and self.sums is not None and not any(changed(self.path, [summary.name], self.sums)):
                database.execute(f"CREATE VIEW summary AS FROM read_parquet({sql_text(summary)})")
            else:
                load_summary(database, self.path, self.plan, files)
            create_frame_views(database, files)
            create_loss_views(database)
            database.execute(
                "CREATE VIEW episodes AS SELECT DISTINCT ON (number) number, kind, scenario, condition, levels, seed, "
                "episode_frames, rate_hz, frames_key, frames_digest, graphics, version "
                "FROM summary ORDER BY number"
            )
        except duckdb.Error as error:
            database.close()
            raise RunError(f"{self.path} cannot be read: {one_line(str(error))}") from None
        except BaseException:
            database.close()
            raise
        return database

    def query(self, sql: str) -> QueryResult:
        """Run a SELECT over the views of `database`; nothing outside the run folder is read.

        Raises:
            RunError: Nothing is there yet, or the SQL is wrong or does more than select.
        """
        with self.database() as database:
            try:
                statements = database.extract_statements(sql)
                kinds = [statement.type.name for statement in statements]
                if kinds not in (["SELECT"], ["EXPLAIN"]):
                    raise RunError(f"a query is one SELECT statement, got {' and '.join(kinds) or 'none'}")
                folder = sql_text(self.path.resolve())
                database.execute(f"SET allowed_directories = [{folder}, {sql_text(self.path)}]")
                database.execute("SET enable_external_access = false")
                table = database.execute(statements[0])
                return QueryResult(tuple(one[0] for one in table.description or ()), table.fetchall())
            except duckdb.Error as error:
                raise RunError(f"the query failed: {error}") from None

    @cached_property
    def results(self) -> tuple[Result, ...]:
        """Scores of each tracker in each finished episode, in the plan's order.

        Raises:
            RunError: There is none, or a file cannot be read.
        """
        with self.database() as database:
            return tuple(results_of(database, self.plan))

    def frame_columns(self, result: Result, names: Sequence[str]) -> dict[str, Any]:
        """Columns of a result, `(N,)` each, a row per frame.

        Raises:
            RunError: The file is missing, broken, or outside the run folder.
        """
        # Path.resolve raises RuntimeError where a link leads to itself (before Python 3.13).
        file = Path(os.path.realpath(self.path / result.file))
        if not file.is_relative_to(os.path.realpath(self.path)) or not is_file(file):
            raise RunError(f"{self.path}: the summary names a file that is not in the run folder: {result.file!r}")
        table = f"read_parquet({sql_text(file)}, hive_partitioning = false)"
        self._verify([result.file])
        try:
            with duckdb.connect() as database, query_deadline(database):
                digests = content_digests(database, table) if self.sums is None else {}
                if any(result.values[name] != value for name, value in digests.items()):
                    raise RunError(f"{file}: its rows do not have the digest they were written with")
                query = f"SELECT {', '.join(names)} FROM {table} ORDER BY frame"
                return cast("Any", database.execute(query)).fetchnumpy()
        except duckdb.Error as error:
            raise RunError(f"{file} cannot be read: {one_line(str(error).splitlines()[0])}") from None

    def video_of(self, result: Result) -> Path | None:
        """The video of a result's episode, if there is one."""
        path = self.video_file(self.plan.episode(int(result.values["number"])))
        return path if is_file(path) else None

    def error_picture(self, result: Result) -> Path | None:
        """The picture of a result's error, if it was kept; its text, of the same name, is beside it."""
        below = Path(result.file).relative_to("episodes")
        picture = self.path / "errors" / below.with_suffix(".png")
        return picture if is_file(picture) and is_file(picture.with_suffix(".txt")) else None


def is_run(path: Path) -> bool:
    """Whether a folder holds a run."""
    return is_file(path / "run.json")


def _check_usable(path: Path) -> None:
    """Raise RunError where a folder holds anything but a run or what is left of one killed before it had begun."""
    if not path.exists() or is_run(path):
        return
    if not path.is_dir() or any(one.name != LOCK and not one.name.startswith(".run.json.") for one in path.iterdir()):
        raise RunError(f"{path} exists and is not an empty folder: choose another with --out")


def _continue(store: RunStore, plan: Plan, refresh: bool, running: bool) -> None:
    """Make what a folder's plan lacks of this one part of it; see `RunStore.begin`."""
    path, stored = store.path, store.plan
    try:
        wanted = united(stored, plan, running=running)
    except ParameterError as error:
        raise RunError(f"{path} holds another plan: choose another folder with --out\n  {error}") from None
    if wanted is stored:
        return
    if keys.missing(keys.present(stored.asked, store.kept), wanted.asked.keys()) and not refresh:
        lines = contradictions(wanted, stored)
        coded = any(line.startswith(("trackers.", "run with.")) for line in lines)
        found = "was begun with other code" if coded else "holds another plan"
        raise RunError(
            f"{path} {found}: its results have the same names and other keys; run them again with --refresh, or choose "
            "another folder with --out\n" + "\n".join(f"  {line}" for line in lines)
        )
    (path / SUMS).unlink(missing_ok=True)
    # The record comes last: interrupted before it, the folder still asks to be refreshed.
    for name in _names(stored) - _names(wanted):
        (path / name).unlink(missing_ok=True)
    write_record(path, {**store.record, "finished": None, **plan_record(wanted)})


def _names(plan: Plan) -> set[str]:
    """Paths within a run folder of all files that results and episodes of a plan may have."""
    found = {name for one in plan.asked.values() for name in names_of_result(one.file)}
    return found | {name for episode in plan.episodes() for name in names_of_episode(episode.path)}


def names_of_result(file: str) -> list[str]:
    """Paths within a run folder of all files that a result may have."""
    return [f"episodes/{file}.parquet", f"errors/{file}.png", f"errors/{file}.txt"]


def names_of_episode(file: str) -> list[str]:
    """Paths within a run folder of all files that an episode may have."""
    return [f"videos/{file}.mp4", *(f"logs/{file}{form.suffix}" for form in FORMATS.values())]
