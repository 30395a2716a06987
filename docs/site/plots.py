"""Plots of the tables on the page of results, read from the page itself: what `pictures.py results` draws.

Each is an SVG of own lines: small, the same bytes for the same table, and light or dark as the reader's page is. Its
numbers stand beside its marks, and shapes rather than colours tell them apart.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.sax.saxutils import escape

PLOTS = {
    "ko2012": ("Table 2", "mean", "mean overlap x 100, with its 95 % interval; ◇ printed"),
    "lee2012": ("Table 3", "mean", "frames tracked [per cent]; ◇ printed"),
    "kwon2005": ("Following", "success", "share of drives that succeed, with its 95 % interval"),
    "solvable": ("Following", "success", "share of drives that succeed, with its 95 % interval"),
    "courses": ("Following", "success", "share of drives that succeed, with its 95 % interval"),
    "default": ("Mean overlap", "mean", "mean overlap, with its 95 % interval"),
}
"""Of each block of tables: how its plotted table begins, the column, and what the axis says."""

REFERENCES = {"stay": "stay", "fixed size": "fixed size", "fixed_size": "fixed size"}
"""Rows that are lines across all others."""

_BLOCK = re.compile(r"<!-- tables of (\S+) -->\n(.*?)<!-- end -->", re.DOTALL)
_CELL = re.compile(r"(?:(?P<printed>[\d.]+|-) / )?(?P<value>-?[\d.]+)(?: \((?P<low>-?[\d.]+) to (?P<high>-?[\d.]+)\))?")

_WIDTH, _LEFT, _RIGHT, _ROW, _LETTER = 520, 184, 472, 21, 7.4
_STYLE = """text{font:13px system-ui,sans-serif;fill:#1d2b31}.n{font:12px ui-monospace,monospace}.m{fill:#56666d}
.p{fill:#fff}.g{stroke:#dbe2e5}.r{stroke:#56666d;stroke-dasharray:4 3}.i{stroke:#0a6170;stroke-width:2.5}
.d{fill:#0a6170}.o{fill:#fff;stroke:#a34a00;stroke-width:1.8}
@media(prefers-color-scheme:dark){text{fill:#e4ebee}.m{fill:#a9b7bd}.p{fill:#1b2327}.g{stroke:#38444a}.r{stroke:#a9b7bd}
.i{stroke:#6fd0e0}.d{fill:#6fd0e0}.o{fill:#1b2327;stroke:#ffb454}}"""


@dataclass(frozen=True)
class Row:
    """A line of a plot: a value, what its interval spans, and the printed one if there is any."""

    group: str
    name: str
    value: float
    low: float | None
    high: float | None
    printed: float | None


def draw(page: Path, folder: Path) -> list[Path]:
    """Write a plot of every block of tables that has one; their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    written: list[Path] = []
    for run, body in _BLOCK.findall(page.read_text(encoding="utf-8")):
        if run in PLOTS:
            written.append(folder / f"{run}.svg")
            written[-1].write_text(plot(body, *PLOTS[run]), encoding="utf-8")
    return written


def rows_of(body: str, head: str, column: str) -> list[Row]:
    """What a column of the table with this head holds."""
    table = re.search(rf"^\| {re.escape(head)}.*?\|\n\| ---.*?\n((?:\|.*\n)+)", body, re.MULTILINE)
    if table is None:
        raise ValueError(f"no table {head!r}")
    columns = [one.strip() for one in table[0].splitlines()[0].strip("|").split("|")]
    rows: list[Row] = []
    for line in table[1].splitlines():
        cells = [one.strip() for one in line.strip("|").split("|")]
        group, _, name = cells[0].rpartition(", ")
        found = _CELL.fullmatch(cells[columns.index(column)])
        if found is None:
            raise ValueError(f"no number in {line!r}")
        low, high, printed = (
            None if one in (None, "-") else float(one) for one in found.group("low", "high", "printed")
        )
        rows.append(Row(group, name.strip("`").partition("+")[0], float(found["value"]), low, high, printed))
    return rows


def plot(body: str, head: str, column: str, axis: str) -> str:
    """The SVG of a column."""
    rows = rows_of(body, head, column)
    lines = {REFERENCES[one.name]: one.value for one in rows if one.name in REFERENCES}
    rows = [one for one in rows if one.name not in REFERENCES]
    if len(rows) == len({one.group for one in rows}):
        rows = [replace(one, group="", name=one.group) for one in rows]
    if not any(one.group for one in rows):
        rows.sort(key=lambda one: -one.value)
    whole = 1.0 if max(max(one.value, one.high or 0.0) for one in rows) <= 1.0 else 100.0
    top = 30 if lines else 12  # room for the names of the lines
    parts = list(_marks(rows, whole, top))
    groups = len({one.group for one in rows} - {""})
    bottom = top + _ROW * (len(rows) + groups)
    ticks = [
        f'<path class="g" d="M{_x(at):g} {top - 6}V{bottom}"/>'
        f'<text class="m" x="{_x(at):g}" y="{bottom + 16}" text-anchor="middle">{at * whole:g}</text>'
        for at in (0.0, 0.25, 0.5, 0.75, 1.0)
    ]
    start = min(_LEFT - 20 - round(_LETTER * max(len(one.name) for one in rows)), 0)  # Long names need more room
    width = _WIDTH + (44 if any(one.printed is not None for one in rows) else 0) - start
    told = "; ".join(
        f"{one.group} {one.name} {_text(one.value, whole)}".strip()
        + (f", printed {_text(one.printed, whole)}" if one.printed is not None else "")
        for one in rows
    )
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{start} 0 {width} {bottom + 42}" role="img">',
            f"<title>{escape(axis)}: {escape(told)}</title>",
            f"<style>{_STYLE}</style>",
            f'<rect class="p" x="{start}" width="{width}" height="{bottom + 42}"/>',
            *ticks,
            *(
                f'<path class="r" d="M{_x(at / whole):g} {top - 6}V{bottom}"/>'
                f'<text class="m" x="{_x(at / whole):g}" y="{top - 12}" text-anchor="middle">'
                f"{name} {_text(at, whole)}</text>"
                for name, at in lines.items()
            ),
            *parts,
            f'<text x="{(_LEFT + _RIGHT) / 2:g}" y="{bottom + 35}" text-anchor="middle">{escape(axis)}</text>',
            "</svg>",
            "",
        ]
    )


def _marks(rows: Sequence[Row], whole: float, top: int) -> Iterator[str]:
    y, group = top + _ROW / 2, ""
    for one in rows:
        if one.group != group:
            group = one.group
            yield f'<text class="m" x="6" y="{y + 4:g}">{escape(group)}</text>'
            y += _ROW
        yield f'<text x="{_LEFT - 12}" y="{y + 4:g}" text-anchor="end">{escape(one.name)}</text>'
        x = _x(one.value / whole)
        if one.low is not None and one.high is not None:
            yield f'<path class="i" d="M{_x(one.low / whole):g} {y:g}H{_x(one.high / whole):g}"/>'
        yield f'<circle class="d" cx="{x:g}" cy="{y:g}" r="5"/>'
        numbers = _text(one.value, whole)
        if one.printed is not None:
            at = _x(one.printed / whole)
            yield f'<path class="o" d="M{at:g} {y - 6:g}l6 6l-6 6l-6 -6z"/>'
            numbers = f"{numbers} ◇{_text(one.printed, whole)}"
        yield f'<text class="n" x="{_RIGHT + 10}" y="{y + 4:g}">{numbers}</text>'
        y += _ROW


def _x(share: float) -> float:
    return round(_LEFT + share * (_RIGHT - _LEFT), 1)


def _text(value: float, whole: float) -> str:
    return f"{value:.2f}" if whole == 1.0 else f"{value:.1f}"
