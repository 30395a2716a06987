"""Goals of the reactive pedestrians: routes, arrival, new goals where there is no progress; and changes of pace."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum, auto

import numpy as np

from pftrack_sim.agents.pedestrians.avoidance import Movers
from pftrack_sim.agents.pedestrians.goal_sampler import GoalSampler
from pftrack_sim.agents.pedestrians.obstacle_map import ROUTE_CLEARANCE_M, VisibilityGraph
from pftrack_sim.core.types import FloatArray

ARRIVAL_RADIUS_M = 0.7
_CHECK_PERIOD_S = 0.1  # Time between two progress checks; each looks at one pedestrian.
_STUCK_S = 4.0  # A pedestrian that moves less than _STUCK_M in this time gets a new goal.
_STUCK_M = 0.6

_PAUSES = 1.0 / 3.0  # Share of the changes of pace that are pauses
_PAUSE_S = (0.8, 3.0)  # Shorter than `_STUCK_S`
_PACE = (0.55, 1.35)


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
        self._arrival_radius_m = np.full(people, ARRIVAL_RADIUS_M)
        self._tasks = [_Task() for _ in range(people)]
        self._since_check_s = 0.0
        self._checked = 0

    def wait_at(self, person: int, waiting_m: FloatArray) -> None:
        """Stay at a `(2,)` waiting position."""
        self._tasks[person] = _Task(_Mode.WAIT, waiting_m)
        self._set_route(person, waiting_m[None])
        self._arrival_radius_m[person] = -1.0

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
        for person in np.flatnonzero(left_m < self._arrival_radius_m).tolist():
            if movers["reaction"][person] == 0.0:
                continue
            task = self._tasks[person]
            if task.waypoints:
                self._walk_to(person, task.waypoints.pop(0))
            elif task.mode is _Mode.WALK_AND_STOP:
                self._stop(person)
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
            self._stop(person)
            task.give_up_s = time_s + 1.0
            return
        self._set_route(person, route)
        length = float(np.hypot(*np.diff(np.vstack([position, route]), axis=0).T).sum())
        self._arrival_radius_m[person] = ARRIVAL_RADIUS_M
        task.give_up_s = time_s + 8.0 + 2.0 * length / self.walking_speed_m_s[person]

    def _set_route(self, person: int, route: FloatArray) -> None:
        self._walk_to(person, route[0])
        self._tasks[person].waypoints = list(route[1:])
        self._movers["speed"][person] = self.walking_speed_m_s[person]

    def _stop(self, person: int) -> None:
        self._movers["speed"][person], self._arrival_radius_m[person] = 0.0, -1.0

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
        self._next_s = min(self._until_s, default=np.inf)

    def update(self, time_s: float) -> None:
        """Advance to a time."""
        if time_s < self._next_s:
            return
        for person, rng in enumerate(self._rngs):
            if time_s < self._until_s[person]:
                continue
            if self.factors[person] > 0.0 and rng.random() < _PAUSES:
                self.factors[person] = 0.0
                self._until_s[person] = time_s + rng.uniform(*_PAUSE_S)
            else:
                self.factors[person] = rng.uniform(*_PACE)
                self._until_s[person] = time_s + self._walk_s(rng)
        self._next_s = min(self._until_s, default=np.inf)

    def _walk_s(self, rng: np.random.Generator) -> float:
        return float(rng.exponential(self._mean_s)) if np.isfinite(self._mean_s) else np.inf
