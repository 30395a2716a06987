"""An episode before it is rendered: what is planned where and when, and what about it is suspicious."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.groups import group_places
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.agents.pedestrians.target import mean_speed_m_s
from pftrack_sim.agents.pushed_thing import PushedWay
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scenario import ResolvedScenario, axis_without_effect, late_events
from pftrack_sim.scenario.people import Companions
from pftrack_sim.scenario.robot import StillRoute
from pftrack_sim.scene.build import walkable_area
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.simulation.dry_run import DryRun, dry_run
from pftrack_sim.simulation.feasibility import planned_seats, seat_problems
from pftrack_sim.simulation.occlusion.static import spans
from pftrack_sim.simulation.planning import Plan, make_plan, make_script
from pftrack_sim.simulation.target_path import target_path

_SAMPLE_S = 0.1
_LONG_S = 1.5  # A target that is out of view for longer is worth a word
_STANDS_S, _LIES_S = 2.0, 5.0  # So is one that stands at the end of its path for longer, or a thing that lies there
_HIDES_M = 1.3  # Least height of what hides most of a person


@dataclass(frozen=True)
class Event:
    """Something planned: what, and where target and camera are then, x, y [m]."""

    title: str
    target_m: tuple[float, float]
    camera_m: tuple[float, float]


@dataclass(frozen=True)
class Overview:
    """What is known of an episode; what follows a problem is missing.

    Attributes:
        layout: The place, with the static occluders.
        path_m: `(N, 2)` the target's way, with rounded corners; empty if there is none.
        run: The dry run over the episode.
        people_m: Where members of groups, and pedestrians and carts that wait for their time, stand at first.
        suspicious: Lines that begin with the key that they are about.
    """

    layout: WalkableArea
    path_m: FloatArray = field(default_factory=lambda: np.empty((0, 2)))
    run: DryRun | None = None
    people_m: tuple[tuple[float, float], ...] = ()
    events: tuple[Event, ...] = ()
    suspicious: tuple[str, ...] = ()


def overview(settings: ResolvedScenario, seed: int) -> Overview:
    """Plan an episode as far as it can be planned.

    Raises:
        ScenarioError: The place itself cannot be built.
    """
    late = [f"{one}: after the end of the episode" for one in late_events(settings)]
    axes = [axis_without_effect(settings, name) for name, axis in settings.axes if axis.on]
    suspicious = [*settings.late_actions(), *late, *(line for line in axes if line is not None)]
    found = Overview(walkable_area(settings, seed))
    try:
        path = target_path(settings, seed)
        found = replace(found, path_m=np.stack(path.at(np.linspace(0.0, path.length_m, 200))[:2], axis=1))
        seats = planned_seats(settings, path)
        suspicious += seat_problems(seats, found.layout)
        found = replace(found, layout=walkable_area(settings, seed, seats))
        script = make_script(settings, seed, found.layout, path)
        run = dry_run(settings, path, script, settings.duration_s)
        found = replace(found, run=run)
        suspicious += _long_unseen(settings, found.layout, run) + _ends(settings, path, run)
        plan = make_plan(settings, seed, found.layout, path, seats, script)
        members = group_places([one for one in settings.groups if not isinstance(one, Companions)], path)
        waiting = [*plan.crossings, *plan.carts, *plan.oncoming]
        people = [*(one.waiting_m for one in waiting), *(place(0.0, 0.0)[:2] for place in members),
                  *(one.path_m[0] for one in settings.walking_targets)]  # fmt: skip
        found = replace(found, layout=plan.layout, events=tuple(_events(plan, path, run)),
                        people_m=tuple(one for one in people if one is not None))  # fmt: skip
    except ScenarioError as error:
        suspicious += error.problems
    return replace(found, suspicious=tuple(suspicious))


def _events(plan: Plan, path: Path, run: DryRun) -> list[Event]:
    """Planned occlusions, passes and pushes, by time."""
    titles = [(span[0], f"{one.kind} {_span(*span)}") for one in plan.static_occluders.values() for span in one.spans_s]
    titles += [(one.at_s, f"pedestrian {_span(one.at_s, one.until_s)}") for one in plan.crossings]
    titles += [(one.at_s, f"cart {_span(one.at_s, one.until_s)}") for one in plan.carts]
    titles += [(one.at_s, f"oncoming pedestrian, {one.at_s:.1f} s") for one in plan.oncoming]
    if isinstance(path, PushedWay):
        titles += [(at_s, f"push, {at_s:.1f} s") for at_s in path.pushed_s]
    events: list[Event] = []
    for at_s, title in sorted(titles):
        (camera,), (target,) = run.at(at_s)
        events.append(Event(title, (float(target[0]), float(target[1])), (float(camera[0]), float(camera[1]))))
    return events


def _span(begin_s: float, end_s: float) -> str:
    return f"{begin_s:.1f} to {end_s:.1f} s"


def _long_unseen(settings: ResolvedScenario, layout: WalkableArea, run: DryRun) -> list[str]:
    """When the place hides the target, or the camera looks elsewhere, for long."""
    times = np.arange(0.0, run.end_s, _SAMPLE_S)
    camera, target = run.at(times)
    high = tuple(one for one in layout.footprints if one.height_m >= _HIDES_M)
    obstacles = ObstacleMap(WalkableArea((-1e4, -1e4, 1e4, 1e4), high, ()))
    hidden = np.array([obstacles.blocked(one[:2], other, 0.0)[0] for one, other in zip(camera, target, strict=True)])
    away = np.zeros(len(times), dtype=bool)
    if settings.robot.gaze == "forward":
        ahead, sight = camera[:, :2] - run.robot_at(times), target - camera[:, :2]
        turn = np.arctan2(sight[:, 1], sight[:, 0]) - np.arctan2(ahead[:, 1], ahead[:, 0])
        away = np.abs((turn + np.pi) % (2.0 * np.pi) - np.pi) > settings.camera.half_view_rad[0]
    lines = [f"target.path: something of the place hides the target {span}" for span in _long(times, hidden)]
    return lines + [f"robot.gaze: the camera looks elsewhere {span}" for span in _long(times, away)]


def _long(times_s: FloatArray, mask: BoolArray) -> list[str]:
    """Spans of more than `_LONG_S` in which a mask holds."""
    return [f"from {_span(begin, end)}" for begin, end in spans(mask, times_s) if end - begin > _LONG_S]


def _ends(settings: ResolvedScenario, path: Path, run: DryRun) -> list[str]:
    """Values that contradict each other: a path that is too short, a robot that is too slow."""
    lines: list[str] = []
    there = np.flatnonzero(run.target_s_m >= path.length_m - 0.05)
    key, long_s = ("thing.pushes", _LIES_S) if settings.target.pushed else ("path_m", _STANDS_S)
    if len(there) and run.end_s - run.times_s[there[0]] > long_s:
        lines.append(
            f"target.{key}: the target is at the end of its {path.length_m:.1f} m after "
            f"{run.times_s[there[0]]:.1f} s, and stands there: the episode lasts {settings.duration_s:g} s"
        )
    away_m = float(math.dist(run.robot_m[-1], run.target_m[-1]))
    speed_m_s = mean_speed_m_s(path, settings.target)
    if not isinstance(settings.robot.route, StillRoute) and settings.robot.max_speed_m_s < speed_m_s:
        key = "the target's mean speed" if settings.target.pushed else "target.speed_m_s"
        lines.append(
            f"robot.max_speed_m_s: {settings.robot.max_speed_m_s:g} is less than {key}: the robot falls "
            f"back, to {away_m:.1f} m in the end"
        )
    return lines
