"""Compare two trackers episode by episode: of one run, or of two runs with the same scenarios and seeds.

The unit of repetition is the seed, and differences are paired: both trackers of a pair saw the same episode.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias, get_args

import numpy as np
import scipy  # it imports its packages at first use

from pftrack_sim import score
from pftrack_sim.benchmark.asked.suite import Measure
from pftrack_sim.benchmark.reading.losses import overlaps_by_tag
from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.benchmark.reading.summary import Result
from pftrack_sim.core import random_streams
from pftrack_sim.core.errors import ParameterError, RunError, UnknownNameError
from pftrack_sim.core.types import FloatArray

MEASURES: tuple[str, ...] = get_args(Measure)
LEVEL = 0.05
"""A difference counts as shown when its p-value is below this."""

_POWER = 0.8
_EpisodeKey: TypeAlias = tuple[str, str, int]


@dataclass(frozen=True)
class Difference:
    """Mean paired difference (second - first) over seeds, of one condition or of all.

    Attributes:
        scenario: Name; `"all"` for the mean over all conditions, each with the same weight.
        condition: Name; empty for all.
        seeds: Number of seeds that both have.
        first: Mean score of the first tracker.
        second: Mean score of the second.
        difference: Mean of second - first.
        low: Lower end of the 95 % bootstrap interval of the difference; NaN for one seed.
        high: Upper end.
        p: Two-sided p-value of the sign-flip test.
        least_p: Smallest p-value that this number of seeds can give, 2 / 2^n.
        spread: Standard deviation of the differences between seeds; NaN for one seed.
    """

    scenario: str
    condition: str
    seeds: int
    first: float
    second: float
    difference: float
    low: float
    high: float
    p: float
    least_p: float
    spread: float

    @property
    def verdict(self) -> str:
        """`"better"`, `"worse"` or `"undecided"`; `"too few seeds"` where no difference could be shown."""
        if self.least_p >= LEVEL:
            return "too few seeds"
        return "undecided" if not self.p < LEVEL else "better" if self.difference > 0.0 else "worse"

    def seeds_for(self, difference: float) -> int | None:
        """Seeds that show a difference of this size with a power of 80 %; None where the spread is unknown.

        Of the normal approximation, n = ((z_0.975 + z_0.8) sd / difference)^2, and never fewer than the sign-flip
        test needs.
        """
        if math.isnan(self.spread):
            return None
        quantiles = float(scipy.stats.norm.ppf(1.0 - 0.5 * LEVEL) + scipy.stats.norm.ppf(_POWER))
        return max(math.ceil((quantiles * self.spread / difference) ** 2), math.ceil(math.log2(2.0 / LEVEL)))


@dataclass(frozen=True)
class EpisodeDifference:
    """The two results of one episode."""

    first: Result
    second: Result
    difference: float


@dataclass(frozen=True)
class RunComparison:
    """Two trackers compared.

    Attributes:
        names: Labels of both.
        titles: The same, with the folder of the run where one label stands for both.
        measure: Column of the summary that is compared.
        rows: One for each scenario and condition, and one for all where there are several.
        tags: One for each thing that happens to the target (`losses.TAGS`, as the row's condition), of the mean overlap
            on the frames around it; empty for other measures.
        episodes: Every pair, the greatest loss of the second first.
        different_frames: Pairs whose frames were not the same to the bit: only their distributions are comparable.
        unpaired: Episodes that only one of the two has.
    """

    names: tuple[str, str]
    titles: tuple[str, str]
    measure: str
    rows: tuple[Difference, ...]
    tags: tuple[Difference, ...]
    episodes: tuple[EpisodeDifference, ...]
    different_frames: int
    unpaired: int

    @property
    def statement(self) -> str:
        """The result over all conditions in a sentence: `"v2 is better than v1 by 0.030 (0.010 to 0.050), 9 seeds"`."""
        row, (first, second) = self.rows[-1], self.titles
        seeds = f"{row.seeds} seed{'s' if row.seeds != 1 else ''}"
        if row.verdict in ("better", "worse"):
            low, high = (row.low, row.high) if row.verdict == "better" else (-row.high, -row.low)
            size = f"{abs(row.difference):.3f} ({low:.3f} to {high:.3f})"
            return f"{second} is {row.verdict} than {first} by {size}, {seeds}"
        interval = f"{row.difference:+.3f} ({row.low:+.3f} to {row.high:+.3f})"
        if row.verdict == "too few seeds":
            return f"{seeds} cannot show a difference between {second} and {first}: {interval}"
        return f"{second} and {first} cannot be told apart: {interval}, {seeds}"


def compare_runs(
    first: RunStore, second: RunStore, trackers: Sequence[str] = (), *, measure: str = "mean_overlap"
) -> RunComparison:
    """Compare a tracker of the first run with one of the second, which may be the same run.

    Args:
        first: The run that the differences are taken from.
        second: The other one.
        trackers: Labels: one that both runs have, or one of each run. None are needed where both runs have exactly one
            in common, or where one run has exactly two.
        measure: One of `MEASURES`.

    Raises:
        UnknownNameError: No such tracker, or no such measure.
        ParameterError: Not one or two trackers, or it is ambiguous which.
        RunError: A run cannot be read, or the two have no episode in common.
    """
    if measure not in MEASURES:
        raise UnknownNameError("measure", measure, MEASURES)
    names = _chosen(first, second, trackers)
    one, other = _by_episode(first, names[0]), _by_episode(second, names[1])
    common = [key for key in one if key in other]
    if not common:
        raise RunError(f"{first.path} and {second.path} have no scenario, condition and seed in common")
    pairs = [
        EpisodeDifference(one[key], other[key], other[key].number(measure) - one[key].number(measure)) for key in common
    ]
    return RunComparison(
        names,
        names if names[0] != names[1] else (f"{names[0]} in {first.path.name}", f"{names[1]} in {second.path.name}"),
        measure,
        tuple(_rows(pairs, measure)),
        tuple(_tag_rows((first, second), names)) if measure == "mean_overlap" else (),
        tuple(sorted(pairs, key=lambda pair: math.inf if math.isnan(pair.difference) else pair.difference)),
        sum(pair.first.values["frames_digest"] != pair.second.values["frames_digest"] for pair in pairs),
        len(one) + len(other) - 2 * len(common),
    )


def _chosen(first: RunStore, second: RunStore, trackers: Sequence[str]) -> tuple[str, str]:
    known = [list(dict.fromkeys(one.label for one in run.results)) for run in (first, second)]
    same_run = first.path.resolve() == second.path.resolve()
    if not trackers:
        common = known[0] if same_run else [name for name in known[0] if name in known[1]]
        if len(common) != (2 if same_run else 1):
            listed = ", ".join(known[0]) if same_run else f"{', '.join(known[0])} and {', '.join(known[1])}"
            raise ParameterError(f"say which trackers to compare with --trackers A,B (there are {listed})")
        trackers = common
    if len(trackers) > 2 or (same_run and len(set(trackers)) != 2):
        raise ParameterError(f"a comparison takes two trackers, got {', '.join(trackers)}")
    names = trackers[0], trackers[-1]
    for name, labels in zip(names, known, strict=True):
        if name not in labels:
            raise UnknownNameError("tracker of the run", name, labels)
    return names


def _by_episode(run: RunStore, label: str) -> dict[_EpisodeKey, Result]:
    return {(one.scenario, one.condition.name, one.seed): one for one in run.results if one.label == label}


def _rows(pairs: Sequence[EpisodeDifference], measure: str) -> list[Difference]:
    groups: dict[tuple[str, str], dict[int, tuple[float, float]]] = {}
    for pair in pairs:
        scores = pair.first.number(measure), pair.second.number(measure)
        group = groups.setdefault((pair.first.scenario, pair.first.condition.name), {})
        if math.isfinite(sum(scores)):
            group[pair.first.seed] = scores
    rows = [_difference(*names, group) for names, group in groups.items()]
    if len(groups) > 1:
        # A seed counts where every condition has it; otherwise conditions with more seeds would weigh more.
        shared = set[int].intersection(*(set(group) for group in groups.values()))
        means: dict[int, tuple[float, float]] = {}
        for seed in sorted(shared):
            one, other = np.mean([group[seed] for group in groups.values()], axis=0).tolist()
            means[seed] = one, other
        rows.append(_difference("all", "", means))
    return rows


def _tag_rows(runs: Sequence[RunStore], names: Sequence[str]) -> Iterator[Difference]:
    one, other = (overlaps_by_tag(run, name) for run, name in zip(runs, names, strict=True))
    for tag, overlaps in one.items():
        by_seed: dict[int, list[tuple[float, float]]] = {}
        for key in overlaps.keys() & other[tag].keys():
            by_seed.setdefault(key[2], []).append((overlaps[key], other[tag][key]))
        means: dict[int, tuple[float, float]] = {}
        for seed, pairs in sorted(by_seed.items()):
            mean, other_mean = np.mean(pairs, axis=0).tolist()
            means[seed] = mean, other_mean
        if means:
            yield _difference("all", tag, means)


def _difference(scenario: str, condition: str, scores: Mapping[int, tuple[float, float]]) -> Difference:
    both: FloatArray = np.array(list(scores.values()), dtype=np.float64).reshape(-1, 2)
    rng = random_streams.stream(0, "statistics", scenario, condition)
    mean, (low, high), p = score.paired_difference(both[:, 1], both[:, 0], rng)
    first, second = (both.mean(axis=0) if len(both) else np.full(2, math.nan)).tolist()
    spread = float(np.std(both[:, 1] - both[:, 0], ddof=1)) if len(both) > 1 else math.nan
    least_p = min(1.0, 2.0 ** (1 - len(both)))
    return Difference(scenario, condition, len(both), first, second, mean, low, high, p, least_p, spread)
