"""Test the claims of a suite on the results of a run: each holds, fails, or is undecided, with each preset by itself.

The unit of repetition is the seed: a tracker's score at a seed is its mean over the claim's scenarios, and comparisons
are paired by seed. All comparisons of a suite are corrected together: where none of its differences exists, at most
one suite in twenty has a claim that holds or fails.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pftrack_sim import score
from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.benchmark.asked.suite import Beats, Claim, Harder, KeepsPace, PaperTable, Reaches, Suite
from pftrack_sim.benchmark.reading.summary import Result, paired_by_seed
from pftrack_sim.score import SeedMean

REFERENCES = ("stay", "fixed_size")
"""Rows below the trackers of a paper's table of overlaps or of frames tracked; see `score.DEFINITIONS`."""

_VERDICTS = {"above": "holds", "below": "fails"}


@dataclass(frozen=True)
class ClaimComparison:
    """A part of a claim: a difference over seeds, its p-value corrected for all comparisons of the suite."""

    name: str
    difference: SeedMean

    @property
    def verdict(self) -> str:
        """`"holds"` where the difference is above 0, `"fails"` below, `"undecided"`, or `"needs 10 seeds"`."""
        return _VERDICTS.get(self.difference.verdict, self.difference.verdict)


@dataclass(frozen=True)
class ClaimResult:
    """A claim after the test on the trackers with one preset."""

    statement: str
    preset: str
    comparisons: tuple[ClaimComparison, ...]

    @property
    def verdict(self) -> str:
        """`"holds"` when every comparison does, `"fails"` when one does, else what the first undecided one says."""
        verdicts = [one.verdict for one in self.comparisons]
        if "fails" in verdicts:
            return "fails"
        return next((one for one in verdicts if one != "holds"), "holds")


def evaluate_claims(suite: Suite, results: Iterable[Result]) -> list[ClaimResult]:
    """Test every claim of a suite on results, with every preset that they have; several axis levels are averaged."""
    means = _SeedMeans(results)
    asked = [(claim, preset) for claim in suite.claims for preset in means.presets]
    tested = [_differences(suite, claim, preset, means) for claim, preset in asked]
    corrected = iter(score.corrected([difference for one in tested for difference in one.values()]))
    return [
        ClaimResult(claim.statement, preset, tuple(ClaimComparison(name, next(corrected)) for name in one))
        for (claim, preset), one in zip(asked, tested, strict=True)
    ]


def _differences(suite: Suite, claim: Claim, preset: str, means: _SeedMeans) -> dict[str, SeedMean]:
    def scores(tracker: str, scenarios: Sequence[str], measure: str = claim.measure) -> dict[int, float]:
        return means.by_seed((tracker, preset), scenarios or suite.scenarios, measure, claim.compared)

    match claim:
        case Beats():
            own = scores(claim.tracker, claim.scenarios)
            return {
                f"{claim.tracker} - {other}": paired_by_seed(own, scores(other, claim.scenarios))
                for other in claim.others
            }
        case Harder():
            return {
                f"{tracker}: easier - harder": paired_by_seed(
                    scores(tracker, claim.easier), scores(tracker, claim.harder)
                )
                for tracker in claim.trackers
            }
        case Reaches():
            own = scores(claim.tracker, claim.scenarios)
            return {f"{claim.tracker} - {claim.value:g}": _reached(list(own.values()), claim.value)}
        case KeepsPace():
            own = scores(claim.tracker, claim.scenarios, "frames_per_second")
            return {
                f"{claim.tracker} / {other} - {claim.share:g}": score.mean_over_seeds(
                    np.array(list(_ratios(own, scores(other, claim.scenarios, "frames_per_second")).values()))
                    - claim.share
                )
                for other in claim.others
            }


def _ratios(first: Mapping[int, float], second: Mapping[int, float]) -> dict[int, float]:
    return {seed: first[seed] / second[seed] for seed in sorted(first.keys() & second.keys())}


def _reached(values: Sequence[float], value: float) -> SeedMean:
    if set(values) <= {0.0, 1.0}:
        return score.proportion_over_seeds(values, value)
    return score.mean_over_seeds(np.array(values) - value, (-value, 1.0 - value))


class _SeedMeans:
    """Scores by tracker with its preset, scenario and seed."""

    def __init__(self, results: Iterable[Result]) -> None:
        self._results: dict[tuple[str, str, str, int], list[Result]] = {}
        for result in results:
            # Suites name trackers without parameters; latency and controller do not distinguish them.
            if not result.tracker.params:
                key = (result.tracker.name, result.tracker.preset, result.scenario, result.seed)
                self._results.setdefault(key, []).append(result)
        self.presets = tuple(dict.fromkeys(preset for _, preset, _, _ in self._results)) or ("default",)

    def by_seed(
        self,
        tracker: tuple[str, str],
        scenarios: Sequence[str],
        measure: str,
        compared: Collection[str],
        weights: Sequence[float] = (),
    ) -> dict[int, float]:
        """Mean over the scenarios of a tracker, its name and preset, for each seed that has them all.

        Only those conditions and controllers count that every compared tracker with results at the seed has.
        """
        seeds = sorted({seed for *own, _, seed in self._results if tuple(own) == tracker})
        means: dict[int, float] = {}
        for seed in seeds:
            values = [self._mean(self._shared(tracker, compared, name, seed), measure) for name in scenarios]
            if all(math.isfinite(value) for value in values):
                means[seed] = float(np.average(values, weights=weights or None))
        return means

    def _shared(self, tracker: tuple[str, str], compared: Iterable[str], scenario: str, seed: int) -> list[Result]:
        there = [self._results.get((name, tracker[1], scenario, seed), []) for name in compared]
        cells = [{_cell(one) for one in own} for own in there if own]
        own = self._results.get((*tracker, scenario, seed), [])
        return [one for one in own if all(_cell(one) in others for others in cells)]

    @staticmethod
    def _mean(results: Sequence[Result], measure: str) -> float:
        if not results:
            return math.nan
        is_time = measure in ("ms_per_frame", "frames_per_second")
        mean = float(np.mean([result.number("ms_median" if is_time else measure) for result in results]))
        return 1000.0 / mean if measure == "frames_per_second" else mean


def _cell(result: Result) -> tuple[str, str | None]:
    return result.condition.name, result.tracker.controller


@dataclass(frozen=True)
class PaperTableRow:
    """One tracker's row of a paper's table with the results of a run.

    Attributes:
        tracker: Label: its name, with its preset where that is not `default`.
        printed: `(C + 1,)` the paper's numbers and their mean; times over those of the first row.
        ours: `(C + 1,)` the same of the run, in the table's unit.
    """

    tracker: str
    printed: tuple[float, ...]
    ours: tuple[SeedMean, ...]


def compare_with_paper(table: PaperTable, results: Iterable[Result]) -> list[PaperTableRow]:
    """A paper's table beside the results: a row for each tracker and preset, then `REFERENCES` of overlaps."""
    means = _SeedMeans(results)
    first, *_ = table.printed
    rows: list[PaperTableRow] = []
    for name, numbers in table.printed.items():
        for preset in means.presets:
            by_column = _columns(table, means, (name, preset), table.measure)
            printed = _printed(table, numbers)
            if table.is_of_times:
                base = _columns(table, means, (first, preset), table.measure)
                by_column = [_ratios(own, other) for own, other in zip(by_column, base, strict=True)]
                printed = [
                    one / other for one, other in zip(printed, _printed(table, table.printed[first]), strict=True)
                ]
            label = TrackerSpec(name=name, preset=preset).label
            rows.append(_row(label, printed, by_column, table))
    if rows and table.measure in ("mean_overlap", "success"):
        # They depend on the frames only, which all trackers share in open loop.
        unknown = [math.nan] * (len(table.columns) + 1)
        shared = (first, means.presets[0])
        rows += [_row(name, unknown, _columns(table, means, shared, name), table) for name in REFERENCES]
    return rows


def _columns(table: PaperTable, means: _SeedMeans, tracker: tuple[str, str], measure: str) -> list[Mapping[int, float]]:
    """Scores by seed in each column, and their mean over all."""
    alone = [means.by_seed(tracker, (name,), measure, table.printed) for name in table.columns]
    return [*alone, means.by_seed(tracker, table.columns, measure, table.printed, table.weights)]


def _printed(table: PaperTable, numbers: Sequence[float]) -> list[float]:
    """The printed numbers of the columns and their mean; a number alone is the mean."""
    if len(numbers) < len(table.columns):
        return [*[math.nan] * len(table.columns), *numbers]
    return [*numbers, float(np.average(numbers, weights=table.weights or None))]


def _row(
    label: str, printed: Sequence[float], by_column: Sequence[Mapping[int, float]], table: PaperTable
) -> PaperTableRow:
    scale = 1.0 if table.is_of_times else table.scale
    low, high = (scale * end for end in score.bounds_of(table.measure))
    ours = tuple(score.mean_over_seeds([scale * one for one in own.values()], (low, high)) for own in by_column)
    return PaperTableRow(label, tuple(printed), ours)
