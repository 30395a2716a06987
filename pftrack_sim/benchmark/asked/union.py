"""What a run folder asks for when more is asked for: the union of two plans, and where they contradict each other."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

from pftrack_sim.benchmark import keys
from pftrack_sim.benchmark.asked.from_names import code_of, seeds_text
from pftrack_sim.benchmark.asked.plan import Condition, Plan, ScenarioSpec, Sweep, make_checked_plan

_MOST_LINES = 8


def united(stored: Plan, asked: Plan, *, running: bool = False) -> Plan:
    """What is stored, and what is asked for besides; of the same name counts what is asked for.

    Where a scenario is asked for with settings that no stored condition of it has, all of its stored conditions get
    these settings, so that the levels of an axis differ in nothing else.

    Every tracker runs in every episode, so that a tracker that is added runs in those that were there too. Where the
    plan will be run, with `running`, trackers that are not asked for count with the code of today.

    Raises:
        ParameterError: They cannot be one plan: one is in open and the other in closed loop.
    """
    if asked.asked.keys() <= stored.asked.keys() and all(suite in stored.suites for suite in asked.suites):
        return stored
    cells: dict[tuple[str, str], tuple[ScenarioSpec, Condition, dict[int, None]]] = {}
    theirs, mine = _settings(stored), _settings(asked)
    changed = {
        name: next(iter(settings.values()))
        for name, settings in mine.items()
        if not settings.keys() & theirs.get(name, settings).keys()
    }
    specs = [changed.get((one.spec.name, one.condition.variant), one.spec) for one in stored.episodes()]
    specs += [one.spec for one in asked.episodes()]
    for spec, one in zip(specs, (*stored.episodes(), *asked.episodes()), strict=True):
        key = one.spec.name, one.condition.name
        seeds = cells[key][2] if key in cells else dict[int, None]()
        seeds[one.seed] = None
        cells[key] = spec, one.condition, seeds
    # Conditions of a scenario with the same seeds share a sweep: each holds the scenario's whole content.
    rows: dict[tuple[str, tuple[int, ...]], tuple[ScenarioSpec, list[Condition]]] = {}
    for spec, condition, seeds in cells.values():
        rows.setdefault((spec.name + spec.digest, tuple(seeds)), (spec, []))[1].append(condition)
    sweeps = tuple(
        Sweep(scenarios=(spec,), conditions=tuple(conditions), seeds=seeds)
        for (_, seeds), (spec, conditions) in rows.items()
    )
    today = {tracker.label: tracker for tracker in asked.trackers}
    trackers = [
        today.pop(one.label, None) or (one.model_copy(update={"code": code_of(one)}) if running else one)
        for one in stored.trackers
    ]
    suites = stored.suites + tuple(suite for suite in asked.suites if suite not in stored.suites)
    return make_checked_plan(sweeps, (*trackers, *today.values()), suites, asked.truth, asked.environment)


def _settings(plan: Plan) -> dict[tuple[str, str], dict[str, ScenarioSpec]]:
    """The settings of each scenario, by its name and variant, and by their digests."""
    found: dict[tuple[str, str], dict[str, ScenarioSpec]] = {}
    for sweep in plan.sweeps:
        for spec, condition in itertools.product(sweep.scenarios, sweep.conditions):
            found.setdefault((spec.name, condition.variant), {})[spec.digest] = spec
    return found


def contradictions(asked: Plan, stored: Plan) -> list[str]:
    """What has the same name in both and is not the same, one line each."""
    mine, theirs = _determinants(asked), _determinants(stored)
    for kind in ("scenarios", "conditions", "trackers"):
        for name in mine[kind].keys() ^ theirs[kind].keys():
            mine[kind].pop(name, None)
            theirs[kind].pop(name, None)
    return list(keys.differences(mine, theirs))


def listed(lines: Sequence[str]) -> str:
    """The first lines, indented, and how many more there are."""
    more = [f"and {len(lines) - _MOST_LINES} more"] if len(lines) > _MOST_LINES else []
    return "\n".join(f"  {line}" for line in [*lines[:_MOST_LINES], *more])


def _determinants(plan: Plan) -> dict[str, dict[str, Any]]:
    return {
        "scored": {"box": plan.truth},
        "scenarios": {
            " ".join(filter(None, (spec.name, condition.variant))): spec.tree
            for sweep in plan.sweeps
            for spec in sweep.scenarios
            for condition in sweep.conditions
        },
        "conditions": {name: dict(condition.levels) for name, condition in plan.conditions.items()},
        "trackers": {one.label: {"code": _beginnings(one.code)} for one in plan.trackers},
        "run with": _beginnings(plan.environment),
    }


def _beginnings(digests: keys.Environment) -> dict[str, str]:
    return {name: value[:12] for name, value in digests.items()}


def held_besides(stored: Plan, asked: Plan) -> str:
    """What a stored plan has that is not asked for: `"trackers ncc; seeds 3:8"`."""
    more = {
        "scenarios": ", ".join(name for name in stored.scenarios if name not in asked.scenarios),
        "conditions": ", ".join(name for name in stored.conditions if name not in asked.conditions),
        "trackers": ", ".join(label for label in stored.labels if label not in asked.labels),
        "seeds": seeds_text({one.seed for one in stored.episodes()} - {one.seed for one in asked.episodes()}),
    }
    return "; ".join(f"{kind} {names}" for kind, names in more.items() if names)
