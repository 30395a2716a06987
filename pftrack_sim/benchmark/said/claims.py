"""Test the claims of a suite on the results of a run: each holds, fails, or is undecided.

The unit of repetition is the seed: a tracker's score at a seed is its mean over the claim's scenarios, and comparisons
are paired by seed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from pftrack_sim import score
from pftrack_sim.benchmark.asked.suite import Beats, Claim, Harder, Reaches, Suite
from pftrack_sim.benchmark.reading.summary import Result
from pftrack_sim.core import random_streams

Verdict: TypeAlias = Literal["holds", "fails", "undecided"]

Interval: TypeAlias = tuple[float, float, float]
"""Mean, lower and upper end of its 95 % bootstrap interval."""

REFERENCES = ("stay", "ceiling")
"""Rows below the trackers of a paper's table of overlaps or of frames tracked; see `score.DEFINITIONS`."""


@dataclass(frozen=True)
class ClaimComparison:
    """The mean of a paired difference over seeds, with its 95 % interval.

    The verdict is `"holds"` when the whole interval is above 0, `"fails"` when it is below, else `"undecided"`.
    """

    name: str
    difference: float
    low: float
    high: float
    verdict: Verdict
    seeds: int


@dataclass(frozen=True)
class ClaimResult:
    """A claim after the test: it holds when every comparison does, and fails when one does."""

    statement: str
    verdict: Verdict
    comparisons: tuple[ClaimComparison, ...]


def evaluate_claims(suite: Suite, results: Iterable[Result]) -> list[ClaimResult]:
    """Test every claim of a suite on results; those of several axis levels are averaged."""
    means = _SeedMeans(results)
    return [_test(suite, claim, means) for claim in suite.claims]


def _test(suite: Suite, claim: Claim, means: _SeedMeans) -> ClaimResult:
    match claim:
        case Beats():
            where = claim.scenarios or suite.scenarios
            own = means.by_seed(claim.tracker, where, claim.measure)
            pairs = [
                (f"{claim.tracker} - {other}", own, means.by_seed(other, where, claim.measure))
                for other in claim.others
            ]
        case Harder():
            pairs = [
                (
                    f"{tracker}: easier - harder",
                    means.by_seed(tracker, claim.easier, claim.measure),
                    means.by_seed(tracker, claim.harder, claim.measure),
                )
                for tracker in claim.trackers
            ]
        case Reaches():
            own = means.by_seed(claim.tracker, claim.scenarios or suite.scenarios, claim.measure)
            pairs = [(f"{claim.tracker} - {claim.value:g}", own, dict.fromkeys(own, claim.value))]
    comparisons = tuple(_compare(*pair) for pair in pairs)
    verdicts = {one.verdict for one in comparisons}
    verdict: Verdict = "fails" if "fails" in verdicts else "undecided" if "undecided" in verdicts else "holds"
    return ClaimResult(claim.statement, verdict, comparisons)


def _compare(name: str, first: Mapping[int, float], second: Mapping[int, float]) -> ClaimComparison:
    seeds = sorted(first.keys() & second.keys())
    differences = [first[seed] - second[seed] for seed in seeds if math.isfinite(first[seed] - second[seed])]
    mean, low, high = _interval(name, differences)
    verdict: Verdict = "holds" if low > 0.0 else "fails" if high < 0.0 else "undecided"
    return ClaimComparison(name, mean, low, high, verdict, len(differences))


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
        ours: `(C + 1,)` the same of the run, in the table's unit, over seeds; NaN where there is no result.
    """

    tracker: str
    printed: tuple[float, ...]
    ours: tuple[Interval, ...]


def compare_with_paper(suite: Suite, results: Iterable[Result]) -> list[PaperTableRow]:
    """The paper's table beside the results, row by row, then `REFERENCES`; empty for a suite without a table."""
    if suite.table is None:
        return []
    means, measure, scale = _SeedMeans(results), suite.table.measure, suite.table.scale
    columns = [*((name,) for name in suite.table.columns), suite.table.columns]

    def row(name: str, tracker: str, printed: tuple[float, ...], measure: str) -> PaperTableRow:
        by_column = [means.by_seed(tracker, names, measure).values() for names in columns]
        ours = tuple(_interval(name, [scale * value for value in values]) for values in by_column)
        return PaperTableRow(name, (*printed, sum(printed) / len(printed)), ours)

    rows = [row(tracker, tracker, printed, measure) for tracker, printed in suite.table.printed.items()]
    if rows and measure in ("mean_overlap", "success"):
        # They depend on the frames only, which all trackers share in open loop.
        unknown = (math.nan,) * len(suite.table.columns)
        rows += [row(name, rows[0].tracker, unknown, name) for name in REFERENCES]
    return rows


def _interval(stream: str, values: Sequence[float]) -> Interval:
    low, high = score.bootstrap_interval(values, random_streams.stream(0, "bootstrap", stream))
    return (float(np.mean(values)) if values else math.nan), low, high
