"""Test the claims of a suite on the results of a run: each holds, fails, or is undecided.

The unit of repetition is the seed: a tracker's score at a seed is its mean over the claim's scenarios, and comparisons
are paired by seed. All comparisons of a suite are corrected together: where none of its differences exists, at most
one suite in twenty has a claim that holds or fails.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pftrack_sim import score
from pftrack_sim.benchmark.asked.suite import Beats, Claim, Harder, Reaches, Suite
from pftrack_sim.benchmark.reading.summary import Result
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
    """A claim after the test."""

    statement: str
    comparisons: tuple[ClaimComparison, ...]

    @property
    def verdict(self) -> str:
        """`"holds"` when every comparison does, `"fails"` when one does, else what the first undecided one says."""
        verdicts = [one.verdict for one in self.comparisons]
        if "fails" in verdicts:
            return "fails"
        return next((one for one in verdicts if one != "holds"), "holds")


def evaluate_claims(suite: Suite, results: Iterable[Result]) -> list[ClaimResult]:
    """Test every claim of a suite on results; those of several axis levels are averaged."""
    means = _SeedMeans(results)
    tested = [_differences(suite, claim, means) for claim in suite.claims]
    corrected = iter(score.corrected([difference for one in tested for difference in one.values()]))
    return [
        ClaimResult(claim.statement, tuple(ClaimComparison(name, next(corrected)) for name in one))
        for claim, one in zip(suite.claims, tested, strict=True)
    ]


def _differences(suite: Suite, claim: Claim, means: _SeedMeans) -> dict[str, SeedMean]:
    match claim:
        case Beats():
            where = claim.scenarios or suite.scenarios
            own = means.by_seed(claim.tracker, where, claim.measure)
            return {
                f"{claim.tracker} - {other}": _paired(own, means.by_seed(other, where, claim.measure))
                for other in claim.others
            }
        case Harder():
            return {
                f"{tracker}: easier - harder": _paired(
                    means.by_seed(tracker, claim.easier, claim.measure),
                    means.by_seed(tracker, claim.harder, claim.measure),
                )
                for tracker in claim.trackers
            }
        case Reaches():
            own = means.by_seed(claim.tracker, claim.scenarios or suite.scenarios, claim.measure)
            return {f"{claim.tracker} - {claim.value:g}": _reached(list(own.values()), claim.value)}


def _paired(first: Mapping[int, float], second: Mapping[int, float]) -> SeedMean:
    seeds = sorted(first.keys() & second.keys())
    return score.paired_difference([first[seed] for seed in seeds], [second[seed] for seed in seeds])


def _reached(values: Sequence[float], value: float) -> SeedMean:
    if set(values) <= {0.0, 1.0}:
        return score.proportion_over_seeds(values, value)
    return score.mean_over_seeds(np.array(values) - value)


class _SeedMeans:
    """Scores by tracker, scenario and seed."""

    def __init__(self, results: Iterable[Result]) -> None:
        self._results: dict[tuple[str, str, int], list[Result]] = {}
        for result in results:
            # Suites name trackers without parameters; preset, latency and controller do not distinguish them.
            if not result.tracker.params:
                key = (result.tracker.name, result.scenario, result.seed)
                self._results.setdefault(key, []).append(result)

    def by_seed(self, tracker: str, scenarios: Sequence[str], measure: str) -> dict[int, float]:
        """A tracker's mean over the scenarios for each seed that has them all."""
        seeds = sorted({seed for name, _, seed in self._results if name == tracker})
        means: dict[int, float] = {}
        for seed in seeds:
            values = [self._mean(self._results.get((tracker, scenario, seed), []), measure) for scenario in scenarios]
            if all(math.isfinite(value) for value in values):
                means[seed] = float(np.mean(values))
        return means

    @staticmethod
    def _mean(results: Sequence[Result], measure: str) -> float:
        return float(np.mean([result.number(measure) for result in results])) if results else math.nan


@dataclass(frozen=True)
class PaperTableRow:
    """One tracker's row of a paper's table with the results of a run.

    Attributes:
        tracker: Name.
        printed: `(C + 1,)` the paper's numbers and their mean.
        ours: `(C + 1,)` the same of the run, in the table's unit.
    """

    tracker: str
    printed: tuple[float, ...]
    ours: tuple[SeedMean, ...]


def compare_with_paper(suite: Suite, results: Iterable[Result]) -> list[PaperTableRow]:
    """The paper's table beside the results, row by row, then `REFERENCES`; empty for a suite without a table."""
    if suite.table is None:
        return []
    means, measure, scale = _SeedMeans(results), suite.table.measure, suite.table.scale
    columns = [*((name,) for name in suite.table.columns), suite.table.columns]

    def row(name: str, tracker: str, printed: tuple[float, ...], measure: str) -> PaperTableRow:
        by_column = [means.by_seed(tracker, names, measure).values() for names in columns]
        ours = tuple(score.mean_over_seeds([scale * value for value in values]) for values in by_column)
        return PaperTableRow(name, (*printed, sum(printed) / len(printed)), ours)

    rows = [row(tracker, tracker, printed, measure) for tracker, printed in suite.table.printed.items()]
    if rows and measure in ("mean_overlap", "success"):
        # They depend on the frames only, which all trackers share in open loop.
        unknown = (math.nan,) * len(suite.table.columns)
        rows += [row(name, rows[0].tracker, unknown, name) for name in REFERENCES]
    return rows
