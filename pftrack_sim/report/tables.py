"""Tables of results as values: a terminal prints them, a document holds them as Markdown."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TypeVar

import numpy as np

from pftrack_sim import score
from pftrack_sim.benchmark import Result, RunStore
from pftrack_sim.benchmark.asked.suite import Suite
from pftrack_sim.benchmark.datasets.results import Scored, score_text
from pftrack_sim.benchmark.reading.failures import CAUSES, Failure
from pftrack_sim.benchmark.reading.summary import by_seed
from pftrack_sim.benchmark.said.anchors import anchor_scores
from pftrack_sim.benchmark.said.claims import ClaimComparison, compare_with_paper
from pftrack_sim.benchmark.said.degradation import TITLES, AxisLevel, degradation, table_rows

FOLLOWING: Mapping[str, str] = MappingProxyType(
    {
        "success": "success",
        "tracked": "tracking_rate",
        "within": "within",
        "collided": "collision",
        "RMS of distance [m]": "distance_rms_m",
        "RMS of bearing [deg]": "bearing_rms_deg",
        "jerk [m/s\u00b3]": "jerk_rms_m_s3",
        "nearest bystander [m]": "bystander_m",
    }
)
"""Columns of the table of following, and their measures."""

_PROPORTIONS = ("success", "collision")
_COVERING = ("occlusion", "distractors")
"""Axes that hide the target, over which recoveries are shown."""

_TRANSFER_MS = 5.0
"""What an image's way to a tracker's process and back may take."""


_Item = TypeVar("_Item")
_Key = TypeVar("_Key", bound=Hashable)


@dataclass(frozen=True)
class Table:
    """A table of text.

    Attributes:
        title: What it shows.
        names: Heads of its columns of text.
        numbers: Heads of its columns of numbers, to the right of those.
        rows: Its cells.
        notes: Definitions of heads, by name.
        grouped: Whether the first column is a place, under which the rows of its trackers belong together.
        keys: How many of the columns of numbers belong to the name of a row.
    """

    title: str
    names: Sequence[str]
    numbers: Sequence[str]
    rows: Sequence[Sequence[str]]
    notes: Mapping[str, str] = field(default_factory=dict[str, str])
    grouped: bool = False
    keys: int = 0

    @property
    def heads(self) -> list[str]:
        """Heads of all columns."""
        return [*self.names, *self.numbers]

    @property
    def definitions(self) -> dict[str, str]:
        """The notes on words that stand in the table."""
        words = " ".join(" ".join((self.title, *self.heads, *itertools.chain(*self.rows))).split())
        return {name: note for name, note in self.notes.items() if name in words}


def grouped(items: Iterable[_Item], key: Callable[[_Item], _Key]) -> dict[_Key, list[_Item]]:
    """Items by a key, keys in the order in which they come first."""
    groups: dict[_Key, list[_Item]] = {}
    for one in items:
        groups.setdefault(key(one), []).append(one)
    return groups


def number_text(value: float, digits: int = 3) -> str:
    """A number with so many decimals, or `-` for NaN."""
    return "-" if math.isnan(value) else f"{value:z.{digits}f}"


def p_text(p: float) -> str:
    """A p of three decimals, `<0.001` for a smaller one, or `-` for NaN."""
    return "<0.001" if p < 0.001 else number_text(p)


def range_text(one: score.SeedMean, digits: int = 3, sign: str = "") -> str:
    """`0.497 (0.422 to 0.570)`, a mean with its interval, or with its values, `0.497 (0.49, 0.50)`, if it has none."""
    if not one.seeds:
        return "-"
    mean = f"{one.mean:{sign}z.{digits}f}"
    if not math.isnan(one.low):
        return f"{mean} ({one.low:{sign}z.{digits}f} to {one.high:{sign}z.{digits}f})"
    values = ", ".join(f"{value:{sign}z.{min(digits, 2)}f}" for value in one.values)
    return mean if one.seeds == 1 else f"{mean} ({values})"


def over_seeds(measure: str, results: Iterable[Result], proportion: bool = False) -> score.SeedMean:
    """Mean of a measure over the seeds of a tracker's results."""
    values = list(by_seed((one.seed, one.number(measure)) for one in results).values())
    return (
        score.proportion_over_seeds(values) if proportion else score.mean_over_seeds(values, score.bounds_of(measure))
    )


def row_name(label: str, results: Iterable[Result]) -> str:
    """A tracker's name, marked where it ended with an error: frames after it count as 0 in its scores."""
    errors = sum(one.error is not None for one in results)
    return label if not errors else f"{label} ({errors} error{'s' if errors != 1 else ''})"


def place_of(result: Result) -> str:
    """`"corridor jitter=2"`; the base condition has the scenario's name alone."""
    name = result.condition.name
    return result.scenario if name == "base" else f"{result.scenario} {name}"


def summaries(
    frames: str, groups: Mapping[tuple[str, str], Sequence[score.Summary]], unit: str, *, wide: bool
) -> Table:
    """Means over seeds, or another `unit`, by (place, tracker), with the median time per frame.

    `frames` says which count; a `wide` table has more columns.
    """
    places = dict.fromkeys(place for place, _ in groups)
    counts = {len(found) for found in groups.values()}
    count = f" {min(counts)}" if len(counts) == 1 else ""
    where = f" in {next(iter(places))}" if len(places) == 1 and any(places) else ""
    beside = {"stay": "stay", "skill": "skill", "tracked\n>= 0.5": "success"}
    if wide:
        beside |= {"\n>= 0.3": "success_30", "centre\ninside": "centre_inside"}
        beside |= {"fixed\nsize": "fixed_size", "precision\n@ 20 px": "precision"}
    rows: list[list[str]] = []
    for (place, label), found in groups.items():
        mean = score.mean_summary(list(found))
        overlap = range_text(score.mean_over_seeds([one.mean_overlap for one in found], (0.0, 1.0)))
        cells = [overlap, *(number_text(getattr(mean, name)) for name in beside.values())]
        rows.append(
            [place, label, *([] if count else [str(len(found))]), *cells, _ms_text(found), number_text(mean.ms_max, 1)]
        )
    title = f"Over{count or ' all'} {unit}{'' if count == ' 1' else 's'}{where} ({frames})"
    heads = [*([] if count else [f"{unit}s"]), "mean\noverlap", *beside, "ms", "slowest\nframe"]
    if len(places) > 1:
        return Table(title, ["", "tracker"], heads, rows, score.DEFINITIONS, grouped=True)
    return Table(title, ["tracker"], heads, [row[1:] for row in rows], score.DEFINITIONS)


def _ms_text(found: Sequence[score.Summary]) -> str:
    """Median time per frame; with what the tracker's own process says where that is less."""
    took, reported = (
        np.median(known) if (known := [ms for ms in each if not math.isnan(ms)]) else math.nan
        for each in zip(*((one.ms_median, one.ms_reported) for one in found), strict=True)
    )
    differs = took - reported > max(_TRANSFER_MS, 0.2 * took)
    return number_text(float(took), 2) + (f" (said {reported:.2f})" if differs else "")


def following(results: Sequence[Result], columns: Mapping[str, str] = FOLLOWING) -> Iterator[Table]:
    """Measures of following by place and tracker; none for runs in open loop."""
    found = [
        [
            *(place, row_name(label, own), str(len(own))),
            *(range_text(over_seeds(f"follow_{name}", own, name in _PROPORTIONS), 2) for name in columns.values()),
        ]
        for (place, label), own in _by_place(one for one in results if one.following is not None).items()
    ]
    if found:
        notes = score.FOLLOWING_DEFINITIONS
        yield Table("Following", ["", "tracker+controller"], ["seeds", *columns], found, notes, grouped=True)


def causes(failed: Iterable[Failure]) -> Iterator[Table]:
    """How many drives of each tracker failed of each cause; none without one."""
    counts: dict[str, Counter[str]] = {}
    for one in failed:
        counts.setdefault(one.label, Counter())[one.cause] += 1
    heads = [cause for cause in CAUSES if any(cause in own for own in counts.values())]
    rows = [[label, str(own.total()), *(str(own[cause]) for cause in heads)] for label, own in counts.items()]
    if rows:
        notes = {cause: CAUSES[cause] for cause in heads}
        yield Table("Drives that failed, by cause", ["tracker+controller"], ["failed", *heads], rows, notes)


def people(results: Sequence[Result], heads: Sequence[str] = tuple(score.PEOPLE_DEFINITIONS)) -> Iterator[Table]:
    """Scores of everybody in view by place and tracker of several people; none without one."""
    found = [
        [
            *(place, row_name(label, own), str(len(own))),
            *(range_text(over_seeds(name.lower(), own), 1 if name == "switches" else 3) for name in heads),
        ]
        for (place, label), own in _by_place(one for one in results if not math.isnan(one.number("hota"))).items()
    ]
    if found:
        notes = {name: score.PEOPLE_DEFINITIONS[name] for name in heads}
        yield Table("Everybody in view", ["", "tracker"], ["seeds", *heads], found, notes, grouped=True)


def paper_tables(suite: Suite, results: Sequence[Result]) -> Iterator[Table]:
    """The tables of a suite's paper, each cell beside that of the results, with a row for each preset."""
    for table in suite.tables:
        digits = 2 if table.is_of_times else 1
        rows: list[list[str]] = []
        for row in compare_with_paper(table, results):
            ours = [*(number_text(one.mean, digits) for one in row.ours[:-1]), range_text(row.ours[-1], digits)]
            pairs = zip(row.printed, ours, strict=True)
            cells = [f"{number_text(printed, digits)} / {own}" for printed, own in pairs]
            rows.append([row.tracker, str(row.ours[-1].seeds), *cells])
        heads = [name.rpartition("/")[2] for name in table.columns]
        yield Table(f"{table.title}: printed / simulated", ["tracker"], ["seeds", *heads, "mean"], rows)


def claim_text(one: ClaimComparison) -> str:
    """`"ko2012 - ko2012-rgb +0.053 (+0.021 to +0.084), 20 seeds"`."""
    seeds = one.difference.seeds
    return f"{one.name} {range_text(one.difference, sign='+')}, {seeds} seed{'s' if seeds != 1 else ''}"


def axes(store: RunStore) -> Iterator[Table]:
    """Scores over every axis with at least two levels, on the same frames at each."""
    found = degradation(store).curves
    for measure, title in TITLES.items():
        for label, rows in grouped(table_rows(found, measure), lambda row: row.at.label).items():
            if measure == "recovered" and rows[0].at.axis.split()[-1] not in _COVERING:
                continue
            cells: list[list[str]] = []
            for tracker in rows[0].means:
                means = [row.means[tracker] for row in rows]
                if any(one.seeds for one in means):
                    cells.append([tracker, _counts(one.seeds for one in means), *map(range_text, means)])
            yield Table(f"{label}: {title}", ["tracker"], ["seeds", *(_level_text(row.at) for row in rows)], cells)


def _level_text(at: AxisLevel) -> str:
    """`"1.58 (level 1)"`, or the level alone where it is in the axis' own unit."""
    return f"{at.x:.3g}" if at.x == at.level else f"{at.x:.3g} (level {at.level:.3g})"


def _counts(counts: Iterable[int]) -> str:
    """`"4"`, or `"3 to 4"` where they differ."""
    known = sorted({*counts})
    return " to ".join(map(str, (known[0], known[-1])[: len(known)]))


def anchors(store: RunStore) -> Iterator[Table]:
    """Scores of runs from anchors by condition and tracker; none for others."""
    if (found := anchor_scores(store)) is None:
        return
    scores, (low, high) = found
    rows = [
        [
            *(condition, label, str(len(seeds))),
            *(
                range_text(score.mean_over_seeds([one[name] for one in seeds.values()], (0.0, 1.0)))
                for name in ("accuracy", "robustness", "eao")
            ),
        ]
        for (condition, label), seeds in scores.items()
    ]
    notes = {
        "accuracy": "mean overlap from an anchor to the failure, ten frames in a row of 0.1 or less",
        "robustness": "share of the frames before it",
        "EAO": f"expected average overlap over runs of {low} to {high - 1} frames, the middle half "
        "of the lengths of these runs: comparable within this run alone",
    }
    yield Table("From anchors, as in VOT 2020", ["", "tracker"], ["seeds", *notes], rows, notes, grouped=True)


def benchmark_table(found: Scored) -> Table | None:
    """For each tracker what the scorer of the data set's own benchmark computes; None where it has none."""
    if not found.benchmark:
        return None
    heads = list(next(iter(found.benchmark.values())))
    rows = [[tracker, *(score_text(values[name]) for name in heads)] for tracker, values in found.benchmark.items()]
    spaced = [name.replace("_", "\n", 1) for name in heads]
    return Table("As the benchmark's own scorer computes them", ("tracker",), spaced, rows)


def _by_place(results: Iterable[Result]) -> dict[tuple[str, str], list[Result]]:
    return grouped(results, lambda one: (place_of(one), one.label))
