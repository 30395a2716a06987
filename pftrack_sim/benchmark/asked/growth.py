"""Runs that grow: a stored plan with the seeds, conditions, scenarios and trackers of another one added."""

from __future__ import annotations

from collections.abc import Iterator

from pftrack_sim.benchmark.asked.from_names import code_of
from pftrack_sim.benchmark.asked.plan import Condition, Plan, ScenarioSpec, Sweep, TrackerSpec, make_checked_plan
from pftrack_sim.benchmark.asked.seeds import Seeds
from pftrack_sim.core.errors import ParameterError


def grown(stored: Plan, asked: Plan) -> Plan:
    """What is stored, and what is asked for besides; the stored episodes keep their places on disk.

    Every tracker runs in every episode, so that a tracker that is added runs in those that were there too.

    Raises:
        ParameterError: The two contradict each other: an episode would have to be two things.
    """
    problems = list(_contradictions(stored, asked))
    if problems:
        raise ParameterError("\n".join(problems))
    trackers = _united_trackers(stored, asked)
    suites = stored.suites + tuple(suite for suite in asked.suites if suite not in stored.suites)
    united = make_checked_plan(tuple(_united_sweeps(stored, asked)), trackers, suites, stored.truth)
    if any(
        new[name] != slug for old, new in zip(stored.slugs, united.slugs, strict=True) for name, slug in old.items()
    ):
        raise ParameterError("  names: a new name would change the file names of what is there")
    # Equal but for the order of its parts, it is the stored plan: nothing is to be run anew.
    return stored if trackers == stored.trackers and _cells(united) == _cells(stored) else united


def held_besides(stored: Plan, asked: Plan) -> str:
    """What a stored plan has that is not asked for: `"trackers ncc; seeds 3:8"`; empty where they contradict."""
    if any(_contradictions(stored, asked)):
        return ""
    held, wanted = _cells(stored), _cells(asked)
    scenarios, conditions = (dict.fromkeys(key[part] for key in held) for part in (0, 1))
    more = Seeds(())
    for key, (_, _, seeds) in held.items():
        if key in wanted:
            more = more.joined(seeds.without(wanted[key][2]))
    lacking = {
        "scenarios": ", ".join(name for name in scenarios if name not in {key[0] for key in wanted}),
        "conditions": ", ".join(name for name in conditions if name not in {key[1] for key in wanted}),
        "trackers": ", ".join(label for label in stored.labels if label not in asked.labels),
        "seeds": str(more),
    }
    return "; ".join(f"{kind} {names}" for kind, names in lacking.items() if names)


def _contradictions(stored: Plan, asked: Plan) -> Iterator[str]:
    if stored.kind != asked.kind:
        yield f"  loop: {stored.kind} there, {asked.kind} asked for"
    if stored.truth != asked.truth:
        yield f"  truth: {stored.truth} there, {asked.truth} asked for"
    trees = {scenario.name: scenario.tree for sweep in stored.sweeps for scenario in sweep.scenarios}
    for sweep in asked.sweeps:
        for scenario in sweep.scenarios:
            if trees.get(scenario.name, scenario.tree) != scenario.tree:
                yield f"  scenarios.{scenario.name}: its content or its --set differ"
    conditions = {one.name: one for sweep in stored.sweeps for one in sweep.conditions}
    for sweep in asked.sweeps:
        for condition in sweep.conditions:
            if conditions.get(condition.name, condition) != condition:
                yield f"  conditions: {condition.name} has other levels there"


def _united_trackers(stored: Plan, asked: Plan) -> tuple[TrackerSpec, ...]:
    """The stored trackers with the code of today where they are asked for, then the new ones."""
    today = {tracker.label: tracker for tracker in asked.trackers}
    # The code of a tracker that is not asked for counts too: it runs in the new episodes.
    kept = tuple(
        today.pop(tracker.label, None) or tracker.model_copy(update={"code": code_of(tracker)})
        for tracker in stored.trackers
    )
    return kept + tuple(today.values())


_Cells = dict[tuple[str, str], tuple[ScenarioSpec, Condition, Seeds]]


def _cells(*plans: Plan) -> _Cells:
    """Scenario, condition and seeds by the names of scenario and condition."""
    cells: _Cells = {}
    for plan in plans:
        for sweep in plan.sweeps:
            for scenario in sweep.scenarios:
                for condition in sweep.conditions:
                    key = (scenario.name, condition.name)
                    seeds = cells[key][2].joined(sweep.seeds) if key in cells else sweep.seeds
                    cells[key] = scenario, condition, seeds
    return cells


def _united_sweeps(stored: Plan, asked: Plan) -> Iterator[Sweep]:
    """As few sweeps as the seeds of the cells allow: scenarios with the same conditions and seeds share one."""
    blocks: dict[tuple[str, Seeds], list[Condition]] = {}
    scenarios: dict[str, ScenarioSpec] = {}
    for scenario, condition, seeds in _cells(stored, asked).values():
        scenarios[scenario.name] = scenario
        blocks.setdefault((scenario.name, seeds), []).append(condition)
    grids: dict[tuple[tuple[Condition, ...], Seeds], list[ScenarioSpec]] = {}
    for (name, seeds), conditions in blocks.items():
        grids.setdefault((tuple(conditions), seeds), []).append(scenarios[name])
    for (conditions, seeds), found in grids.items():
        yield Sweep(scenarios=tuple(found), conditions=conditions, seeds=seeds)
