"""The summary of a run: one row per tracker and episode, as results, as `summary.parquet`, and as CSV and LaTeX."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import islice
from typing import Any

import duckdb

from pftrack_sim.benchmark.asked.plan import AskedResult, Condition, Plan, TrackerSpec
from pftrack_sim.benchmark.kept.files import atomic_write, csv_text, sql_text, write_bytes
from pftrack_sim.benchmark.kept.folder import SUMMARY, RunFolder
from pftrack_sim.benchmark.kept.tables import CHUNK, OPENED, column, read_metadata
from pftrack_sim.core.errors import RunError
from pftrack_sim.score import Measures, SeedMean, bounds_of, mean_over_seeds, paired_difference
from pftrack_sim.score.following import Following

SCORES = ("hota", "deta", "assa", "idf1", "mota", "switches")
"""Columns of everybody in view, for multi-object trackers; see `score.multi_object`."""


# Types are given, because a column without any value has none.
_CASTS = {
    "error": "VARCHAR",
    "printed": "VARCHAR",
    "controller": "VARCHAR",
    "collided_with": "VARCHAR",
    **dict.fromkeys(SCORES, "DOUBLE"),
    "level_names": "VARCHAR[]",
    "level_values": "DOUBLE[]",
}

_MEAN_OF = ("mean_overlap", "stay", "success", "success_30", "centre_inside", "fixed_size", "precision")
_MEANS = {name: f'avg("{name}") FILTER (NOT isnan("{name}"))' for name in _MEAN_OF}
# Of the means: the skill of one episode is unbounded where its target hardly moves.
_MEANS["skill"] = "({mean_overlap} - {stay}) / nullif(1 - {stay}, 0)".format_map(_MEANS)
_INTERVAL = "mean_overlap_low"
_SCORES = ", ".join(
    [
        "count(*)::INTEGER AS episodes, count(DISTINCT seed)::INTEGER AS seeds",
        f"{_MEANS['mean_overlap']} AS mean_overlap, "
        f"coalesce(list((seed, mean_overlap) ORDER BY number) FILTER (NOT isnan(mean_overlap)), []) AS {_INTERVAL}",
        *(f'{_MEANS[name]} AS "{name}"' for name in ("stay", "skill", *_MEAN_OF[2:])),
        "count(error)::INTEGER AS errors",
    ]
)

# No times: the tables are the same in every run of a plan.
_TABLES: Mapping[str, str] = {
    "trackers": f"SELECT label AS tracker, {_SCORES} FROM summary GROUP BY label ORDER BY min(place)",
    "conditions": f"SELECT scenario, condition, label AS tracker, {_SCORES} FROM summary "
    "GROUP BY scenario, condition, label ORDER BY min(number), min(place)",
    "episodes": "SELECT scenario, condition, seed, label AS tracker, frames, mean_overlap, stay, "
    'success, success_30, centre_inside, fixed_size, "precision", error FROM summary ORDER BY number, place',
}
_LATEX_HEADS = {
    "mean_overlap": "mean overlap (95 % interval over seeds)",
    "success": "overlap ≥ 0.5",
    "success_30": "overlap ≥ 0.3",
    "precision": "precision at 20 px",
}

_LATEX_ESCAPES = {
    "≥": r"$\geq$",
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    **{mark: "\\" + mark for mark in "&%$#_{}"},
}


@dataclass(frozen=True, eq=False)
class Result:
    """Scores of one tracker in one episode: a row of the summary, with every column in `values`."""

    tracker: TrackerSpec
    scenario: str
    condition: Condition
    seed: int
    values: Mapping[str, Any]

    def number(self, name: str) -> float:
        """A column as a number; NaN where the summary has none."""
        value = self.values.get(name)
        return float(value) if value is not None else float("nan")

    @property
    def key(self) -> tuple[str, str, int, str]:
        """Scenario, condition, seed and label."""
        return self.scenario, self.condition.name, self.seed, self.label

    @property
    def label(self) -> str:
        """The tracker as people read it."""
        return self.tracker.label

    @property
    def file(self) -> str:
        """Path of the episode's table within the run folder."""
        return str(self.values["file"])

    @property
    def error(self) -> str | None:
        """The tracker's first error with its frame, or None."""
        return self.values.get("error")

    @property
    def measures(self) -> Measures:
        """Scores of tracking."""
        return Measures(**{one.name: self._known(one.name) for one in fields(Measures)})

    @property
    def following(self) -> Following | None:
        """Scores of following, in closed loop."""
        if self.tracker.controller is None:
            return None
        return Following(**{one.name: self._known(f"follow_{one.name}") for one in fields(Following)})

    @property
    def never_seen(self) -> bool:
        """Whether the target is never visible, so that nothing is scored."""
        return math.isnan(self.number("mean_overlap"))

    def _known(self, name: str) -> Any:
        """A column; NaN where it is undefined: the database makes it NULL."""
        value = self.values[name]
        return math.nan if value is None else value


def by_seed(values: Iterable[tuple[int, float]]) -> dict[int, float]:
    """Mean of the known values of each seed, from seeds and values: episodes of one seed are no repetitions."""
    known: dict[int, list[float]] = {}
    for seed, value in values:
        if not math.isnan(value):
            known.setdefault(seed, []).append(value)
    return {seed: sum(own) / len(own) for seed, own in known.items()}


def paired_by_seed(first: Mapping[int, float], second: Mapping[int, float]) -> SeedMean:
    """Mean difference first - second of scores in [0, 1] by seed, over the seeds that both have."""
    seeds = sorted(first.keys() & second.keys())
    return paired_difference([first[seed] for seed in seeds], [second[seed] for seed in seeds], (0.0, 1.0))


def results_of(database: duckdb.DuckDBPyConnection, plan: Plan) -> Iterator[Result]:
    """Every row of the view `summary`, in the plan's order."""
    conditions = plan.conditions
    table = database.execute("SELECT * EXCLUDE levels FROM summary ORDER BY number, place")
    names = [str(one[0]) for one in table.description or ()]
    for row in table.fetchall():
        values: dict[str, Any] = dict(zip(names, row, strict=True))
        tracker, condition = plan.trackers[int(values["place"])], conditions[values["condition"]]
        yield Result(tracker, values["scenario"], condition, int(values["seed"]), values)


def load_summary(database: duckdb.DuckDBPyConnection, folder: RunFolder, results: Iterable[AskedResult]) -> None:
    """Fill a table `summary` of results of a run folder; they are read a few hundred at a time."""
    places = {label: place for place, label in enumerate(folder.plan.labels)}
    found, made = read_metadata(folder.path, results), False
    while chunk := list(islice(found, CHUNK)):
        rows = [
            {
                "number": one.episode.number,
                "place": places[one.tracker.label],
                **dict.fromkeys(SCORES),
                **metadata,
                "level_names": list(metadata["levels"]),
                "level_values": list(metadata["levels"].values()),
                "file": one.table,
            }
            for one, metadata in chunk
        ]
        names = [name for name in dict.fromkeys(name for row in rows for name in row) if name not in ("levels", OPENED)]
        database.register("chunk", {name: column([row.get(name) for row in rows]) for name in names})
        chosen = ", ".join(f"{name}::{_CASTS[name]} AS {name}" if name in _CASTS else name for name in names)
        select = (
            "SELECT * EXCLUDE (level_names, level_values), map(level_names, level_values) AS levels "
            f"FROM (SELECT {chosen} FROM chunk)"
        )
        database.execute(f"INSERT INTO summary BY NAME {select}" if made else f"CREATE TABLE summary AS {select}")
        database.unregister("chunk")
        made = True


def write_summary(folder: RunFolder, results: Collection[AskedResult]) -> None:
    """Write the summary and the tables of these results of a run folder, if there are any.

    Raises:
        RunError: They cannot be written.
    """
    if not results:
        return
    with duckdb.connect() as database:
        try:
            load_summary(database, folder, results)
            with atomic_write(folder.path / SUMMARY) as part:
                database.execute(f"COPY (FROM summary ORDER BY number, place) TO {sql_text(part)} (FORMAT parquet)")
            for name, content in tables_of(database):
                write_bytes(folder.path / name, content)
        except duckdb.Error as error:
            raise RunError(f"cannot write the summary of {folder.path}: {error}") from None


def tables_of(database: duckdb.DuckDBPyConnection) -> Iterator[tuple[str, bytes]]:
    """Paths within the run folder and contents of the tables that are made of the table `summary`."""
    for name, query in _TABLES.items():
        table = database.execute(query)
        heads, rows = [str(one[0]) for one in table.description or ()], table.fetchall()
        if name == "episodes":
            yield f"tables/{name}.csv", csv_text(heads, rows).encode()
            continue
        at = heads.index(_INTERVAL)
        means = [_mean(row[at]) for row in rows]
        heads.insert(at + 1, "mean_overlap_high")
        rows = [(*row[: at - 1], *own, *row[at + 1 :]) for row, own in zip(rows, means, strict=True)]
        yield f"tables/{name}.csv", csv_text(heads, rows).encode()
        ranged = [(*row[: at - 1], _ranged(*row[at - 1 : at + 2]), *row[at + 2 :]) for row in rows]
        shown = [_LATEX_HEADS.get(head, head) for head in heads[:at] + heads[at + 2 :]]
        yield f"tables/{name}.tex", latex(shown, ranged).encode()


def _mean(scores: Iterable[tuple[int, float]]) -> tuple[float | None, float | None, float | None]:
    """Mean over seeds of scores by seed, and the ends of its interval; None where there is none."""
    found = mean_over_seeds(list(by_seed(scores).values()), bounds_of("mean_overlap"))
    mean, low, high = (None if math.isnan(one) else one for one in (found.mean, found.low, found.high))
    return mean, low, high


def _ranged(mean: float | None, low: float | None, high: float | None) -> str | float | None:
    return mean if low is None else f"{mean:.3f} ({low:.3f} to {high:.3f})"


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
    texts = [isinstance(cell, str) and not cell[:1].isdigit() for cell in (rows[0] if rows else heads)]
    sides = "".join("l" if is_text else "r" for is_text in texts)
    lines = [f"\\begin{{tabular}}{{{sides}}}", "\\toprule", _latex_row([head.replace("_", " ") for head in heads])]
    lines += ["\\midrule", *(_latex_row(row) for row in rows), "\\bottomrule", "\\end{tabular}", ""]
    return "\n".join(lines)


def _latex_row(cells: Sequence[object]) -> str:
    texts = ["--" if cell is None else f"{cell:.3f}" if isinstance(cell, float) else str(cell) for cell in cells]
    escaped = ["".join(_LATEX_ESCAPES.get(letter, letter) for letter in text) for text in texts]
    return " & ".join(escaped) + " \\\\"
