"""What a run folder asks for when more is asked for: the union of two plans, and where they contradict each other."""

from __future__ import annotations

from typing import Any

from pftrack_sim.benchmark import keys
from pftrack_sim.benchmark.asked.from_names import code_of, seeds_text
from pftrack_sim.benchmark.asked.plan import Condition, Plan, ScenarioSpec, Sweep, make_checked_plan

_MOST_LINES = 8


def united(stored: Plan, asked: Plan, *, running: bool = False) -> Plan:
    """What is stored, and what is asked for besides; of the same name counts what is asked for.

    Every tracker runs in every episode, so that a tracker that is added runs in those that were there too.

    Args:
        stored: The one plan.
        asked: The other.
        running: Whether it will be run: trackers that are not asked for count with the code of today.

    Raises:
        ParameterError: They cannot be one plan: one is in open and the other in closed loop.
    """
    if asked.asked.keys() <= stored.asked.keys() and all(suite in stored.suites for suite in asked.suites):
        return stored
    cells: dict[tuple[str, str], tuple[ScenarioSpec, Condition, dict[int, None]]] = {}
    for one in (*stored.episodes(), *asked.episodes()):
        key = one.spec.name, one.condition.name
        seeds = cells[key][2] if key in cells else dict[int, None]()
        seeds[one.seed] = None
        cells[key] = one.spec, one.condition, seeds
    # As few sweeps as possible: conditions with the same seeds share one, and scenarios with the same of both.
    rows: dict[tuple[str, str, tuple[int, ...]], tuple[ScenarioSpec, list[Condition]]] = {}
    for spec, condition, seeds in cells.values():
        rows.setdefault((spec.name, spec.digest, tuple(seeds)), (spec, []))[1].append(condition)
    grids: dict[tuple[tuple[Condition, ...], tuple[int, ...]], list[ScenarioSpec]] = {}
    for (_, _, known), (spec, conditions) in rows.items():
        grids.setdefault((tuple(conditions), known), []).append(spec)
    sweeps = tuple(
        Sweep(scenarios=tuple(specs), conditions=conditions, seeds=known)
        for (conditions, known), specs in grids.items()
    )
    today = {tracker.label: tracker for tracker in asked.trackers}
    trackers = [
        today.pop(one.label, None) or (one.model_copy(update={"code": code_of(one)}) if running else one)
        for one in stored.trackers
    ]
    suites = stored.suites + tuple(suite for suite in asked.suites if suite not in stored.suites)
    return make_checked_plan(sweeps, (*trackers, *today.values()), suites, asked.truth, asked.environment)


def contradictions(asked: Plan, stored: Plan) -> list[str]:
    """What has the same name in both and is not the same, one line each."""
    mine, theirs = _determinants(asked), _determinants(stored)
    for kind in ("scenarios", "conditions", "trackers"):
        both = mine[kind].keys() & theirs[kind].keys()
        for one in (mine, theirs):
            one[kind] = {name: value for name, value in one[kind].items() if name in both}
    lines = list(keys.differences(mine, theirs))
    return lines[:_MOST_LINES] + ([f"and {len(lines) - _MOST_LINES} more"] if len(lines) > _MOST_LINES else [])


def _determinants(plan: Plan) -> dict[str, dict[str, Any]]:
    def levels(condition: Condition) -> str:
        return ", ".join(f"{axis}={level!r}" for axis, level in condition.levels)

    return {
        "scored": {"box": plan.truth},
        "scenarios": {
            " ".join(filter(None, (spec.name, condition.variant))): spec.tree
            for sweep in plan.sweeps
            for spec in sweep.scenarios
            for condition in sweep.conditions
        },
        "conditions": {name: levels(condition) for name, condition in plan.conditions.items()},
        "trackers": {
            one.label: {"code": {name: value[:12] for name, value in one.code.items()}} for one in plan.trackers
        },
        "run with": {name: value[:12] for name, value in plan.environment.items()},
    }


def held_besides(stored: Plan, asked: Plan) -> str:
    """What a stored plan has that is not asked for: `"trackers ncc; seeds 3:8"`."""
    more = {
        "scenarios": ", ".join(name for name in stored.scenarios if name not in asked.scenarios),
        "conditions": ", ".join(name for name in stored.conditions if name not in asked.conditions),
        "trackers": ", ".join(label for label in stored.labels if label not in asked.labels),
        "seeds": seeds_text({one.seed for one in stored.episodes()} - {one.seed for one in asked.episodes()}),
    }
    return "; ".join(f"{kind} {names}" for kind, names in more.items() if names)
