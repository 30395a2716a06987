"""The plan of an episode: which occluders and oncoming pedestrians appear where and when."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.crossing import Crossing
from pftrack_sim.agents.pedestrians.goals import positions_away_from
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.agents.pedestrians.oncoming import OncomingPass, plan_oncoming_pass
from pftrack_sim.agents.pedestrians.outline import Outline
from pftrack_sim.agents.pedestrians.target import impossible_actions, mean_speed_m_s
from pftrack_sim.agents.robot.script import Script
from pftrack_sim.core import random_streams
from pftrack_sim.core.errors import ParameterError, ScenarioError
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scenario.axes import TargetAxis
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.occluders import (
    CartSize,
    Placement,
    axis_occluders,
    cart_names,
    distractor_crossings,
    occluder_names,
)
from pftrack_sim.scene.places.seats import Seat
from pftrack_sim.simulation.dry_run import DryRun, dry_run
from pftrack_sim.simulation.feasibility import meeting_problems, path_problems, placement_problems
from pftrack_sim.simulation.occlusion.moving import cart_height_m, plan_axis_crossing, plan_crossing
from pftrack_sim.simulation.occlusion.static import plan_static

AFTER_S = 3.0  # The dry run continues for this time after the last planned event
_DEPTH_GAP = 0.25
_DEPTH_GAP_S = 2.5  # Crossings within this time of each other differ by `_DEPTH_GAP` in depth


@dataclass(frozen=True)
class Plan:
    """Planned events of one episode.

    Attributes:
        layout: The place with the static occluders in it.
        oncoming: Pedestrians that pass close by the target.
    """

    layout: WalkableArea
    static_occluders: dict[str, Placement] = field(default_factory=dict)
    crossings: tuple[Crossing, ...] = ()
    carts: tuple[Crossing, ...] = ()
    cart_sizes: dict[str, CartSize] = field(default_factory=dict)
    oncoming: tuple[OncomingPass, ...] = ()


def make_script(settings: ResolvedScenario, seed: int, layout: WalkableArea, path: Path) -> Script:
    """The robot's script, once the ways of target and robot are found free.

    Raises:
        ScenarioError: What is in the way, or why the target is never in view.
    """
    speed_m_s, axis = mean_speed_m_s(path, settings.target), settings.axes.target
    where = f"{settings.title!r} at seed {seed}"
    problems = path_problems(settings, layout, path)
    try:
        gaze_m = settings.target.gaze_m
        script = Script(settings.robot, path, speed_m_s, axis, settings.camera, layout, seed, gaze_m)
    except ParameterError as error:
        raise ScenarioError(where, [*problems, str(error)]) from None
    problems += placement_problems(settings, layout, path, script)
    hit = script.obstacle(layout, settings.duration_s)
    if hit is not None:
        name, x, y = hit
        problems.append(f"robot.route: the robot would run into {name!r} at {x:.1f}, {y:.1f}")
    if problems:
        raise ScenarioError(where, problems)
    return script


def make_plan(
    settings: ResolvedScenario,
    seed: int,
    layout: WalkableArea,
    path: Path,
    seats: Sequence[Seat],
    script: Script,
) -> Plan:
    """Plan an episode.

    Target and robot follow their scripts whatever else moves, so the dry run has no other people. The scenario's own
    occluders are planned first, and from their part of the dry run only: the stress axes do not change them.

    Raises:
        ScenarioError: A requested event is impossible.
    """
    occluders, axes = settings.occluders, settings.axes
    problems = impossible_actions(path, settings.target, axes.target, settings.duration_s)
    for one in settings.walking_targets:
        problems += impossible_actions(Path(one.path_m), one.person, TargetAxis(), settings.duration_s, one.name)
    if problems:
        raise ScenarioError(f"{settings.title!r} at seed {seed}", problems)
    occluders_s = max((occluder.at_s + occluder.duration_s for occluder in occluders), default=0.0) + AFTER_S
    if settings.target.pushed:
        # It may come back to where they would stand.
        occluders_s = max(occluders_s, settings.duration_s)
    covers = (*axes.occlusion.spans_s, *axes.distractors.crossings_s)
    axes_s = [*(at_s + length_s for at_s, length_s in covers), *axes.distractors.passings_s]
    # Groups, seats and further targets are met on the whole way.
    # So is a thing that is pushed, which does not stop for a robot.
    met = settings.groups or seats or settings.walking_targets or settings.target.pushed
    meetings_s = settings.duration_s if met else 0.0
    until_s = max([occluders_s, meetings_s, *(time_s + AFTER_S for time_s in axes_s)])
    plan = Plan(layout)
    if until_s == AFTER_S:
        return plan
    run = dry_run(settings, path, script, until_s)
    if meetings_s:
        problems += meeting_problems(settings, path, seats, run)
    if occluders:
        plan = _plan_occluders(settings, plan, run.until(occluders_s), problems)
    plan = _plan_axis_occlusions(settings, plan, run, problems)
    plan = _plan_lookalike_crossings(settings, plan, run, problems)
    plan = replace(plan, oncoming=_plan_oncoming(settings, seed, plan.layout, path, run, problems))
    if problems:
        raise ScenarioError(f"{settings.title!r} at seed {seed}", problems)
    return plan


def _plan_occluders(settings: ResolvedScenario, plan: Plan, run: DryRun, problems: list[str]) -> Plan:
    """Plan the scenario's occluders; static ones first, since walkers avoid them."""
    occluders = settings.occluders
    layout, placements, crossings = plan.layout, dict[str, Placement](), list[Crossing]()
    names = occluder_names(occluders)
    for index in sorted(range(len(occluders)), key=lambda index: names[index] is None):
        occluder, name = occluders[index], names[index]
        with _collected(problems):
            if name is None:
                crossings.append(plan_crossing(occluder, run, layout, f"occluders.{index}"))
            else:
                placements[name] = placement = plan_static(occluder, run, layout, f"occluders.{index}")
                layout = replace(layout, footprints=(*layout.footprints, placement.footprint(name)))
    return Plan(layout, placements, tuple(crossings))


def _plan_axis_occlusions(settings: ResolvedScenario, plan: Plan, run: DryRun, problems: list[str]) -> Plan:
    """Plan the occlusions of the stress axis, by carts or by pedestrians."""
    axis = settings.axes.occlusion
    names = cart_names(axis)
    crossings: list[Crossing] = []
    for number, occluder in enumerate(axis_occluders(axis), start=1):
        until_s = occluder.at_s + occluder.duration_s
        occupied = [
            crossing.depth
            for crossing in plan.crossings
            if crossing.at_s - _DEPTH_GAP_S < until_s and occluder.at_s - _DEPTH_GAP_S < crossing.until_s
        ]
        if not names and crossings and crossings[-1].until_s + _DEPTH_GAP_S > occluder.at_s:
            occupied.append(crossings[-1].depth)
        shifts = sorted(np.round(np.arange(0.3, 0.7001, 0.05) - axis.depth, 3).tolist(), key=abs)
        free = [shift for shift in shifts if all(abs(axis.depth + shift - depth) >= _DEPTH_GAP for depth in occupied)]
        with _collected(problems):
            title = f"axes.occlusion, occlusion {number}"
            crossings.append(plan_axis_crossing(axis, occluder, run, plan.layout, title, tuple(free or shifts)))
    if not names:
        return replace(plan, crossings=(*plan.crossings, *crossings))
    sizes = [CartSize(crossing.half_width_m, cart_height_m(axis, crossing, run)) for crossing in crossings]
    return replace(plan, carts=tuple(crossings), cart_sizes=dict(zip(names, sizes, strict=False)))


def _plan_lookalike_crossings(settings: ResolvedScenario, plan: Plan, run: DryRun, problems: list[str]) -> Plan:
    """Plan the look-alikes of the stress axis that cross between camera and target."""
    crossings: list[Crossing] = []
    for number, walker in enumerate(distractor_crossings(settings.axes.distractors), start=1):
        with _collected(problems):
            crossings.append(plan_crossing(walker, run, plan.layout, f"axes.distractors, crossing {number}"))
    return replace(plan, crossings=(*plan.crossings, *crossings))


def _plan_oncoming(
    settings: ResolvedScenario, seed: int, layout: WalkableArea, path: Path, run: DryRun, problems: list[str]
) -> tuple[OncomingPass, ...]:
    """Plan the oncoming pedestrians of the stress axis."""
    axis = settings.axes.distractors
    obstacles = ObstacleMap(layout)
    passes: list[OncomingPass] = []
    distance_m = axis.distance_m + Outline.of(settings.target).extra_m
    waiting_places = positions_away_from(path, obstacles, layout.bounds_m)

    for number, at_s in enumerate(axis.passings_s):
        rng = random_streams.stream(seed, "axes", "distractors", number)
        side, speed = (1 if rng.random() < 0.5 else -1), float(rng.uniform(1.05, 1.35))
        camera, target = run.at(at_s)
        meeting_s_m = float(np.interp(at_s, run.times_s, run.target_s_m))
        heading = path.pose(meeting_s_m)[2]
        lateral = np.cos(heading) * (camera[0, 1] - target[0, 1]) - np.sin(heading) * (camera[0, 0] - target[0, 0])
        if abs(lateral) > 1.0:
            # Seen from the side, a pedestrian on the far side of the target is in view and does not cover it.
            side = -1 if lateral > 0.0 else 1
        name = f"axes.distractors, pedestrian {number + 1}"
        with _collected(problems):
            passes.append(
                plan_oncoming_pass(at_s, meeting_s_m, distance_m, speed, path, obstacles, side, name, waiting_places)
            )
            if passes[-1].waiting_m is not None:
                waiting_places = waiting_places[(waiting_places != passes[-1].waiting_m).any(axis=1)]
    return tuple(passes)


@contextmanager
def _collected(problems: list[str]) -> Generator[None]:
    """Add the message of a request that is impossible to the others."""
    try:
        yield
    except ParameterError as error:
        problems.append(str(error))
