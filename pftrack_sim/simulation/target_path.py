"""A path for the target, drawn by seed where there is room for it, and for the robot behind it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.core import random_streams
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scenario.robot import TrailRoute
from pftrack_sim.scenario.section import Point
from pftrack_sim.scene.build import walkable_area
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.simulation.feasibility import planned_seats, seat_problems
from pftrack_sim.simulation.planning import make_plan, make_script

CLEARANCE_M = 0.55
"""Distance of a drawn path from everything: a person's half width, and the robot's, and some room."""

_STARTS, _HEADINGS = 3000, 24  # Paths begun, and directions tried for each of their legs
_PATHS = 60  # Paths that are planned with robot and occluders before it is given up
_TURN_RAD = math.radians(25.0), math.radians(100.0)


def target_points(settings: ResolvedScenario, seed: int) -> tuple[Point, ...]:
    """Points of the target's path: the scenario's, or for `"auto"` those of the first drawn that can be.

    Raises:
        ScenarioError: There is no room for such a path, or none on which robot and occluders can be as asked.
    """
    target, name = settings.target, f"{settings.title!r} at seed {seed}"
    if target.path == "points":
        return target.path_m
    layout = walkable_area(settings, seed)
    behind_m = settings.robot.route.distance_m if isinstance(settings.robot.route, TrailRoute) else 0.0
    length_m = target.path_length_m or max(1.0, target.speed_m_s * settings.duration_s)
    failed: ScenarioError | None = None
    rng = random_streams.stream(seed, "target_path")
    drawn = drawn_paths(layout, rng, length_m, target.path_turns, behind_m)
    for _ in range(_PATHS):
        try:
            points = next(drawn, None)
        except ScenarioError as error:
            raise ScenarioError(name, error.problems) from None
        if points is None:
            break
        path_m = tuple((round(x, 3), round(y, 3)) for x, y in points.tolist())
        path = Path(path_m)
        seats = planned_seats(settings, path)
        try:
            if problems := seat_problems(seats, layout):
                raise ScenarioError(name, problems)
            make_plan(settings, seed, layout, path, seats, make_script(settings, seed, layout, path))
        except ScenarioError as error:
            failed = failed or error
        else:
            return path_m
    assert failed is not None
    raise ScenarioError(name, [f"target.path: none of the paths drawn can be; on the first: {failed.problems[0]}"])


def drawn_paths(
    layout: WalkableArea, rng: np.random.Generator, length_m: float, turns: int, behind_m: float
) -> Iterator[FloatArray]:
    """`(turns + 2, 2)` points of paths that keep `CLEARANCE_M` from everything, as does a straight `behind_m` before.

    Raises:
        ScenarioError: None was found.
    """
    obstacles, (x_min, y_min, x_max, y_max) = ObstacleMap(layout), layout.bounds_m
    starts = rng.uniform((x_min, y_min), (x_max, y_max), (_STARTS, 2))
    starts = starts[obstacles.clearance_m(starts) >= CLEARANCE_M]
    longest, found = np.zeros((2, 2)), False
    for start in starts:
        legs = rng.uniform(0.7, 1.3, turns + 1)
        legs *= length_m / legs.sum()
        legs[0] += behind_m
        points, heading = [start], None
        for leg in legs:
            if heading is None:
                headings = rng.uniform(-math.pi, math.pi, _HEADINGS)
            else:
                headings = heading + rng.choice((-1.0, 1.0), _HEADINGS) * rng.uniform(*_TURN_RAD, _HEADINGS)
            ends = points[-1] + leg * np.column_stack([np.cos(headings), np.sin(headings)])
            free = np.flatnonzero(~obstacles.blocked(points[-1], ends, CLEARANCE_M))
            if not len(free):
                break
            heading = headings[free[0]]
            points.append(ends[free[0]])
        path = np.array(points)
        if _length_m(path) > _length_m(longest):
            longest = path
        if len(path) < turns + 2:
            continue
        path[0] += behind_m * (path[1] - path[0]) / np.hypot(*(path[1] - path[0]))
        rounded = Path(path)
        walked = np.stack(rounded.at(np.arange(0.0, rounded.length_m, 0.1))[:2], axis=1)
        if obstacles.clearance_m(walked).min() >= CLEARANCE_M:
            found = True
            yield path
    if not found:
        area = f"x {x_min:.1f} to {x_max:.1f}, y {y_min:.1f} to {y_max:.1f}"
        (x, y), (to_x, to_y) = longest[0], longest[-1]
        room = f", {behind_m:.1f} m of it for the robot behind," if behind_m else ""
        raise ScenarioError(
            "",
            [
                f"target.path: no path of {length_m + behind_m:.1f} m{room} with {turns} turns keeps {CLEARANCE_M} m "
                f"from everything in the walkable area ({area}); the longest drawn has {_length_m(longest):.1f} m, "
                f"from {x:.1f}, {y:.1f} to {to_x:.1f}, {to_y:.1f}"
            ],
        )


def _length_m(points: FloatArray) -> float:
    return float(np.hypot(*np.diff(points, axis=0).T).sum())
