"""What people are about: where each one goes next, and what happens on arrival or when there is no getting on."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.agents.pedestrians.goal_sampler import GoalSampler
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.agents.pedestrians.routes import ROUTE_CLEARANCE_M, Routes

Array = NDArray[np.float64]

ARRIVE_M = 0.7
"""A point of a route is reached from this near."""

_LOOK_S = 0.1
"""Time from looking after one person to looking after the next."""

_STUCK_S = 4.0
_STUCK_M = 0.6
"""Who gets no farther than this in this time goes somewhere else."""


class GoalManager:
    """Routes of everyone who yields.

    Args:
        ground: What stands where.
        routes: Walks over it.
        places: Where one may want to go.
        rngs: One generator per person after the target.
        near_target: Which persons have errands near the target, `(P,)`.

    Attributes:
        way_m: `(2, P)` next point of each one's route.
        pace_m_s: `(P,)` speed each one wants now.
        speed_m_s: `(P,)` speed each one walks at.
    """

    def __init__(
        self,
        ground: ObstacleMap,
        routes: Routes,
        places: GoalSampler,
        rngs: Sequence[np.random.Generator],
        near_target: Sequence[bool],
    ) -> None:
        people = len(near_target)
        self._ground, self._routes, self._places = ground, routes, places
        self._rngs, self._near_target = rngs, near_target
        self.way_m = np.zeros((2, people))
        self.pace_m_s = np.zeros(people)
        self.speed_m_s = np.zeros(people)
        self._left: list[list[tuple[float, float]]] = [[] for _ in range(people)]
        self._arrive_m = np.full(people, ARRIVE_M)
        self._give_up_s = np.full(people, np.inf)
        self._mark = np.zeros((3, people))
        self._stages: dict[int, Array] = {}
        self._leaving: set[int] = set()
        self._since_look_s = 0.0
        self._looked_at = 0

    def wait_at(self, person: int, stage_m: Array) -> None:
        """Stay at a place, and come back to it."""
        self._stages[person] = stage_m
        self.way_m[:, person] = stage_m
        self.pace_m_s[person], self._arrive_m[person] = self.speed_m_s[person], -1.0

    def set_out(
        self, person: int, time_s: float, here_m: Array, target_s_m: float, heading_rad: float | None = None
    ) -> None:
        """A new place to go, drawn from the person's own stream; ahead rather than behind if there is a heading."""
        near_s_m = target_s_m if self._near_target[person] else None
        route = self._places.errand(self._rngs[person - 1], here_m.copy(), heading_rad, near_s_m)
        self.send(person, time_s, here_m, route)

    def leave(self, person: int, time_s: float, here_m: Array, route_m: Array | None) -> None:
        """Walk a route and stay where it ends."""
        self.send(person, time_s, here_m, route_m)
        self._leaving.add(person)

    def send(self, person: int, time_s: float, here_m: Array, route_m: Array | None) -> None:
        """Walk a route; with none, stay and think again in a while."""
        self._stages.pop(person, None)
        self._mark[:, person] = (*here_m, time_s)
        if route_m is None:
            self.way_m[:, person] = here_m
            self.pace_m_s[person], self._arrive_m[person] = 0.0, -1.0
            self._give_up_s[person] = time_s + 1.0
            return
        self._take(person, here_m, route_m)
        length = float(np.hypot(*np.diff(np.vstack([here_m, route_m]), axis=0).T).sum())
        self._arrive_m[person] = ARRIVE_M
        self._give_up_s[person] = time_s + 8.0 + 2.0 * length / self.speed_m_s[person]

    def tend(
        self, dt_s: float, time_s: float, who: NDArray[np.intp], state: Array, heading_rad: Array, target_s_m: float
    ) -> None:
        """Next points for those who have arrived; now and then see whether one person could do better.

        Args:
            dt_s: Length of the tick.
            time_s: Time at its end.
            who: Persons who yield.
            state: `(4, P + 1)` everyone's x, y, vx, vy.
            heading_rad: `(P,)` where they face.
            target_s_m: How far the target is along its path.
        """
        gap = np.hypot(self.way_m[0, who] - state[0, who], self.way_m[1, who] - state[1, who])
        arrived = gap < self._arrive_m[who]
        if arrived.any():
            for person in who[arrived].tolist():
                if self._left[person]:
                    self.way_m[:, person] = self._left[person].pop(0)
                elif person in self._leaving:
                    self.pace_m_s[person], self._arrive_m[person] = 0.0, -1.0
                else:
                    self.set_out(person, time_s, state[:2, person], target_s_m, float(heading_rad[person]))
        self._since_look_s += dt_s
        if self._since_look_s + 1e-9 < _LOOK_S:
            return
        self._since_look_s = 0.0
        self._looked_at = (self._looked_at + 1) % len(who)
        self._look_after(int(who[self._looked_at]), time_s, state, target_s_m)

    def _look_after(self, person: int, time_s: float, state: Array, target_s_m: float) -> None:
        here, left = state[:2, person], self._left[person]
        if left and not self._ground.blocked(here, left[:1], ROUTE_CLEARANCE_M)[0]:
            # The next point but one is in sight: no need to touch every corner.
            self.way_m[:, person] = left.pop(0)
        if person in self._stages:
            self._find_back(person, here)
            return
        if person in self._leaving and self.pace_m_s[person] == 0.0:
            return
        x, y, since_s = self._mark[:, person]
        if math.hypot(here[0] - x, here[1] - y) > _STUCK_M:
            self._mark[:, person] = (*here, time_s)
            since_s = time_s
        if time_s - since_s > _STUCK_S or time_s > self._give_up_s[person]:
            self.set_out(person, time_s, here, target_s_m)

    def _find_back(self, person: int, here: Array) -> None:
        """The way back to where one waits, around things if need be."""
        stage = self._stages[person]
        if self._left[person]:
            return
        if not self._ground.blocked(here, stage[None], 0.0)[0]:
            self.way_m[:, person] = stage
            return
        route = self._routes.route(here, stage)
        if route is not None:
            self._take(person, here, route)

    def _take(self, person: int, here_m: Array, route_m: Array) -> None:
        points = [(float(x), float(y)) for x, y in route_m]
        self.way_m[:, person] = points[0]
        self._left[person] = points[1:]
        self.pace_m_s[person] = self.speed_m_s[person]
