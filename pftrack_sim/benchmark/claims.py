"""What a paper claims, put to the test: each claim holds, fails, or is undecided, with its interval over seeds.

The unit of repetition is the seed: a tracker's score at a seed is its mean over the claim's scenarios, and what is
compared is paired by seed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pftrack_sim import score
from pftrack_sim.benchmark.suite import Beats, Claim, Harder, Measure, Reaches, Suite
from pftrack_sim.core import random_streams

Verdict: TypeAlias = Literal["holds", "fails", "undecided"]


@dataclass(frozen=True)
class Part:
    """One comparison of a claim.

    Attributes:
        what: What is subtracted from what.
        difference: Mean over seeds.
        low: Lower end of its 95% interval.
        high: Upper end.
        verdict: `"holds"` when the whole interval is above 0, `"fails"` when it is below, else `"undecided"`.
        seeds: Number of seeds it rests on.
    """

    what: str
    difference: float
    low: float
    high: float
    verdict: Verdict
    seeds: int


@dataclass(frozen=True)
class Finding:
    """A claim and what became of it.

    Attributes:
        says: The claim in words.
        verdict: `"holds"` when every part does, `"fails"` when one does, else `"undecided"`.
        parts: Its comparisons.
    """

    says: str
    verdict: Verdict
    parts: tuple[Part, ...]


Row: TypeAlias = Mapping[str, Any]
"""One tracker's episode: `scenario`, `seed`, `tracker`, and the measures of `score.Summary`."""


def judge(suite: Suite, rows: Iterable[Row]) -> list[Finding]:
    """Put every claim of a suite to the test.

    Args:
        suite: The suite.
        rows: Its results; those of several axis levels are averaged.
    """
    table = _Table(rows)
    return [_judge(suite, claim, table) for claim in suite.claims]


def _judge(suite: Suite, claim: Claim, table: _Table) -> Finding:
    match claim:
        case Beats():
            where = claim.scenarios or suite.scenarios
            mine = table.by_seed(claim.tracker, where, claim.measure)
            pairs = [
                (f"{claim.tracker} - {other}", mine, table.by_seed(other, where, claim.measure))
                for other in claim.others
            ]
        case Harder():
            pairs = [
                (
                    f"{tracker}: easier - harder",
                    table.by_seed(tracker, claim.easier, claim.measure),
                    table.by_seed(tracker, claim.harder, claim.measure),
                )
                for tracker in claim.trackers
            ]
        case Reaches():
            mine = table.by_seed(claim.tracker, claim.scenarios or suite.scenarios, claim.measure)
            pairs = [(f"{claim.tracker} - {claim.value:g}", mine, dict.fromkeys(mine, claim.value))]
    parts = tuple(_part(what, one, other) for what, one, other in pairs)
    verdicts = {part.verdict for part in parts}
    verdict: Verdict = "fails" if "fails" in verdicts else "undecided" if "undecided" in verdicts else "holds"
    return Finding(claim.says, verdict, parts)


def _part(what: str, one: Mapping[int, float], other: Mapping[int, float]) -> Part:
    seeds = sorted(seed for seed in one.keys() & other.keys() if math.isfinite(one[seed] - other[seed]))
    gaps = np.array([one[seed] - other[seed] for seed in seeds])
    low, high = score.bootstrap_interval(gaps, random_streams.stream(0, "bootstrap", what))
    verdict: Verdict = "holds" if low > 0.0 else "fails" if high < 0.0 else "undecided"
    return Part(what, float(gaps.mean()) if gaps.size else math.nan, low, high, verdict, len(seeds))


class _Table:
    """Means of episodes, looked up by tracker, scenario and seed."""

    def __init__(self, rows: Iterable[Row]) -> None:
        self._rows: dict[tuple[str, str, int], list[Row]] = {}
        for row in rows:
            # A suite names its trackers; the preset, latency and controller that it runs them with make no other.
            tracker = re.sub(r"(\[preset=paper\])?(@[\d.e+-]+ms)?(\+[^+\]]+)?$", "", str(row["tracker"]))
            self._rows.setdefault((tracker, str(row["scenario"]), int(row["seed"])), []).append(row)

    def by_seed(self, tracker: str, scenarios: Sequence[str], measure: Measure) -> dict[int, float]:
        """A tracker's mean over the scenarios for each seed that has them all."""
        seeds = {seed for name, _, seed in self._rows if name == tracker}
        found: dict[int, float] = {}
        for seed in sorted(seeds):
            values = [self._mean(self._rows.get((tracker, scenario, seed), []), measure) for scenario in scenarios]
            if all(math.isfinite(value) for value in values):
                found[seed] = float(np.mean(values))
        return found

    @staticmethod
    def _mean(rows: Sequence[Row], measure: Measure) -> float:
        values: NDArray[np.float64] = np.array([row[measure] for row in rows], dtype=np.float64)
        return float(values.mean()) if values.size else math.nan


@dataclass(frozen=True)
class TableRow:
    """One tracker's row of a paper's table, and ours.

    Attributes:
        tracker: Name.
        printed: `(C,)` the paper's numbers.
        ours: `(C,)` our means over seeds, in the table's unit; NaN where there is nothing.
        low: `(C,)` lower ends of their 95% intervals.
        high: `(C,)` upper ends.
        ours_mean: Mean over the columns, with its interval over seeds.
    """

    tracker: str
    printed: tuple[float, ...]
    ours: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    ours_mean: tuple[float, float, float]


def beside_the_paper(suite: Suite, rows: Iterable[Row]) -> list[TableRow]:
    """The paper's table and ours, row by row; empty for a suite without a table.

    Args:
        suite: The suite.
        rows: Its results.
    """
    if suite.table is None:
        return []
    table, measure, scale = _Table(rows), suite.table.measure, suite.table.scale
    found: list[TableRow] = []
    for tracker, printed in suite.table.printed.items():
        cells = [
            _interval(tracker, table.by_seed(tracker, [scenario], measure), scale) for scenario in suite.table.columns
        ]
        means, lows, highs = zip(*cells, strict=True)
        overall = _interval(tracker, table.by_seed(tracker, suite.table.columns, measure), scale)
        found.append(TableRow(tracker, printed, means, lows, highs, overall))
    return found


def _interval(tracker: str, by_seed: Mapping[int, float], scale: float) -> tuple[float, float, float]:
    values = scale * np.array(list(by_seed.values()), dtype=np.float64)
    low, high = score.bootstrap_interval(values, random_streams.stream(0, "bootstrap", tracker))
    return (float(values.mean()) if values.size else math.nan), low, high
