"""Compare two trackers episode by episode: of one run, or of two runs with the same scenarios and seeds.

The unit of repetition is the seed, and differences are paired: both trackers of a pair saw the same episode.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias, get_args

import numpy as np
import scipy  # it imports its packages at first use
from numpy.typing import ArrayLike

from pftrack_sim import score
from pftrack_sim.benchmark.asked.suite import Measure
from pftrack_sim.benchmark.reading.losses import overlaps_by_tag
from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.benchmark.reading.summary import Result
from pftrack_sim.core.errors import ParameterError, RunError, UnknownNameError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.score import SeedMean

MEASURES: tuple[str, ...] = get_args(Measure)

_POWER = 0.8
_EpisodeKey: TypeAlias = tuple[str, str, int]


@dataclass(frozen=True)
class Difference:
    """Mean paired difference (second - first) over seeds, of one condition or of all.

    Attributes:
        scenario: Name; `"all"` for the mean over all conditions, each with the same weight.
        condition: Name; empty for all.
        first: Mean score of the first tracker.
        second: Mean score of the second.
        difference: Over the seeds that both have; its p-value is corrected for all conditions, or for all tags.
    """

    scenario: str
    condition: str
    first: float
    second: float
    difference: SeedMean

    @property
    def verdict(self) -> str:
        """`"better"`, `"worse"` or `"undecided"`, or `"needs 10 seeds"`."""
        found = self.difference.verdict
        return {"above": "better", "below": "worse"}.get(found, found)

    def seeds_for(self, difference: float) -> int | None:
        """Seeds that show a difference of this size with a power of 80 %; None where the spread is unknown.

        Of the normal approximation, n = ((z_0.975 + z_0.8) sd / difference)^2, and never fewer than a verdict needs.
        """
        if math.isnan(self.difference.spread):
            return None
        quantiles = float(scipy.stats.norm.ppf(1.0 - 0.5 * score.LEVEL) + scipy.stats.norm.ppf(_POWER))
        return max(math.ceil((quantiles * self.difference.spread / difference) ** 2), score.LEAST_FOR_VERDICT)


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
        found = row.difference
        seeds = f"{found.seeds} seed{'s' if found.seeds != 1 else ''}"
        if row.verdict in ("better", "worse"):
            low, high = (found.low, found.high) if row.verdict == "better" else (-found.high, -found.low)
            size = f"{abs(found.mean):.3f} ({low:.3f} to {high:.3f})"
            return f"{second} is {row.verdict} than {first} by {size}, {seeds}"
        known = "" if math.isnan(found.low) else f" ({found.low:+.3f} to {found.high:+.3f})"
        size = "unknown" if math.isnan(found.mean) else f"{found.mean:+.3f}{known}"
        if found.seeds < score.LEAST_FOR_VERDICT:
            least = score.LEAST_FOR_VERDICT
            return f"{seeds} cannot show a difference between {second} and {first}, {least} are needed: {size}"
        return f"{second} and {first} cannot be told apart: {size}, {seeds}"


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
    return {one.key[:3]: one for one in run.results if one.label == label}


def _rows(pairs: Sequence[EpisodeDifference], measure: str) -> list[Difference]:
    groups: dict[tuple[str, str], dict[int, tuple[float, float]]] = {}
    for pair in pairs:
        scores = pair.first.number(measure), pair.second.number(measure)
        group = groups.setdefault((pair.first.scenario, pair.first.condition.name), {})
        if math.isfinite(sum(scores)):
            group[pair.first.seed] = scores
    bounds = score.bounds_of(measure)
    rows = _differences({names: list(group.values()) for names, group in groups.items()}, bounds)
    if len(groups) > 1:
        # A seed counts where every condition has it; otherwise conditions with more seeds would weigh more.
        shared = set[int].intersection(*(set(group) for group in groups.values()))
        means = [np.mean([group[seed] for group in groups.values()], axis=0) for seed in sorted(shared)]
        rows += _differences({("all", ""): means}, bounds)
    return rows


def _tag_rows(runs: Sequence[RunStore], names: Sequence[str]) -> list[Difference]:
    one, other = (overlaps_by_tag(run, name) for run, name in zip(runs, names, strict=True))
    found: dict[tuple[str, str], list[FloatArray]] = {}
    for tag, overlaps in one.items():
        by_seed: dict[int, list[tuple[float, float]]] = {}
        for key in sorted(overlaps.keys() & other[tag].keys()):
            by_seed.setdefault(key[2], []).append((overlaps[key], other[tag][key]))
        if by_seed:
            found["all", tag] = [np.mean(by_seed[seed], axis=0) for seed in sorted(by_seed)]
    return _differences(found, (0.0, 1.0))


def _differences(
    scores: Mapping[tuple[str, str], Sequence[ArrayLike]], bounds: tuple[float, float]
) -> list[Difference]:
    """Differences by scenario and condition of pairs of scores, one for each seed, corrected for their number."""
    pairs = {names: np.array(own, dtype=np.float64).reshape(-1, 2) for names, own in scores.items()}
    differences = score.corrected([score.paired_difference(both[:, 1], both[:, 0], bounds) for both in pairs.values()])
    means = [both.mean(axis=0).tolist() if len(both) else [math.nan, math.nan] for both in pairs.values()]
    return [
        Difference(*names, first, second, difference)
        for names, (first, second), difference in zip(pairs, means, differences, strict=True)
    ]
