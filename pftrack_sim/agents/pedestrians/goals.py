"""Goals of the reactive pedestrians: where they start and walk to, arrival, new goals, and changes of pace.

Everything random comes from each pedestrian's own stream.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum, auto

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.avoidance import Movers
from pftrack_sim.agents.pedestrians.crossing import covered_by_person
from pftrack_sim.agents.pedestrians.obstacle_map import ROUTE_CLEARANCE_M, ObstacleMap, VisibilityGraph
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.layout import WalkableArea

ARRIVAL_RADIUS_M = 0.7
_CHECK_PERIOD_S = 0.1  # Time between two progress checks; each looks at one pedestrian.
_STUCK_S = 4.0  # A pedestrian that moves less than _STUCK_M in this time gets a new goal.
_STUCK_M = 0.6

_PAUSES = 1.0 / 3.0  # Share of the changes of pace that are pauses
_PAUSE_S = (0.8, 3.0)  # Shorter than `_STUCK_S`
_PACE = (0.55, 1.35)

PREDICTION_TIMES_S = tuple(np.arange(1.0, 9.0, 0.5).tolist())
"""Times ahead at which `route_off_line_of_sight` is given camera and target positions."""

_START_DISTANCE_M = 1.0  # Least distance between start positions.
_OFF_SPEED_M_S = 1.2
_ASIDE_M, _ASIDE_GRID_M, _ASIDE_CLEARANCE_M = 8.0, 2.5, 0.68  # Of positions away from the target's path
_ASIDE_DISTANCE_M = 2.0  # Least distance from other pedestrians of a goal aside of the target's path.
_NEAR_TARGET_PROBABILITY = 0.5  # Share of goals near the target's future positions: distractors come into view.


class _Mode(Enum):
    WANDER = auto()  # Walks from goal to goal.
    WAIT = auto()  # Stays at its waiting position, and returns to it when pushed away.
    WALK_AND_STOP = auto()  # Walks one route and stays at its end.


@dataclass
class _Task:
    """What one pedestrian does: mode, waypoints after the next, last progress, and when to give up the goal."""

    mode: _Mode = _Mode.WANDER
    waiting_m: FloatArray = field(default_factory=lambda: np.zeros(2))
    waypoints: list[FloatArray] = field(default_factory=list[FloatArray])
    progress_m: FloatArray = field(default_factory=lambda: np.zeros(2))
    progress_s: float = 0.0
    give_up_s: float = math.inf


class GoalManager:
    """Tasks of all pedestrians, next waypoints and desired speeds of those that react.

    Args:
        movers: Pedestrians, the target first, and others; their waypoints and speeds are written.
        rngs: One generator per pedestrian after the target.
        distractors: Number of distractors, the first ones after the target: half of their goals are near the target.

    Attributes:
        walking_speed_m_s: `(P,)` walking speeds.
    """

    def __init__(
        self,
        movers: Movers,
        graph: VisibilityGraph,
        sampler: GoalSampler,
        rngs: Sequence[np.random.Generator],
        distractors: int,
    ) -> None:
        people = 1 + len(rngs)
        self._graph, self._sampler, self._rngs, self._distractors = graph, sampler, rngs, distractors
        self._movers = movers[:people]
        self.walking_speed_m_s = np.zeros(people)
        self._tasks = [_Task() for _ in range(people)]
        self._since_check_s = 0.0
        self._checked = 0

    def wait_at(self, person: int, waiting_m: FloatArray) -> None:
        """Stay at a `(2,)` waiting position."""
        self._tasks[person] = _Task(_Mode.WAIT, waiting_m)
        self._set_route(person, waiting_m[None])

    def walk_to_sampled_goal(
        self, person: int, time_s: float, position_m: FloatArray, target_s_m: float, heading_rad: float | None = None
    ) -> None:
        """Walk to a goal drawn from the pedestrian's own stream; rather ahead if a heading is given."""
        near_s_m = target_s_m if person <= self._distractors else None
        route = self._sampler.route_to_goal(self._rngs[person - 1], position_m.copy(), heading_rad, near_s_m)
        self._assign(person, time_s, position_m, route)

    def walk_and_stop(self, person: int, time_s: float, position_m: FloatArray, route_m: FloatArray | None) -> None:
        """Walk a `(K, 2)` route and stay at its end; with None, stay."""
        self._tasks[person].mode = _Mode.WALK_AND_STOP
        self._assign(person, time_s, position_m, route_m)

    def update(self, dt_s: float, time_s: float, target_s_m: float) -> None:
        """Advance waypoints and goals of those that react by a tick that ends at `time_s`, with the target there."""
        movers = self._movers
        left_m = np.hypot(movers["waypoint_x"] - movers["x"], movers["waypoint_y"] - movers["y"])
        walks = (movers["reaction"] > 0.0) & (movers["speed"] > 0.0)
        for person in np.flatnonzero(walks & (left_m < ARRIVAL_RADIUS_M)).tolist():
            task = self._tasks[person]
            if task.mode is _Mode.WAIT:
                continue
            if task.waypoints:
                self._walk_to(person, task.waypoints.pop(0))
            elif task.mode is _Mode.WALK_AND_STOP:
                movers["speed"][person] = 0.0
            else:
                heading_rad = float(movers["heading"][person])
                self.walk_to_sampled_goal(person, time_s, self._position(person), target_s_m, heading_rad)
        self._since_check_s += dt_s
        if self._since_check_s + 1e-9 >= _CHECK_PERIOD_S:
            self._since_check_s = 0.0
            reactive = np.flatnonzero(movers["reaction"]).tolist()
            self._checked = (self._checked + 1) % max(len(reactive), 1)
            for person in reactive[self._checked : self._checked + 1]:
                self._check_progress(person, time_s, self._position(person), target_s_m)

    def _check_progress(self, person: int, time_s: float, position: FloatArray, target_s_m: float) -> None:
        task, obstacles = self._tasks[person], self._graph.obstacles
        if task.waypoints and not obstacles.blocked(position, task.waypoints[0], ROUTE_CLEARANCE_M)[0]:
            # The waypoint after the next is in sight: skip the next.
            self._walk_to(person, task.waypoints.pop(0))
        if task.mode is _Mode.WAIT:
            if not task.waypoints:
                # Back to the waiting position, around obstacles where necessary.
                straight = not obstacles.blocked(position, task.waiting_m, 0.0)[0]
                route = task.waiting_m[None] if straight else self._graph.shortest_route(position, task.waiting_m)
                if route is not None:
                    self._set_route(person, route)
            return
        if task.mode is _Mode.WALK_AND_STOP and self._movers["speed"][person] == 0.0:
            return
        if math.hypot(*(position - task.progress_m)) > _STUCK_M:
            task.progress_m, task.progress_s = position, time_s
        if time_s - task.progress_s > _STUCK_S or time_s > task.give_up_s:
            self.walk_to_sampled_goal(person, time_s, position, target_s_m)

    def _assign(self, person: int, time_s: float, position: FloatArray, route: FloatArray | None) -> None:
        """Walk a route; with None, stay for a second and then sample a new goal."""
        task = self._tasks[person]
        if task.mode is _Mode.WAIT:
            task.mode = _Mode.WANDER
        task.progress_m, task.progress_s = position.copy(), time_s
        if route is None:
            self._walk_to(person, position)
            self._movers["speed"][person] = 0.0
            task.give_up_s = time_s + 1.0
            return
        self._set_route(person, route)
        length = float(np.hypot(*np.diff(np.vstack([position, route]), axis=0).T).sum())
        task.give_up_s = time_s + 8.0 + 2.0 * length / self.walking_speed_m_s[person]

    def _set_route(self, person: int, route: FloatArray) -> None:
        self._walk_to(person, route[0])
        self._tasks[person].waypoints = list(route[1:])
        self._movers["speed"][person] = self.walking_speed_m_s[person]

    def _walk_to(self, person: int, waypoint_m: FloatArray) -> None:
        self._movers["waypoint_x"][person], self._movers["waypoint_y"][person] = waypoint_m

    def _position(self, person: int) -> FloatArray:
        return np.array([self._movers["x"][person], self._movers["y"][person]])


class PaceChanges:
    """Factors on the speeds of pedestrians, which change at random times.

    Args:
        rngs: One generator per pedestrian.
        per_minute: Mean number of changes; 0 leaves every factor at 1.
        factors: `(N,)` factors on the walking speeds, which are written; 0 in a pause.
    """

    def __init__(self, rngs: Sequence[np.random.Generator], per_minute: float, factors: FloatArray) -> None:
        self._rngs, self._mean_s = rngs, 60.0 / per_minute if per_minute > 0.0 else np.inf
        self.factors = factors
        factors[:] = 1.0
        self._until_s = [self._walk_s(rng) for rng in rngs]

    def update(self, time_s: float) -> None:
        """Advance to a time."""
        for person, rng in enumerate(self._rngs):
            if time_s < self._until_s[person]:
                continue
            if self.factors[person] > 0.0 and rng.random() < _PAUSES:
                self.factors[person] = 0.0
                self._until_s[person] = time_s + rng.uniform(*_PAUSE_S)
            else:
                self.factors[person] = rng.uniform(*_PACE)
                self._until_s[person] = time_s + self._walk_s(rng)

    def _walk_s(self, rng: np.random.Generator) -> float:
        return float(rng.exponential(self._mean_s))


class GoalSampler:
    """Free positions of a layout, and routes to them; goals of the layout that are not free are ignored."""

    def __init__(self, layout: WalkableArea, graph: VisibilityGraph, target_path: Path) -> None:
        self._obstacles, self._graph, self._path = graph.obstacles, graph, target_path
        self._bounds_m = layout.bounds_m
        self._low, self._high = np.array(layout.bounds_m[:2]), np.array(layout.bounds_m[2:])
        goals = np.asarray(layout.goals_m, dtype=np.float64).reshape(-1, 2)
        self._goals_m = goals[self._obstacles.clearance_m(goals) >= ROUTE_CLEARANCE_M]
        self._path_start_m = np.array(target_path.pose(0.0)[:2])

    def start_position(self, rng: np.random.Generator, occupied_m: Sequence[FloatArray]) -> FloatArray:
        """`(2,)` start of a distractor, near the target's path or anywhere, apart from `(2,)` occupied positions."""
        best, best_distance = self._path_start_m, -np.inf
        for attempt in range(200):
            if rng.random() < 0.6:
                s_m = rng.uniform(0.0, self._path.length_m)
                point = self._beside_path(s_m, rng.choice((-1, 1)) * rng.uniform(0.8, 3.5))
            else:
                point = rng.uniform(self._low, self._high)
            if not self._free(point):
                continue
            distance = min(float(np.hypot(*(point - other))) for other in occupied_m)
            if distance >= _START_DISTANCE_M and (attempt > 100 or self._connected(point)):
                return point
            if distance > best_distance:
                best, best_distance = point, distance
        return best

    def waiting_position(self, wanted_m: FloatArray, occupied_m: Sequence[FloatArray]) -> FloatArray:
        """`(2,)` free position near the wanted one, at least 0.8 m from all occupied ones."""
        for radius in (0.0, 0.4, 0.8, 1.2, 1.7, 2.3, 3.0, 4.0, 5.5, 7.5):
            for step in range(12 if radius else 1):
                angle = step * np.pi / 6.0
                point = wanted_m + radius * np.array([np.cos(angle), np.sin(angle)])
                if self._free(point) and all(np.hypot(*(point - other)) >= 0.8 for other in occupied_m):
                    return point
        return wanted_m

    def route_to_goal(
        self, rng: np.random.Generator, position_m: FloatArray, heading_rad: float | None, target_s_m: float | None
    ) -> FloatArray | None:
        """A `(K, 2)` route from a `(2,)` position to a sampled goal; None when no goal was reachable.

        With a heading, goals ahead are preferred. With the target's arc length, half of the goals are ahead of it.
        """
        for attempt in range(16):
            goal = self._sampled_goal(rng, target_s_m)
            offset = goal - position_m
            length = float(np.hypot(*offset))
            if length < (5.0 if attempt < 8 else 2.0) or not self._free(goal):
                continue
            if heading_rad is not None and attempt < 8:
                ahead = offset[0] * np.cos(heading_rad) + offset[1] * np.sin(heading_rad)
                if ahead < -0.3 * length:
                    continue
            route = self._graph.shortest_route(position_m, goal)
            if route is not None:
                return route
        return None

    def route_off_line_of_sight(
        self, position_m: FloatArray, velocity_m_s: FloatArray, camera_m: FloatArray, target_m: FloatArray
    ) -> FloatArray | None:
        """A `(K, 2)` route rather straight on that leads out of the line of sight; None when no goal was reachable.

        Camera and target are `(T, 2)` predicted positions at `PREDICTION_TIMES_S`, position and velocity `(2,)`.
        """
        angles = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
        around = position_m + 8.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        goals = np.vstack([self._goals_m, np.clip(around, self._low + 0.6, self._high - 0.6)])
        offset = goals - position_m
        length = np.hypot(*offset.T) + 1e-9
        straight_on = (offset @ velocity_m_s) / (length * max(float(np.hypot(*velocity_m_s)), 1e-6))
        walked = np.minimum(_OFF_SPEED_M_S * np.array(PREDICTION_TIMES_S), length[:, None]) / length[:, None]
        between = covered_by_person(camera_m, target_m, position_m + walked[..., None] * offset[:, None], 0.5)
        score = straight_on - 4.0 * between.mean(axis=1) - 2.0 * (length < 2.5)
        best = goals[np.argsort(-score, kind="stable")[:8]]
        return self._first_route(position_m, [goal for goal in best if self._free(goal)])

    def route_aside(self, position_m: FloatArray, heading_rad: float, others_m: FloatArray) -> FloatArray | None:
        """A `(K, 2)` route to a goal away from the target's path and from `(N, 2)` others, rather ahead than behind.

        None when no goal was reachable.
        """
        goals = positions_away_from(self._path, self._obstacles, self._bounds_m)
        nearest_m = np.hypot(*(goals[:, None] - others_m).transpose(2, 0, 1)).min(axis=1)
        goals = goals[nearest_m > _ASIDE_DISTANCE_M]
        offset = goals - position_m
        ahead = offset @ (np.cos(heading_rad), np.sin(heading_rad))
        best = np.argsort(np.hypot(*offset.T) - 2.0 * ahead, kind="stable")[:8]
        return self._first_route(position_m, goals[best])

    def _first_route(self, position_m: FloatArray, goals_m: Sequence[FloatArray] | FloatArray) -> FloatArray | None:
        """The route to the first goal that can be reached."""
        routes = (self._graph.shortest_route(position_m, goal) for goal in goals_m)
        return next((route for route in routes if route is not None), None)

    def _sampled_goal(self, rng: np.random.Generator, target_s_m: float | None) -> FloatArray:
        if rng.random() < _NEAR_TARGET_PROBABILITY and target_s_m is not None:
            return self._beside_path(target_s_m + rng.uniform(3.0, 14.0), rng.normal(0.0, 2.0))
        if len(self._goals_m):
            return self._goals_m[int(rng.integers(len(self._goals_m)))]
        return rng.uniform(self._low, self._high)

    def _beside_path(self, s_m: float, left_m: float) -> FloatArray:
        """`(2,)` point at an arc length of the target's path, shifted to the left."""
        return np.array(self._path.beside(min(max(s_m, 0.0), self._path.length_m), left_m))

    def _free(self, point_m: ArrayLike) -> bool:
        return bool(self._obstacles.clearance_m(point_m)[0] >= ROUTE_CLEARANCE_M)

    def _connected(self, point_m: FloatArray) -> bool:
        """Whether a point is connected to the goals, not in a closed pocket between obstacles."""
        anchors = self._goals_m[:3] if len(self._goals_m) else [self._path_start_m]
        return any(self._graph.shortest_route(point_m, anchor) is not None for anchor in anchors)


def positions_away_from(path: Path, obstacles: ObstacleMap, bounds_m: tuple[float, float, float, float]) -> FloatArray:
    """`(N, 2)` free grid positions [m] within bounds x_min, y_min, x_max, y_max that are far from a path."""
    x_min, y_min, x_max, y_max = bounds_m
    grid = np.meshgrid(np.arange(x_min + 1.0, x_max, _ASIDE_GRID_M), np.arange(y_min + 1.0, y_max, _ASIDE_GRID_M))
    positions = np.stack(grid, axis=-1).reshape(-1, 2)
    x, y, _ = path.at(np.arange(0.0, path.length_m, 0.5))
    distance = np.hypot(positions[:, :1] - x, positions[:, 1:] - y).min(axis=1)
    return positions[(distance >= _ASIDE_M) & (obstacles.clearance_m(positions) >= _ASIDE_CLEARANCE_M)]
