"""SQL on a run folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import duckdb

from pftrack_sim.benchmark.reading import Run
from pftrack_sim.core.errors import RunError


@dataclass(frozen=True)
class Answer:
    """What SQL gave.

    Attributes:
        heads: Names of the columns.
        rows: The rows.
    """

    heads: tuple[str, ...]
    rows: list[tuple[Any, ...]]


def ask(path: Path, sql: str) -> Answer:
    """Ask the views `episodes`, `frames` and `summary` of a run folder.

    Args:
        path: The folder.
        sql: The question.

    Raises:
        RunError: No run folder, nothing in it yet, or SQL that is wrong.
    """
    with Run(path).open() as database:
        try:
            table = database.execute(sql)
            return Answer(tuple(one[0] for one in table.description or ()), table.fetchall())
        except duckdb.Error as error:
            # DuckDB says which column or table is nearest, and points at the place.
            raise RunError(f"the query failed: {error}") from None
