"""A run folder with what its results say: SQL views, the summary, and the frames of a result."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any, cast

import duckdb
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.benchmark.asked.plan import Episode
from pftrack_sim.benchmark.kept.files import query_deadline, sql_text
from pftrack_sim.benchmark.kept.folder import SUMMARY, RunFolder
from pftrack_sim.benchmark.kept.record import now
from pftrack_sim.benchmark.kept.tables import parquet
from pftrack_sim.benchmark.reading.failures import FAILURES
from pftrack_sim.benchmark.reading.losses import create_loss_views
from pftrack_sim.benchmark.reading.summary import Result, load_summary, results_of, write_summary
from pftrack_sim.core.errors import RunError
from pftrack_sim.core.inputs import is_file
from pftrack_sim.core.text import one_line

_EXPLAIN = re.compile(r"\s*EXPLAIN(\s+ANALYZE)?\b", re.IGNORECASE)
_FRAMES = """
SELECT results.*, drawn.* EXCLUDE (kind, scenario, condition, seed, label, frames_key, frame, time_s, people)
FROM {results} AS results JOIN {drawn} AS drawn USING (frames_key, frame)
"""
_PEOPLE = """
CREATE VIEW people AS
SELECT kind, scenario, condition, seed, label, frame, time_s, unnest(people, max_depth := 2) FROM {drawn}
"""
_EPISODES = """
CREATE VIEW episodes AS
SELECT DISTINCT ON (number) number, kind, scenario, condition, levels, seed, episode_frames, rate_hz, frames_key,
    frames_digest, graphics, version
FROM summary ORDER BY number
"""


@cache
def _reader(process: int) -> duckdb.DuckDBPyConnection:
    """The database that reads single files, one for each process: connecting takes longer than reading an episode.

    A forked process needs its own: DuckDB's threads do not survive the fork.
    """
    return duckdb.connect(config={"enable_external_file_cache": "false"})


def _filled(column: NDArray[Any]) -> NDArray[Any]:
    """A column with NaN in the place of numbers that are NULL, and None in that of other values."""
    values, missing = np.ma.getdata(column), np.ma.getmaskarray(column)
    unknown: Any = None if values.dtype == object else np.nan
    return np.where(missing, unknown, values) if missing.any() else values


@dataclass(frozen=True)
class QueryResult:
    """Rows that SQL returned, and the names of their columns."""

    columns: tuple[str, ...]
    rows: list[tuple[Any, ...]]


class RunStore(RunFolder):
    """A run folder to read; `RunStore.begin` opens one to write."""

    def write_summary(self) -> None:
        """Write the summary and the tables of the results that are there; mark the run finished if all are."""
        present = self.present
        write_summary(self, present.values())
        if len(present) == len(self.plan.asked) and not self.finished:
            self.note(finished=now())
        self.checksums.end()

    @contextlib.contextmanager
    def database(self) -> Generator[duckdb.DuckDBPyConnection]:
        """A database with views, in the block.

        `frames` has a row per tracker and frame, `summary` per tracker and episode, `episodes` per episode, `losses`
        per loss of the target with what happened then, `moments` per tracker and frame with what happens there,
        `people` per person in view and frame; in closed loop with `label`, since each tracker leads elsewhere, and
        `failures` has a row per drive without success with its cause.

        Raises:
            RunError: There is no finished episode, or a file cannot be read.
        """
        present = self.present
        if not present:
            self.require_checksums()
            raise RunError(f"{self.path} has no finished episode yet")
        missing = self.missing if self.finished else []
        for file in filter(is_file, (self.path / one.table for one in missing)):
            raise RunError(f"{file}: has no checksum, or its frames are missing; pftrack-sim check lists all problems")
        results, drawn = (dict.fromkeys(names) for names in zip(*(one.tables for one in present.values()), strict=True))
        self.verify((*results, *drawn))
        tables = [parquet(self.path / name for name in names) for names in (results, drawn)]
        whole = self.checksums.complete and self.finished and not missing and not self.checksums.changes([SUMMARY])
        with duckdb.connect() as database:
            try:
                if whole:
                    database.execute(f"CREATE VIEW summary AS FROM {parquet([self.path / SUMMARY])}")
                else:
                    load_summary(database, self, present.values())
                for view in (f"CREATE VIEW frames AS {_FRAMES}", _PEOPLE, _EPISODES):
                    database.execute(view.format(results=tables[0], drawn=tables[1]))
                create_loss_views(database)
                if self.plan.kind == "follow":
                    database.execute(FAILURES)
            except duckdb.Error as error:
                raise RunError(f"{self.path} cannot be read: {one_line(str(error))}") from None
            yield database

    def query(self, sql: str, *, limit_s: float | None = None, limit_gb: float | None = None) -> QueryResult:
        """Run a SELECT, DESCRIBE or SUMMARIZE over the views of `database`, or an EXPLAIN of one.

        Nothing is written, and nothing outside the run folder is read.

        Args:
            sql: The statement.
            limit_s: Time that it may take; None: any.
            limit_gb: Memory that DuckDB may take, besides single values and the rows returned, which it does not count;
                None: what it allows itself.

        Raises:
            RunError: Nothing is there yet, or the SQL is wrong, does more than select, or reaches a limit.
        """
        with self.database() as database:
            try:
                sql.encode()  # a lone surrogate is no text
                asked = _EXPLAIN.sub("", sql, count=1)  # what is explained may be more than a SELECT
                kinds = [statement.type.name for statement in database.extract_statements(asked)]
                if kinds != ["SELECT"]:
                    raise RunError(f"a query is one SELECT statement, got {' and '.join(kinds) or 'none'}")
                folder = sql_text(self.path.resolve())
                database.execute(f"SET allowed_directories = [{folder}, {sql_text(self.path)}]")
                if limit_gb is not None:
                    database.execute(f"SET memory_limit = '{limit_gb:g}GB'; SET temp_directory = ''")
                database.execute("SET enable_external_access = false; SET lock_configuration = true")
                with query_deadline(database, limit_s):
                    table = database.execute(sql)
                    return QueryResult(tuple(one[0] for one in table.description or ()), table.fetchall())
            except (duckdb.Error, UnicodeEncodeError) as error:
                raise RunError(f"the query failed: {error}") from None

    @cached_property
    def results(self) -> tuple[Result, ...]:
        """Scores of each tracker in each finished episode, in the plan's order.

        Raises:
            RunError: There is none, or a file cannot be read.
        """
        with self.database() as database:
            return tuple(results_of(database, self.plan))

    def episode_of(self, result: Result) -> Episode:
        """The episode of a result."""
        return self.plan.episode(int(result.values["number"]))

    def frame_columns(self, result: Result, names: Sequence[str]) -> dict[str, Any]:
        """Columns of a result and of its frames, `(N,)` each, a row per frame; NaN or None where a value is unknown.

        Raises:
            RunError: A file is missing, broken, or outside the run folder.
        """
        # Path.resolve raises RuntimeError where a link leads to itself (before Python 3.13).
        file = Path(os.path.realpath(self.path / result.file))
        if not file.is_relative_to(os.path.realpath(self.path)) or not is_file(file):
            raise RunError(f"{self.path}: the summary names a file that is not in the run folder: {result.file!r}")
        drawn = self.episode_of(result).frames_table
        self.verify([result.file, drawn])
        try:
            frames = _FRAMES.format(results=parquet([file]), drawn=parquet([self.path / drawn]))
            with _reader(os.getpid()).cursor() as database, query_deadline(database):
                table = database.execute(f"SELECT {', '.join(names)} FROM ({frames}) ORDER BY frame")
                columns: dict[str, Any] = cast("Any", table).fetchnumpy()
        except duckdb.Error as error:
            raise RunError(f"{file} cannot be read: {one_line(str(error).splitlines()[0])}") from None
        return {name: _filled(column) for name, column in columns.items()}

    def video_of(self, result: Result) -> Path | None:
        """The video of a result's episode, if there is one."""
        path = self.path / self.episode_of(result).video
        return path if is_file(path) else None

    def error_picture(self, result: Result) -> Path | None:
        """The picture of a result's error, if it was kept; its text, of the same name, is beside it."""
        below = Path(result.file).relative_to("episodes")
        picture = self.path / "errors" / below.with_suffix(".png")
        return picture if is_file(picture) and is_file(picture.with_suffix(".txt")) else None
