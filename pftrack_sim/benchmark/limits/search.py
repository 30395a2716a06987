"""The search for breaking points: a run that grows by the episodes that are expected to say most.

One search is an axis in a scenario. It goes on in batches: their levels follow from the outcomes of the batches before,
and each episode has the next seed, so that the outcomes at all levels are independent. All trackers run in all of its
episodes, which pairs them by seed. A run that was stopped is resumed by going through the same batches again.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pftrack_sim.benchmark.asked.plan import Condition, Plan, ScenarioSpec, Sweep, make_checked_plan
from pftrack_sim.benchmark.limits.found import Difference, Example, Limit, Limits, Tried, Verdict, write_limits
from pftrack_sim.benchmark.limits.psychometric import (
    LEVEL,
    Psychometric,
    Threshold,
    next_levels,
    outcome_correlation,
    posterior,
    psychometric,
    rise_p_value,
    threshold,
    thresholds_drawn,
)
from pftrack_sim.benchmark.limits.scale import MIXES, Range, Scale, make_scale, mixed
from pftrack_sim.benchmark.limits.success import Outcomes, Success
from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.benchmark.reading.summary import Result
from pftrack_sim.benchmark.running.run import run
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.random_streams import stream
from pftrack_sim.core.types import FloatArray

BATCH = 8
"""Episodes of a search that are chosen together, whatever the number of workers."""

LEAST_EPISODES = 3 * BATCH
"""Episodes of a search before it may stop."""

_RISES = 0.05  # p-value below which a success rate counts as rising somewhere


@dataclass(frozen=True)
class Wanted:
    """What is sought, and when it is enough.

    Attributes:
        axes: Ranges by axis, in its unit; None: its whole range.
        at: Success rate at the breaking point.
        width: Length of the interval at which a search stops, as a share of the breaking point.
        budget: Episodes of each search at most.
        joint: Whether the two axes are sought together, too, in three mixes.
    """

    axes: Mapping[str, Range | None]
    success: Success
    at: float = 0.5
    width: float = 0.1
    budget: int = 200
    joint: bool = False

    def __post_init__(self) -> None:
        if not self.axes:
            raise ParameterError("name what is to break it, for example --axis jitter")
        if self.joint and len(self.axes) != 2:
            raise ParameterError(f"--joint takes two axes, got {len(self.axes)}: --axis jitter --axis noise --joint")
        if not 0.0 < self.width < math.inf:
            raise ParameterError(f"the width must be above 0 %, got {100 * self.width:g} %")
        if self.budget < LEAST_EPISODES:
            raise ParameterError(f"a search takes {LEAST_EPISODES} episodes or more, got a budget of {self.budget}")


@dataclass(eq=False)
class Search:
    """The search for the breaking points of all trackers on one axis of one scenario.

    Attributes:
        seeds: Of its episodes, in this order.
        trials: Index of the level and seed of every episode that was chosen.
    """

    spec: ScenarioSpec
    scale: Scale
    labels: Sequence[str]
    seeds: Sequence[int]
    wanted: Wanted
    trials: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])

    @cached_property
    def grid(self) -> Psychometric:
        """The grid of the thresholds."""
        return psychometric(self.scale.coordinates, self.wanted.at)

    def next_batch(self, outcomes: Outcomes) -> list[tuple[int, int]]:
        """Choose the next episodes from the outcomes of the ones before; none where the search has ended."""
        counts = self._counts(outcomes)
        open_ = [place for place, own in enumerate(counts) if self._enough(own) is None]
        left = min(BATCH, self.wanted.budget - len(self.trials), len(self.seeds) - len(self.trials))
        if not open_ or left < 1:
            return []
        first = len(self.trials)
        chosen = next_levels(self.grid, counts[open_], left, first // BATCH).tolist()
        self.trials += zip(chosen, self.seeds[first : first + left], strict=True)
        return self.trials[first:]

    def limits(self, outcomes: Outcomes) -> list[Limit]:
        """What is known of every tracker."""
        counts = self._counts(outcomes)
        return [self._limit(label, own, outcomes) for label, own in zip(self.labels, counts, strict=True)]

    def differences(self, outcomes: Outcomes, limits: Sequence[Limit]) -> list[Difference]:
        """Differences between all trackers that break within the range, as their `limits` tell."""
        breaking = {one.tracker for one in limits if one.low is not None and one.high is not None}
        return [
            self._difference(*pair, outcomes) for pair in itertools.combinations(self.labels, 2) if breaking >= {*pair}
        ]

    def _answers(self, outcomes: Outcomes, label: str) -> FloatArray:
        """`(N,)` 1 for a success, 0 for a failure, NaN where there could be none, in the order of the trials."""
        name = self.spec.name
        answers = [outcomes.get((name, self.scale.condition(level).name, seed, label)) for level, seed in self.trials]
        return np.array([math.nan if one is None else float(one) for one in answers])

    def _counts(self, outcomes: Outcomes) -> FloatArray:
        """`(K, L, 2)` successes and failures of every tracker at every level."""
        counts = np.zeros((len(self.labels), len(self.scale.levels), 2))
        levels = np.array([level for level, _ in self.trials], dtype=np.int64)
        for own, label in zip(counts, self.labels, strict=True):
            answers = self._answers(outcomes, label)
            np.add.at(own[:, 0], levels, answers == 1.0)
            np.add.at(own[:, 1], levels, answers == 0.0)
        return counts

    def _enough(self, counts: FloatArray) -> str | None:
        """Why a tracker needs no more episodes; None while it does."""
        if len(self.trials) < LEAST_EPISODES:
            return None
        found = threshold(self.grid, counts)
        if _outside(found):
            return "certain enough"
        low, middle, high = (self.scale.level(one) for one in (found.low, found.coordinate, found.high))
        if low > 0.0 and high < math.inf and high - low <= self.wanted.width * middle:
            return f"interval of {100 * (high - low) / middle:.0f} %"
        return None

    def _nearest(self, outcomes: Outcomes, label: str, point: float, *, held: bool) -> Example | None:
        """The success nearest below a level, or the failure nearest above it."""
        answers = self._answers(outcomes, label)
        sides = [(self.scale.levels[level] - point) * (-1.0 if held else 1.0) for level, _ in self.trials]
        near = [place for place, side in enumerate(sides) if side >= 0.0 and answers[place] == float(held)]
        if not near:
            return None
        level, seed = self.trials[min(near, key=lambda place: sides[place])]
        return Example(level=float(self.scale.levels[level]), condition=self.scale.condition(level).name, seed=seed)

    def _limit(self, label: str, counts: FloatArray, outcomes: Outcomes) -> Limit:
        found = threshold(self.grid, counts)
        p = rise_p_value(counts, stream(0, "monotone", self.spec.name, self.scale.axis, label))
        breaks = math.isfinite(found.low) or math.isfinite(found.high)
        verdict = "not monotone" if p < _RISES else _outside(found) or ("breaks" if breaks else "undecided")
        spent = "seeds used up" if len(self.trials) == len(self.seeds) else "budget used up"
        inside = verdict == "breaks"
        rates = np.einsum("ltn,tn->l", self.grid.rates, posterior(self.grid, counts))
        levels = [float(one) for one in self.scale.levels]
        point = self.scale.level(found.coordinate)

        def ending(coordinate: float) -> float | None:
            return self.scale.level(coordinate) if inside and math.isfinite(coordinate) else None

        return Limit(
            scenario=self.spec.name,
            axis=self.scale.axis,
            unit=self.scale.unit,
            range=(levels[1], levels[-1]),
            typical=self.scale.typical,
            tracker=label,
            verdict=verdict,
            breaking_point=ending(found.coordinate),
            low=ending(found.low),
            high=ending(found.high),
            monotone_p=p,
            episodes=len(self.trials),
            stopped=self._enough(counts) or spent,
            tried=tuple(
                Tried(level=level, successes=int(good), episodes=int(good + bad))
                for level, (good, bad) in zip(levels, counts, strict=True)
                if good + bad
            ),
            curve=tuple(zip(levels, rates.tolist(), strict=True)),
            held=self._nearest(outcomes, label, point, held=True) if inside else None,
            failed=self._nearest(outcomes, label, point, held=False) if inside else None,
            mix=self.scale.mix,
        )

    def _difference(self, first: str, second: str, outcomes: Outcomes) -> Difference:
        places = [self.labels.index(one) for one in (first, second)]
        counts = self._counts(outcomes)[places]
        answers = np.stack([self._answers(outcomes, one) for one in (first, second)])
        levels = np.array([level for level, _ in self.trials])
        correlation = outcome_correlation(self.grid, counts, levels, answers)
        drawn = thresholds_drawn(self.grid, counts, correlation, stream(0, "difference", first, second))
        values = np.vectorize(self.scale.level)(drawn)
        low, middle, high = np.quantile(values[0] - values[1], [0.5 * (1 - LEVEL), 0.5, 0.5 * (1 + LEVEL)])
        return Difference(
            scenario=self.spec.name,
            axis=self.scale.axis,
            unit=self.scale.unit,
            first=first,
            second=second,
            difference=float(middle),
            low=float(low),
            high=float(high),
            correlation=correlation,
        )


def _outside(found: Threshold) -> Verdict | None:
    """The verdict on a threshold that lies outside the range with a probability of 97.5 %."""
    sure = 0.5 * (1.0 + LEVEL)
    if found.above >= sure:
        return "never breaks within the range"
    if found.broken + found.below < sure:
        return None
    return "broken from the start" if found.broken > found.below else "breaks below the lowest level"


def make_searches(plan: Plan, wanted: Wanted) -> list[Search]:
    """A search for every scenario of a plan and every axis, over the seeds of the plan.

    Raises:
        UnknownNameError: No such axis.
        ParameterError: A range or rate that cannot be sought.
        ScenarioError: An axis has no effect in a scenario.
    """
    seeds = list(dict.fromkeys(one.seed for one in plan.episodes()))
    searches: list[Search] = []
    for spec in plan.scenarios.values():
        scales = [make_scale(spec, axis, span, seeds[0]) for axis, span in wanted.axes.items()]
        if wanted.joint:
            first, second = scales
            scales += [mixed(first, second, shares) for shares in MIXES]
        searches += [Search(spec, scale, plan.labels, seeds, wanted) for scale in scales]
    return searches


def first_plan(plan: Plan, searches: Sequence[Search]) -> Plan:
    """What is run first: the plan of the first batches."""
    return _plan_of(plan, [(one, one.next_batch({})) for one in searches])


def find_limits(plan: Plan, searches: Sequence[Search], path: Path, **options: Any) -> Limits:
    """Run searches until each has ended, and write `limits.json` into the run folder.

    Args:
        plan: Of `first_plan`, from the same searches.
        searches: Their first batches are in the plan.
        path: The run folder.
        options: For `run`.

    Raises:
        As `run`.
    """
    success = searches[0].wanted.success

    def more(store: RunStore) -> Plan | None:
        outcomes = success.outcomes(store)
        batches = [(one, batch) for one in searches if (batch := one.next_batch(outcomes))]
        return _plan_of(plan, batches) if batches else None

    outcomes = success.outcomes(run(plan, path, videos="none", more=more, **options))
    limits = [one.limits(outcomes) for one in searches]
    found = Limits(
        success=success.text,
        at=searches[0].wanted.at,
        limits=tuple(itertools.chain(*limits)),
        differences=tuple(
            pair for one, own in zip(searches, limits, strict=True) for pair in one.differences(outcomes, own)
        ),
    )
    write_limits(path, found)
    return found


def examples(store: RunStore, found: Limits) -> list[Result]:
    """The results next to every breaking point, of those below and those above it."""
    results = {one.key: one for one in store.results}
    near = [(limit, one) for limit in found.limits for one in (limit.held, limit.failed) if one is not None]
    return [results[limit.scenario, one.condition, one.seed, limit.tracker] for limit, one in near]


def _plan_of(plan: Plan, batches: Sequence[tuple[Search, Sequence[tuple[int, int]]]]) -> Plan:
    seeds: dict[tuple[str, Condition], dict[int, ScenarioSpec]] = {}  # Axes that rise together share the level 0
    for search, batch in batches:
        for level, seed in batch:
            seeds.setdefault((search.spec.name, search.scale.condition(level)), {})[seed] = search.spec
    sweeps = [
        Sweep(scenarios=(next(iter(own.values())),), conditions=(condition,), seeds=tuple(own))
        for (_, condition), own in seeds.items()
    ]
    return make_checked_plan(tuple(sweeps), plan.trackers, truth=plan.truth, environment=plan.environment)
