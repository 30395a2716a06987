"""From what a person asks for to a plan."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, cast, get_args

from pftrack_sim import scenario as scenarios
from pftrack_sim.bench.plan import Batch, Condition, Contestant, Plan, ScoredBox, Stage, checked_plan
from pftrack_sim.bench.suite import Suite, is_suite, load_suite, suite_names
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


def join_plans(plans: Sequence[Plan], *, suites: tuple[Suite, ...] = (), truth: ScoredBox = "box") -> Plan:
    """One plan of several with the same trackers: what a suite of several blocks runs.

    Args:
        plans: Each with its own scenarios, conditions and seeds.
        suites: What they were made from, besides what they say themselves.
        truth: What estimates are compared with.

    Raises:
        ParameterError: Their trackers differ, or an episode is in two of them.
    """
    if len({plan.labels for plan in plans}) != 1:
        raise ParameterError("plans can be joined only if they have the same trackers, in the same order")
    made_from = tuple(one for plan in plans for one in plan.suites) + suites
    batches = tuple(batch for plan in plans for batch in plan.batches)
    return checked_plan(batches, plans[0].trackers, made_from, truth)


TRACKERS = ("ko2012", "opencv-mil", "stay")
SEEDS = (0, 1, 2)
"""What scenarios are run with when nothing else is said."""


def plan_all(
    names: Sequence[str],
    *,
    trackers: Sequence[str | Contestant] | None = None,
    seeds: Sequence[int] | None = None,
    axes: Mapping[str, Sequence[float]] | None = None,
    overrides: Mapping[str, Any] | None = None,
    preset: str | None = None,
    truth: str = "box",
) -> Plan:
    """The plan of suites and scenarios together.

    Args:
        names: Suites and scenarios, by name or path.
        trackers: Of everything; a suite's own, and `TRACKERS` for scenarios, if None.
        seeds: Of everything; a suite's own, and `SEEDS` for scenarios, if None.
        axes: Swept in everything.
        overrides: Dotted keys set in every scenario.
        preset: Of every tracker; a suite's own, and `"default"` for scenarios, if None.
        truth: What estimates are compared with: `"box"`, `"amodal_box"` or `"visible_box"`.

    Raises:
        UnknownNameError: An unknown suite, scenario, axis, parameter of an axis, or box.
        ScenarioError: A wrong suite, scenario, override or level.
        ParameterError: Nothing to run, something given twice, or suites with different trackers.
    """
    if truth not in get_args(ScoredBox):
        raise UnknownNameError("box of the truth", truth, get_args(ScoredBox))
    suites = [load_suite(name) for name in names if is_suite(name)]
    alone = [name for name in names if not is_suite(name)]
    plans = [
        plan_suite(suite, trackers=trackers, seeds=seeds, axes=axes, overrides=overrides, preset=preset)
        for suite in suites
    ]
    if alone or not plans:
        unknown = [name for name in alone if name not in scenarios.names() and not name.endswith(".toml")]
        if unknown:
            raise UnknownNameError("suite or scenario", unknown[0], [*suite_names(), *scenarios.names()])
        plans.append(
            make_plan(
                alone,
                trackers if trackers is not None else TRACKERS,
                seeds if seeds is not None else SEEDS,
                axes=axes,
                overrides=overrides,
                preset=preset or "default",
            )
        )
    return join_plans(plans, truth=cast("ScoredBox", truth))


def plan_suite(
    suite: Suite,
    *,
    trackers: Sequence[str | Contestant] | None = None,
    seeds: Sequence[int] | None = None,
    axes: Mapping[str, Sequence[float]] | None = None,
    overrides: Mapping[str, Any] | None = None,
    preset: str | None = None,
) -> Plan:
    """The plan of a suite.

    Args:
        suite: The suite.
        trackers: Instead of its own; its table and claims then speak of those among them.
        seeds: Instead of its own.
        axes: Swept on top of its own; one that the suite sweeps too is replaced.
        overrides: Dotted keys set in every scenario, after its own.
        preset: Instead of its own.

    Raises:
        UnknownNameError: An unknown scenario, axis or parameter of an axis.
        ScenarioError: A wrong scenario, override or level.
        ParameterError: An episode or tracker given twice.
    """
    chosen = preset if preset is not None else suite.preset
    plans = [
        make_plan(
            block.scenarios,
            trackers if trackers is not None else suite.trackers,
            seeds if seeds is not None else parse_seeds(suite.seeds),
            axes={**block.axes, **(axes or {})},
            overrides={**block.changes, **(overrides or {})},
            preset=chosen,
        )
        for block in suite.run
    ]
    return join_plans(plans, suites=(suite,))


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
