"""Degradation over a stress axis: mean overlaps on the same frames at every level.

A cover, a lost frame or a target that leaves the view removes frames. Of each scenario and seed only those times count
at which the target can be seen at every level of the axis, after its event (`Axis.compared_from_s`). Axes that were
swept together share the frames of all their combinations.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Literal, TypeAlias, TypeVar

import numpy as np

from pftrack_sim import score
from pftrack_sim.benchmark.asked.plan import RUN_AXES, Condition, Episode
from pftrack_sim.benchmark.keys import digest
from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.benchmark.reading.summary import Result, by_seed
from pftrack_sim.scenario.axes import axes_by_name

Measure: TypeAlias = Literal["overlap", "recovered"]
_Key = TypeVar("_Key", bound=tuple[Any, ...])
_Grid: TypeAlias = "list[tuple[tuple[AxisLevel, ...], Condition]]"

STAY = "stay"
"""Label of the first box in every frame, beside the trackers."""


@dataclass(frozen=True)
class AxisLevel:
    """A level of one axis.

    Attributes:
        axis: Name of the series: the axis, with the variant before it.
        level: Severity, or value of a parameter.
        x: The level in the axis' own unit.
        label: Name and unit of the axis.
    """

    axis: str
    level: float
    x: float
    label: str


@dataclass(frozen=True)
class Degradation:
    """One tracker's scores at one level of an axis.

    Attributes:
        tracker: Label of the tracker, or `STAY`.
        overlap: Mean overlap on the frames that all levels share.
        recovered: Share of the occlusions after which the target is tracked again within 2 s; NaN without one.
    """

    at: AxisLevel
    tracker: str
    scenario: str
    seed: int
    overlap: float
    recovered: float


@dataclass(frozen=True)
class Crossing:
    """One tracker's mean overlap at a level of each of two axes that were swept together.

    Attributes:
        first: Level of one axis.
        second: Level of the other.
        tracker: Label of the tracker, or `STAY`.
        overlap: Mean overlap on the frames that all combinations share, over the levels of further axes.
    """

    first: AxisLevel
    second: AxisLevel
    tracker: str
    scenario: str
    seed: int
    overlap: float


@dataclass(frozen=True)
class Degradations:
    """Scores over the axes of a run.

    Attributes:
        curves: Over each axis with at least two levels, in the plan's order; of an axis that was swept together with
            others the means over the others' levels.
        maps: Over each pair of axes that were swept together.
    """

    curves: tuple[Degradation, ...]
    maps: tuple[Crossing, ...]


@dataclass(frozen=True)
class TableRow:
    """A level of an axis with the mean of every tracker, by label."""

    at: AxisLevel
    means: Mapping[str, score.SeedMean]


TITLES: Mapping[Measure, str] = {
    "overlap": "overlap on the frames in which the target is seen at every level, after the axis' event",
    "recovered": "share of occlusions after which the target is tracked again within 2 s",
}
"""Titles of `table_rows` by measure."""


def levels_of(condition: Condition) -> tuple[AxisLevel, ...]:
    """The levels of a condition in the axes' own units."""
    return tuple(_level(name, level, condition.variant) for name, level in condition.levels)


def _level(name: str, level: float, variant: str) -> AxisLevel:
    axis, _, parameter = name.partition(".")
    if name in RUN_AXES:
        return AxisLevel(name, level, level, f"{name} [{RUN_AXES[name][0]}]")
    if parameter:
        return AxisLevel(name, level, level, name)
    known = axes_by_name()[axis]
    named = f"{axis} ({variant})" if variant else axis
    series = f"{variant} {axis}" if variant else axis
    return AxisLevel(series, level, level * known(severity=1.0).physical, f"{named} [{known.unit}]")


def degradation(store: RunStore) -> Degradations:
    """Scores over the axes of a run.

    A condition whose severities are all 0 is level 0 of every axis of the same scenario that was swept alone.

    Raises:
        RunError: A file is missing, broken, or outside the run folder.
    """
    results: dict[tuple[str, int], dict[Condition, list[Result]]] = {}
    for result in store.results:
        conditions = results.setdefault((result.scenario, result.seed), {})
        conditions.setdefault(result.condition, []).append(result)
    firsts: dict[str, dict[Condition, Episode]] = {}
    for episode in store.plan.first_episodes:
        firsts.setdefault(episode.spec.name, {})[episode.condition] = episode
    grids = {scenario: _grids(episodes) for scenario, episodes in firsts.items()}
    curves: list[Degradation] = []
    maps: list[Crossing] = []
    for (scenario, seed), conditions in results.items():
        read: dict[Condition, dict[str, score.Arm]] = {}
        for grid in grids[scenario]:
            shown = {condition: at for at, condition in grid if condition in conditions}
            levels = list(shown.values())
            swept = [axis for axis in range(len(grid[0][0])) if len({at[axis] for at in levels}) > 1]
            # Means over a grid with gaps would compare different combinations.
            if not swept or (len(grid[0][0]) > 1 and len(shown) < len(grid)):
                continue
            read |= {one: _arms(store, conditions[one]) for one in shown if one not in read}
            from_s = max(_compared_from_s(firsts[scenario][one], seed) for one in shown)
            arms = [read[condition] for condition in shown]
            for label in (name for name in arms[0] if all(name in arm for arm in arms)):
                overlaps = score.overlaps_on_common_frames([arm[label] for arm in arms], from_s)
                recovered = [
                    next((one.number("recovered_2s") for one in conditions[condition] if one.label == label), math.nan)
                    for condition in shown
                ]
                for axis in swept:
                    keys = [(at[axis],) for at in levels]
                    others = [levels[0][other].axis for other in swept if other != axis]
                    scores = zip(_means(keys, overlaps), _means(keys, recovered), strict=True)
                    curves += [
                        Degradation(_marginal(at, others), label, scenario, seed, overlap, share)
                        for ((at,), overlap), (_, share) in scores
                    ]
                for one, other in combinations(swept, 2):
                    cells = _means([(at[one], at[other]) for at in levels], overlaps)
                    maps += [Crossing(*pair, label, scenario, seed, overlap) for pair, overlap in cells]
    return Degradations(tuple(curves), tuple(maps))


def _means(keys: Sequence[_Key], values: Iterable[float]) -> list[tuple[_Key, float]]:
    """The mean of the known values of each key, NaN where there is none."""
    grouped: dict[_Key, list[float]] = {key: [] for key in keys}
    for key, value in zip(keys, values, strict=True):
        if not math.isnan(value):
            grouped[key].append(float(value))
    return [(key, float(np.mean(known)) if known else math.nan) for key, known in grouped.items()]


def _marginal(at: AxisLevel, others: Sequence[str]) -> AxisLevel:
    if not others:
        return at
    names = " and ".join(others)
    return replace(at, axis=f"{at.axis} over {names}", label=f"{at.label}, mean over {names}")


def mean_degradation(found: Iterable[Degradation], measure: Measure) -> score.SeedMean:
    """Mean over the seeds of means over scenarios."""
    by = by_seed((one.seed, float(getattr(one, measure))) for one in found)
    return score.mean_over_seeds(list(by.values()), score.bounds_of(measure))


def table_rows(found: Sequence[Degradation], measure: Measure) -> list[TableRow]:
    """Means over seeds by axis and level, with a column for each tracker; rows without any number are left out."""
    trackers = list(dict.fromkeys(one.tracker for one in found))
    rows: list[TableRow] = []
    for at in dict.fromkeys(one.at for one in found):
        own = [[one for one in found if one.at == at and one.tracker == name] for name in trackers]
        means = [mean_degradation(one, measure) for one in own]
        if any(one.seeds for one in means):
            rows.append(TableRow(at, dict(zip(trackers, means, strict=True))))
    return rows


def _grids(episodes: Mapping[Condition, Episode]) -> list[_Grid]:
    """Levels of every axis of a scenario, rising, with level 0 from another axis where an axis has none.

    Axes that were swept together are one grid of all their combinations. Conditions with other settings of the
    scenario, which a suite may hold, are another grid.
    """
    found: dict[tuple[str, ...], _Grid] = {}
    for condition, episode in episodes.items():
        if (at := levels_of(condition)) and not episode.backward:  # its frames have other numbers
            scene = digest(_beside(episode, condition), _own(episode))
            found.setdefault((*(one.axis for one in at), scene), []).append((at, condition))
    bases = [one for one in episodes if not any(level or "." in axis for axis, level in one.levels)]
    for grid in found.values():
        (first, *others), like = grid[0]
        equal = [
            base
            for base in bases
            if _beside(episodes[base], like) == _beside(episodes[like], like)
            and not any(_severity(episodes[base], name) for name in _axes(like))
        ]
        # A parameter has no level that changes nothing.
        if equal and not others and "." not in like.levels[0][0] and all(at.level for (at,), _ in grid):
            grid.append(((replace(first, level=0.0, x=0.0),), equal[0]))
        grid.sort(key=lambda pair: [at.level for at in pair[0]])
    return list(found.values())


def _axes(condition: Condition) -> set[str]:
    """Axes that have a level, or one of whose parameters has."""
    return {name.partition(".")[0] for name, _ in condition.levels}


def _severity(episode: Episode, name: str) -> Any:
    """Severity of an axis in an episode; None of one of the run."""
    own = episode.spec.tree["axes"].get(name, {}).get("severity")
    return episode.condition.overrides.get(f"axes.{name}.severity", own)


def _own(episode: Episode) -> dict[str, Any]:
    """Parameters of the axes of an episode's condition, without those that its levels set."""
    settings = {
        f"axes.{name}.{key}": value
        for name in _axes(episode.condition)
        for key, value in episode.spec.tree["axes"].get(name, {}).items()
    }
    return {key: value for key, value in settings.items() if key not in episode.condition.overrides}


def _beside(episode: Episode, swept: Condition) -> dict[str, Any]:
    """A scenario without the swept axes, and without those at severity 0, whose parameters change nothing."""
    left_out, tree = _axes(swept), episode.spec.tree
    on = {name: own for name, own in tree["axes"].items() if name not in left_out and _severity(episode, name)}
    return {**tree, "axes": on}


def _compared_from_s(episode: Episode, seed: int) -> float:
    axes = {name.partition(".")[0] for name, level in episode.condition.levels if level and name not in RUN_AXES}
    settings = episode.scenario.resolve(seed) if axes else None
    return max((getattr(settings.axes, name).compared_from_s for name in axes if settings), default=0.0)


def _arms(store: RunStore, results: Sequence[Result]) -> dict[str, score.Arm]:
    """The frames of every tracker in the episodes of one condition, and of the first box where all share the frames."""
    found: dict[str, score.Arm] = {}
    box = store.plan.truth
    for result in results:
        table = store.frame_columns(result, ("time_s", "overlap", "scored", box))
        time_s, overlap = (np.asarray(table[name], dtype=np.float64) for name in ("time_s", "overlap"))
        counted = score.counted_frames(table["scored"])
        found[result.label] = score.Arm(time_s, overlap, counted)
        if store.plan.kind == "open" and STAY not in store.plan.labels and STAY not in found:
            truth = np.array([[math.nan] * 4 if one is None else list(one) for one in table[box]])
            found[STAY] = score.Arm(time_s, score.stay_overlaps(truth, table["scored"]), counted)
    return found
