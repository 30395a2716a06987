"""The target's path: the scenario's, drawn by seed where there is room, or what becomes of a thing that is pushed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice

import numpy as np

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.agents.pushed_thing import PushedWay
from pftrack_sim.agents.pushes import pushed_way, with_robot
from pftrack_sim.core import random_streams
from pftrack_sim.core.errors import ParameterError, ScenarioError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scenario.robot import StillRoute, TrailRoute
from pftrack_sim.scene.build import walkable_area
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.simulation.feasibility import group_seats, planned_seats, seat_problems
from pftrack_sim.simulation.planning import make_plan, make_script

CLEARANCE_M = 0.5
"""Distance of a drawn path from everything: half the width of a person or the robot, and some room."""

_TURNS = (2, 3, 4, 6, 8)  # Tried in turn where none are asked for
_STARTS, _HEADINGS = 3000, 24  # Paths begun, and directions tried for each of their legs
_PATHS = 60  # Paths that are planned with robot and occluders before it is given up
_PLACES = 20  # Places from which a thing is pushed before it is given up
_NEAR_M = 6.0  # It lies nearer than this to a robot that stands, with nothing between
_ROBOT_GAP_M = 0.05  # What bounces off a robot does not touch it
_TURN_RAD = math.radians(25.0), math.radians(100.0)


def target_path(settings: ResolvedScenario, seed: int) -> Path:
    """The target's path: the scenario's, or for `"auto"` the first drawn that can be; a `PushedWay` of what is pushed.

    Raises:
        ScenarioError: There is no room for such a path, or none on which robot and occluders can be as asked.
    """
    target = settings.target
    if target.pushed:
        return _pushed(settings, seed)
    if target.path == "points":
        return Path(target.path_m)
    layout, rng = walkable_area(settings, seed), random_streams.stream(seed, "target_path")
    behind_m = settings.robot.route.distance_m if isinstance(settings.robot.route, TrailRoute) else 0.0
    length_m = target.path_length_m or max(1.0, target.speed_m_s * settings.duration_s)
    problem = ""
    for turns in _TURNS if target.path_turns is None else (target.path_turns,):
        drawing = _Drawing(layout, rng, length_m, turns, behind_m)
        for points in islice(drawing.paths(), _PATHS):
            path = Path([(round(x, 3), round(y, 3)) for x, y in points.tolist()])
            found = _problem(settings, seed, layout, path)
            if found is None:
                return path
            problem = problem or f"none of the paths drawn can be; on the first: {found}"
        problem = problem or drawing.problem()
    raise ScenarioError(f"{settings.title!r} at seed {seed}", [f"target.path: {problem}"])


def _pushed(settings: ResolvedScenario, seed: int) -> PushedWay:
    """The way of a thing that is pushed, from the scenario's point, or the first drawn from which it can be."""
    target, route = settings.target, settings.robot.route
    assert target.thing is not None
    layout, rng = walkable_area(settings, seed, group_seats(settings)), random_streams.stream(seed, "target_path")
    solid = layout
    if isinstance(route, StillRoute):
        solid = with_robot(layout, route.start_m, settings.robot.half_width_m + _ROBOT_GAP_M)
    starts = np.array(target.path_m)
    if target.path == "auto":
        starts = rng.uniform(layout.bounds_m[:2], layout.bounds_m[2:], (_STARTS, 2))
        starts = starts[ObstacleMap(solid).clearance_m(starts) >= CLEARANCE_M].round(3)
        if isinstance(route, StillRoute):
            near = np.hypot(*(starts - route.start_m).T) < _NEAR_M
            starts = starts[near & ~ObstacleMap(layout).blocked(route.start_m, starts, 0.0)]
        starts = starts[:_PLACES]
    problem = f"no place has {CLEARANCE_M} m to everything"
    for number, (x, y) in enumerate(starts.tolist()):
        pushes = random_streams.stream(seed, "pushes", number)
        try:
            way = pushed_way(target.thing, (x, y), solid, settings.duration_s, pushes)
        except ParameterError as error:
            problem = str(error)
            continue
        found = _problem(settings, seed, layout, way) if target.path == "auto" else None
        if found is None:
            return way
        problem = found
    where = "target.path: nowhere can it be; last" if target.path == "auto" else "target.thing"
    raise ScenarioError(f"{settings.title!r} at seed {seed}", [f"{where}: {problem}"])


def _problem(settings: ResolvedScenario, seed: int, layout: WalkableArea, path: Path) -> str | None:
    """Why an episode cannot be as asked on this path."""
    seats = planned_seats(settings, path)
    try:
        if problems := seat_problems(seats, layout):
            return problems[0]
        make_plan(settings, seed, layout, path, seats, make_script(settings, seed, layout, path))
    except ScenarioError as error:
        return error.problems[0]
    return None


class _Drawing:
    """Paths of straight legs that keep `CLEARANCE_M` from everything, as does a straight `behind_m` before them."""

    def __init__(
        self, layout: WalkableArea, rng: np.random.Generator, length_m: float, turns: int, behind_m: float
    ) -> None:
        self._obstacles, self._bounds_m, self._rng = ObstacleMap(layout), layout.bounds_m, rng
        self._length_m, self._turns, self._behind_m = length_m, turns, behind_m
        self._longest = np.zeros((2, 2))

    def paths(self) -> Iterator[FloatArray]:
        """`(turns + 2, 2)` points of one after the other."""
        starts = self._rng.uniform(self._bounds_m[:2], self._bounds_m[2:], (_STARTS, 2))
        for start in starts[self._obstacles.clearance_m(starts) >= CLEARANCE_M]:
            path = self._legs(start)
            self._longest = max(self._longest, path, key=_length_m)
            if len(path) < self._turns + 2:
                continue
            path[0] += self._behind_m * (path[1] - path[0]) / np.hypot(*(path[1] - path[0]))
            rounded = Path(path)
            walked = np.stack(rounded.at(np.arange(0.0, rounded.length_m, 0.1))[:2], axis=1)
            if self._obstacles.clearance_m(walked).min() >= CLEARANCE_M:
                yield path

    def _legs(self, start: FloatArray) -> FloatArray:
        """Points of as many legs as there is room for; the first is longer by what the robot needs."""
        rng, points, heading = self._rng, [start], None
        legs = rng.uniform(0.7, 1.3, self._turns + 1)
        legs *= self._length_m / legs.sum()
        legs[0] += self._behind_m
        for leg in legs:
            headings = rng.uniform(-math.pi, math.pi, _HEADINGS)
            if heading is not None:
                headings = heading + np.sign(headings) * rng.uniform(*_TURN_RAD, _HEADINGS)
            ends = points[-1] + leg * np.column_stack([np.cos(headings), np.sin(headings)])
            free = np.flatnonzero(~self._obstacles.blocked(points[-1], ends, CLEARANCE_M))
            if not len(free):
                break
            heading = headings[free[0]]
            points.append(ends[free[0]])
        return np.array(points)

    def problem(self) -> str:
        """Why none was found."""
        x_min, y_min, x_max, y_max = self._bounds_m
        (x, y), (to_x, to_y) = self._longest[0], self._longest[-1]
        robot = f", {self._behind_m:.1f} m of it for the robot behind," if self._behind_m else ""
        return (
            f"no path of {self._length_m + self._behind_m:.1f} m{robot} with {self._turns} turns keeps {CLEARANCE_M} m "
            f"from everything in the walkable area (x {x_min:.1f} to {x_max:.1f}, y {y_min:.1f} to {y_max:.1f}); the "
            f"longest drawn has {_length_m(self._longest):.1f} m, from {x:.1f}, {y:.1f} to {to_x:.1f}, {to_y:.1f}"
        )


def _length_m(points: FloatArray) -> float:
    return float(np.hypot(*np.diff(points, axis=0).T).sum())
