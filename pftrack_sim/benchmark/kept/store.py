"""The run folder: written episode by episode, read at any time, also unfinished.

run.json                                    the plan, its digest, versions, and every session that worked on it
episodes/<scenario>/<condition>/seed-N.parquet
videos/<scenario>/<condition>/seed-N.mp4
logs/<scenario>/<condition>/seed-N.rrd and .mcap
errors/<scenario>/<condition>/seed-N/<tracker>.png and .txt    of trackers that ended with an error
summary.parquet  tables/*.csv  tables/*.tex     made from the episodes at the end of a session
SHA256SUMS                                      of all of these, written last
.scratch                                        what workers are writing; swept when a session begins
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import duckdb

from pftrack_sim.benchmark.asked.growth import grown
from pftrack_sim.benchmark.asked.plan import Episode, Plan
from pftrack_sim.benchmark.asked.stored_plan import differences, read_plan
from pftrack_sim.benchmark.kept.checksums import SUMS, changed, read_sums, write_sums
from pftrack_sim.benchmark.kept.episode_file import content_digest, create_frame_views, join_episodes
from pftrack_sim.benchmark.kept.error_files import errors_folder, remove_errors
from pftrack_sim.benchmark.kept.files import (
    LOCK,
    atomic_write,
    lock_folder,
    query_deadline,
    remove_parts,
    sql_text,
    write_bytes,
)
from pftrack_sim.benchmark.kept.record import (
    check_writable,
    new_record,
    now,
    plan_record,
    read_record,
    session,
    write_record,
)
from pftrack_sim.benchmark.losses import create_loss_views
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
    def begin(cls, path: Path, plan: Plan, *, refresh: bool = False, grow: bool = False) -> RunStore:
        """Open a run folder to write. It is locked until `close`, or until this process ends in any way.

        Args:
            path: Absent, empty, or begun with the same plan.
            plan: What is run; `store.plan` then has what is there already, too.
            refresh: Where the folder was begun with other code of the same trackers, remove their rows, instead of an
                error.
            grow: Where the folder was begun with another plan that does not contradict this one, add this one to it,
                instead of an error.

        Raises:
            RunError: It holds something else, another plan, or has another writer, or cannot be written.
        """
        lock: int | None = None
        try:
            _check_usable(path)
            path.mkdir(parents=True, exist_ok=True)
            lock = lock_folder(path)
            # Only under the lock is it certain what the folder holds: another process may have begun it just now.
            _check_usable(path)
            begun = is_run(path)
            if begun:
                check_writable(path)
                _continue(path, plan, refresh, grow)
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
        """What is run.

        Raises:
            RunError: It was edited.
        """
        source = self.path / "run.json"
        plan = read_plan(self.record.get("plan"), str(source))
        if plan.digest != self.record.get("plan_sha256"):
            raise RunError(f"{source} was edited: its plan does not have the digest it names")
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

    def episode_file(self, episode: Episode) -> Path:
        """Path of an episode's table."""
        return self.path / "episodes" / f"{episode.path}.parquet"

    def video_file(self, episode: Episode) -> Path:
        """Path of an episode's video."""
        return self.path / "videos" / f"{episode.path}.mp4"

    def log_file(self, episode: Episode, name: str) -> Path:
        """Path of an episode's log in the format of this name."""
        return self.path / "logs" / f"{episode.path}{FORMATS[name].suffix}"

    def episode_files(self) -> Iterator[Path]:
        """Paths of all tables, sorted within each folder."""
        for folder, below, names in os.walk(self.path / "episodes"):
            below.sort()
            for name in sorted(names):
                if name.endswith(".parquet") and not name.startswith("."):
                    yield Path(folder) / name

    def episodes(self) -> Iterator[tuple[int, Episode]]:
        """Numbers and episodes of the plan that have a file, in the plan's order."""

        def files_in(folder: str) -> set[str]:
            path = self.path / "episodes" / folder
            names = os.listdir(path) if path.is_dir() else []
            return {name.removesuffix(".parquet") for name in names if name.endswith(".parquet")}

        return self.plan.present(files_in)

    def has(self, episode: Episode) -> bool:
        """Whether an episode is finished."""
        return is_file(self.episode_file(episode))

    def add(
        self,
        episode: Episode,
        table: bytes,
        video: bytes | None,
        logs: Mapping[str, bytes] | None = None,
        errors: Mapping[str, bytes] | None = None,
    ) -> None:
        """Write the files of an episode; the table comes last, so that an episode with a table is complete.

        Raises:
            RunError: They cannot be written.
        """
        if not self._derived_removed:
            for name in _DERIVED:  # they would speak of fewer episodes
                (self.path / name).unlink(missing_ok=True)
            self._derived_removed = True
        file = self.episode_file(episode)
        if is_file(file):
            table = self._joined(episode, file, table)
            self.video_file(episode).unlink(missing_ok=True)  # it lacks the trackers that were added
        elif video is not None:
            write_bytes(self.video_file(episode), video)
        for name, content in (logs or {}).items():
            write_bytes(self.log_file(episode, name), content)
        for name, content in (errors or {}).items():
            write_bytes(errors_folder(self.path, episode) / name, content)
        write_bytes(file, table)

    def _joined(self, episode: Episode, file: Path, table: bytes) -> bytes:
        """A finished episode's table with the rows of the trackers that were added to it."""
        added, joined = self.path / SCRATCH / "added.parquet", self.path / SCRATCH / "joined.parquet"
        write_bytes(added, table)
        earlier = [label for label in self.plan.labels if label not in episode.labels]
        join_episodes(joined, [(file, earlier), (added, episode.labels)], replace(episode, trackers=self.plan.trackers))
        return joined.read_bytes()

    def add_sessions(self, sessions: Sequence[dict[str, Any]]) -> None:
        """Record the sessions of another folder whose episodes were added."""
        known = self.record["sessions"]
        known += [session for session in sessions if session not in known]
        write_record(self.path, self.record)

    def write_summary(self) -> None:
        """Write the summary and the tables of the episodes that are there; mark the run finished if all are."""
        if write_summary(self.path, self.plan, self.episodes()) == self.plan.episode_count:
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
        files = [file for _, episode in self.episodes() if is_file(file := self.episode_file(episode))]
        if not files:
            raise RunError(f"{self.path} has no finished episode yet")
        self._verify([file.relative_to(self.path).as_posix() for file in files])
        database = duckdb.connect()
        try:
            summary = self.path / "summary.parquet"
            if self.finished and self.sums is not None and not any(changed(self.path, [summary.name], self.sums)):
                database.execute(f"CREATE VIEW summary AS FROM read_parquet({sql_text(summary)})")
            else:
                load_summary(database, self.path, self.plan, self.episodes())
            create_frame_views(database, files)
            create_loss_views(database)
            database.execute(
                "CREATE VIEW episodes AS SELECT DISTINCT ON (number) number, kind, scenario, condition, levels, seed, "
                "episode_frames, rate_hz, frames_digest, content_sha256, graphics, version, file "
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
        """Columns of a result's episode, `(N,)` each, ordered by frame; a row per tracker and frame.

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
                if self.sums is None and content_digest(database, table) != result.values["content_sha256"]:
                    raise RunError(f"{file}: its rows do not have the digest they were written with")
                query = f"SELECT {', '.join(names)} FROM {table} ORDER BY frame"
                return cast("Any", database.execute(query)).fetchnumpy()
        except duckdb.Error as error:
            raise RunError(f"{file} cannot be read: {one_line(str(error).splitlines()[0])}") from None

    def video_of(self, result: Result) -> Path | None:
        """The video of a result's episode, if there is one."""
        below = Path(result.file).relative_to("episodes").with_suffix(".mp4")
        path = self.path / "videos" / below
        return path if ".." not in below.parts and is_file(path) else None


def is_run(path: Path) -> bool:
    """Whether a folder holds a run."""
    return is_file(path / "run.json")


def _check_usable(path: Path) -> None:
    """Raise RunError where a folder holds anything but a run or what is left of one killed before it had begun."""
    if not path.exists() or is_run(path):
        return
    if not path.is_dir() or any(one.name != LOCK and not one.name.startswith(".run.json.") for one in path.iterdir()):
        raise RunError(f"{path} exists and is not an empty folder: choose another with --out")


def _continue(path: Path, plan: Plan, refresh: bool, grow: bool) -> None:
    """Make what a folder's plan lacks of this one part of it; see `RunStore.begin`."""
    store = RunStore(path)
    try:
        wanted = grown(store.plan, plan) if grow else plan
    except ParameterError as error:
        raise RunError(f"{path} holds another plan: choose another folder with --out\n{error}") from None
    if wanted.digest == store.plan.digest:
        return
    lines = "\n".join(f"  {line}" for line in differences(wanted, store.plan))
    if not grow and store.plan.without_code().digest != plan.without_code().digest:
        raise RunError(f"{path} holds another plan: choose another folder with --out, or ask for the same\n{lines}")
    digests = {tracker.label: tracker.digest for tracker in wanted.trackers}
    changed_code = [tracker for tracker in store.plan.trackers if digests[tracker.label] != tracker.digest]
    if changed_code and not refresh:
        raise RunError(
            f"{path} was begun with other code: its results are not those of the code of today; run what has changed "
            f"again with --refresh, or choose another folder with --out\n{lines}"
        )
    (path / SUMS).unlink(missing_ok=True)
    # The record comes last: interrupted before it, the folder still asks to be refreshed.
    for _, old in store.episodes() if changed_code else ():
        kept = [tracker.label for tracker in old.trackers if tracker not in changed_code]
        file = store.episode_file(old)
        if len(kept) < len(old.trackers):
            for name in (store.video_file(old), *(store.log_file(old, name) for name in FORMATS)):
                name.unlink(missing_ok=True)
            remove_errors(errors_folder(store.path, old), {*old.labels} - {*kept}, store.plan.labels)
            if kept:
                with atomic_write(file) as part:
                    join_episodes(part, [(file, kept)], old)
            else:
                file.unlink(missing_ok=True)
    write_record(path, {**store.record, "finished": None, **plan_record(wanted)})
