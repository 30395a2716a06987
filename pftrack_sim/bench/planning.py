"""From what a person asks for to a plan."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pftrack_sim import scenario as scenarios
from pftrack_sim.bench.plan import Batch, Condition, Contestant, Plan, Stage, checked_plan
from pftrack_sim.errors import ParameterError, UnknownNameError
from pftrack_sim.scenario import ScenarioLike
from pftrack_sim.scenario.axes import axes_by_name


def make_plan(
    names: Sequence[ScenarioLike],
    trackers: Sequence[str | Contestant],
    seeds: Sequence[int],
    *,
    axes: Mapping[str, Sequence[float]] | None = None,
    overrides: Mapping[str, Any] | None = None,
    preset: str = "default",
) -> Plan:
    """The plan of all combinations.

    Args:
        names: Scenarios.
        trackers: Names for `trackers.make`, or contestants with their parameters.
        seeds: Root seeds.
        axes: For a stress axis its severities, and for `axis.parameter` the parameter's values at severity 1.
        overrides: Dotted keys set in every scenario.
        preset: Preset of every tracker given by its name alone.

    Raises:
        UnknownNameError: An unknown scenario, axis or parameter of an axis.
        ScenarioError: A wrong scenario, override or level.
        ParameterError: No scenario, tracker or seed, or one given twice.
    """
    for axis in axes or {}:
        _check_axis(axis)
    loaded = [scenarios.load(name, overrides or {}) for name in names]
    conditions = tuple(_conditions(axes or {}))
    batch = Batch(
        scenarios=tuple(Stage(name=one.name, tree=one.tree) for one in loaded),
        conditions=conditions,
        seeds=tuple(seeds),
    )
    contestants = tuple(one if isinstance(one, Contestant) else Contestant(name=one, preset=preset) for one in trackers)
    plan = checked_plan((batch,), contestants)
    for scenario in loaded:
        for condition in conditions:
            scenarios.load(scenario, condition.overrides)
    return plan


def join_plans(plans: Sequence[Plan]) -> Plan:
    """One plan of several with the same trackers: what a suite of several blocks runs.

    Raises:
        ParameterError: Their trackers differ, or an episode is in two of them.
    """
    if len({plan.labels for plan in plans}) != 1:
        raise ParameterError("plans can be joined only if they have the same trackers, in the same order")
    return checked_plan(tuple(batch for plan in plans for batch in plan.batches), plans[0].trackers)


def _check_axis(axis: str) -> None:
    name, dot, parameter = axis.partition(".")
    known = axes_by_name()
    if name not in known:
        raise UnknownNameError("axis", name, known)
    if dot and parameter not in known[name].model_fields:
        raise UnknownNameError(f"parameter of the axis {name}", parameter, known[name].model_fields)


def _conditions(axes: Mapping[str, Sequence[float]]) -> Iterator[Condition]:
    for levels in itertools.product(*axes.values()):
        yield Condition(levels=tuple(zip(axes, (float(level) for level in levels), strict=True)))


def parse_seeds(text: str) -> list[int]:
    """Seeds as the command line writes them: `3`, `0:20` (20 excluded), `1,5,9`, and mixtures.

    Raises:
        ParameterError: Not seeds.

    >>> parse_seeds("0:3,7")
    [0, 1, 2, 7]
    """
    seeds: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d+)\s*(?::\s*(\d+)\s*)?", part)
        if not match or (match[2] is not None and int(match[2]) <= int(match[1])):
            raise ParameterError(f"seeds are written 3, 0:20 (20 excluded) or 1,5,9; got {text!r}")
        seeds += range(int(match[1]), int(match[2])) if match[2] is not None else [int(match[1])]
    return seeds
