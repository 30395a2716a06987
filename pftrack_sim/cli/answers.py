"""Answers of a query on standard output, as a table, CSV or lines of JSON."""

from __future__ import annotations

import csv
import json
import sys
from typing import TYPE_CHECKING, cast

from rich import box
from rich.table import Table
from rich.text import Text

from pftrack_sim.cli import tables
from pftrack_sim.core.errors import ParameterError

if TYPE_CHECKING:
    from pftrack_sim.benchmark.kept.store import QueryResult


def print_query(answer: QueryResult, layout: str) -> None:
    """Print the rows of a query as a table, as CSV, or as lines of JSON.

    Raises:
        ParameterError: No such layout.
    """
    if layout == "csv":
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(answer.columns)
        writer.writerows(answer.rows)
    elif layout == "json":
        for row in answer.rows:
            print(json.dumps(dict(zip(answer.columns, row, strict=True)), default=str))  # noqa: T201
    elif layout == "table":
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
        for place, head in enumerate(answer.columns):
            is_text = bool(answer.rows) and isinstance(answer.rows[0][place], str)
            table.add_column(Text(head), justify="left" if is_text else "right", overflow="fold")
        for row in answer.rows:
            table.add_row(*(Text(_cell(cell)) for cell in row))
        tables.console.print(table)
    else:
        raise ParameterError(f"--format must be table, csv or json, got {layout!r}")


def _cell(value: object) -> str:
    """A value of a query: floats with six digits, in lists too."""
    if isinstance(value, list):
        return f"[{', '.join(_cell(one) for one in cast('list[object]', value))}]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
