"""Tables, lines and paths on standard output, warnings on standard error."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table as RichTable

if TYPE_CHECKING:
    from pftrack_sim.report.tables import Table

_MOST_LINES = 20

_LEAST_NAME = 10
"""Least width of a column of names [characters]."""

_MOST_WIDE = 10_000

_BRACKETS = re.compile(r" \(([-+.\d]+(?:(?: to |, )[-+.\d]+)+)\)$")
_SHARES = re.compile(r"\n([.\d]+) to ([.\d]+)$")

# Files and pipes have no width. No markup: brackets are those of `ko2012[alpha=0.5]`.
console = Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else 200)


def first_lines(lines: Sequence[str]) -> list[str]:
    """The first lines, and how many more there are."""
    more = [f"and {len(lines) - _MOST_LINES} more"] if len(lines) > _MOST_LINES else []
    return [*lines[:_MOST_LINES], *more]


def print_tables(*shown: Table) -> None:
    """Print tables, intervals below their means; columns that do not fit into the terminal follow in further parts."""
    for table in shown:
        console.print(f"\n{table.title}", soft_wrap=True)
        first, count = table.keys, len(table.numbers)
        while first < max(count, 1):
            fitting = (
                end for end in range(first + 1, count + 1) if _least_width(_shown(table, first, end)) <= console.width
            )
            last = max(fitting, default=first + 1)
            part = _shown(table, first, last)
            least = _least_width(part)
            if least > console.width:
                part.width = least
            console.print(part, soft_wrap=True)
            first = last
        print_lines((f"{name}: {words}" for name, words in table.definitions.items()), wrap=True)


def _shown(table: Table, first: int, last: int) -> RichTable:
    """The columns of names and keys of a table, and those of numbers from `first` to before `last`."""
    shown = RichTable(box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for head in table.names[1:] if table.grouped else table.names:
        shown.add_column(head, overflow="fold", min_width=_LEAST_NAME)
    chosen = [*range(table.keys), *range(first, last)]
    for place in chosen:
        shown.add_column(table.numbers[place] if table.numbers else "", justify="right", no_wrap=True)
    place = None
    for row in table.rows:
        below = (_BRACKETS.sub(lambda found: "\n" + found[1].replace(", ", " "), cell) for cell in row)
        cells = [_SHARES.sub(r"\n\1-\2", cell) for cell in below]
        cells = [*cells[: len(table.names)], *(cells[len(table.names) + one] for one in chosen if table.numbers)]
        if table.grouped:
            if row[0] != place:
                shown.add_row(place := row[0])
            cells = [f"  {cells[1]}", *cells[2:]]
        shown.add_row(*cells)
    return shown


def _least_width(shown: RichTable) -> int:
    """Width of a table whose names are folded as far as they can be [characters]."""
    names = [column for column in shown.columns if not column.no_wrap]
    for column in names:
        column.max_width = _LEAST_NAME
    least = Measurement.get(console, console.options.update_width(_MOST_WIDE), shown).maximum
    for column in names:
        column.max_width = None
    return least


def print_folder(path: Path) -> None:
    """Print the path of the results."""
    console.print(f"written: {path}", soft_wrap=True)


def print_page(path: Path) -> None:
    """Print the path of a page, and how to see it."""
    print_folder(path)
    print_lines([f"next: open {shlex.quote(str(path))}"])


def print_lines(lines: Iterable[str], *, wrap: bool = False) -> None:
    """Print lines: prose wraps between words, commands and paths stay whole to be copied."""
    for line in lines:
        console.print(line, soft_wrap=not wrap)


def print_warnings(lines: Sequence[str]) -> None:
    """Print warnings on standard error, one line each."""
    for line in first_lines(lines):
        print(f"pftrack-sim: warning: {line}", file=sys.stderr)  # noqa: T201
