"""What is made from the episodes when they are there: `summary.parquet`, and tables as CSV and LaTeX."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import duckdb

from pftrack_sim.benchmark.atomic_write import appearing, write_whole
from pftrack_sim.benchmark.plan import Plan
from pftrack_sim.benchmark.reading import load_summary
from pftrack_sim.core.errors import RunError

_SCORES = """
    count(*)::INTEGER AS episodes,
    avg(mean_overlap) FILTER (NOT isnan(mean_overlap)) AS mean_overlap,
    avg(success) FILTER (NOT isnan(success)) AS success,
    avg("precision") FILTER (NOT isnan("precision")) AS "precision",
    count(failure)::INTEGER AS failures
"""

# Only what is the same in every run of a plan: no times.
_TABLES: Mapping[str, str] = {
    "trackers": f"SELECT tracker, {_SCORES} FROM summary GROUP BY tracker ORDER BY min(place)",
    "conditions": f"SELECT scenario, condition, tracker, {_SCORES} FROM summary "
    "GROUP BY scenario, condition, tracker ORDER BY min(number), min(place)",
    "episodes": "SELECT scenario, condition, seed, tracker, frames, mean_overlap, success, "
    '"precision", failure FROM summary ORDER BY number, place',
}
_TYPESET = ("trackers", "conditions")
_SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    **{mark: "\\" + mark for mark in "&%$#_{}"},
}


def write_results(path: Path, plan: Plan) -> None:
    """Write the summary and the tables of what is there.

    Args:
        path: Run folder with at least one episode.
        plan: Its plan.

    Raises:
        RunError: They cannot be written.
    """
    with duckdb.connect() as database:
        try:
            if not load_summary(database, path, plan, hashes=True):
                return
            with appearing(path / "summary.parquet") as part:
                database.execute(f"COPY (FROM summary ORDER BY number, place) TO '{_quoted(part)}' (FORMAT parquet)")
            for name, query in _TABLES.items():
                with appearing(path / "tables" / f"{name}.csv") as part:
                    database.execute(f"COPY ({query}) TO '{_quoted(part)}' (FORMAT csv, HEADER)")
                if name in _TYPESET:
                    table = database.execute(query)
                    heads = [one[0] for one in table.description or ()]
                    write_whole(path / "tables" / f"{name}.tex", latex(heads, table.fetchall()).encode())
        except duckdb.Error as error:
            raise RunError(f"cannot write the summary of {path}: {error}") from None


def latex(heads: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    r"""A table for LaTeX with `booktabs`: text on the left, numbers on the right with three decimals.

    >>> print(latex(["tracker", "mean_overlap"], [["a_b", 0.5]]))
    \begin{tabular}{lr}
    \toprule
    tracker & mean overlap \\
    \midrule
    a\_b & 0.500 \\
    \bottomrule
    \end{tabular}
    <BLANKLINE>
    """
    sides = "".join("l" if rows and isinstance(rows[0][place], str) else "r" for place in range(len(heads)))
    lines = [f"\\begin{{tabular}}{{{sides}}}", "\\toprule", _line([head.replace("_", " ") for head in heads])]
    lines += ["\\midrule", *(_line(row) for row in rows), "\\bottomrule", "\\end{tabular}", ""]
    return "\n".join(lines)


def _line(cells: Sequence[object]) -> str:
    return " & ".join(_cell(cell) for cell in cells) + " \\\\"


def _cell(value: object) -> str:
    if value is None:
        return "--"
    text = f"{value:.3f}" if isinstance(value, float) else str(value)
    return "".join(_SPECIAL.get(letter, letter) for letter in text)


def _quoted(path: Path) -> str:
    return str(path).replace("'", "''")
