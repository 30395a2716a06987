"""Where people stand at the start and where they want to go next: draws from each person's own stream."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.agents.pedestrians.oncoming import positions_away_from
from pftrack_sim.agents.pedestrians.routes import ROUTE_CLEARANCE_M, Routes

if TYPE_CHECKING:
    from pftrack_sim.agents.path import Path

Array = NDArray[np.float64]

START_GAP_M = 1.0
"""People start at least this far apart."""

WALK_OFF_S = tuple(float(t) for t in np.arange(1.0, 9.0, 0.5))
"""Times ahead that someone who walks off thinks of."""

_ELBOW_ROOM_M = 2.0
"""Who walks aside looks for a place where nobody is this near."""

_WALK_OFF_M_S = 1.2

_NEAR_TARGET_CHANCE = 0.5
"""Share of errands that lead to where the target will be: strangers who really come into view."""


class GoalSampler:
    """The free places of a layout, as seen by people with a target's path in mind.

    Args:
        ground: What stands where.
        routes: Walks over it.
        bounds_m: x_min, y_min, x_max, y_max.
        goals_m: Points people walk between; those that are not free are dropped.
        target_path: Where the target walks.
    """

    def __init__(
        self,
        ground: ObstacleMap,
        routes: Routes,
        bounds_m: tuple[float, float, float, float],
        goals_m: Sequence[tuple[float, float]],
        target_path: Path,
    ) -> None:
        self._ground, self._routes, self._path = ground, routes, target_path
        self._low, self._high = np.array(bounds_m[:2]), np.array(bounds_m[2:])
        goals = np.asarray(goals_m, dtype=np.float64).reshape(-1, 2)
        self.goals_m = goals[ground.clearance_m(goals) >= ROUTE_CLEARANCE_M] if len(goals) else goals
        s = np.linspace(0.0, target_path.length_m, max(2, round(target_path.length_m / 0.4)))
        x, y, _ = target_path.at(s)
        self.track_m: Array = np.stack([x, y], axis=1)

    def free(self, point_m: ArrayLike) -> bool:
        """Whether a person can stand at a point without touching anything."""
        return bool(self._ground.clearance_m(point_m)[0] >= ROUTE_CLEARANCE_M)

    def beside_target(self, s_m: float, left_m: float) -> Array:
        """`(2,)` point beside the target's path."""
        x, y, heading = self._path.at(min(max(s_m, 0.0), self._path.length_m))
        return np.array([float(x) - left_m * np.sin(heading), float(y) + left_m * np.cos(heading)])

    def start(self, rng: np.random.Generator, taken_m: Sequence[Array]) -> Array:
        """`(2,)` where a stranger starts: near the target's path or anywhere, apart from those `taken_m`."""
        best, best_gap = self.track_m[0], -np.inf
        for attempt in range(200):
            if rng.random() < 0.6:
                point = self.beside_target(
                    rng.uniform(0.0, self._path.length_m), rng.choice((-1, 1)) * rng.uniform(0.8, 3.5)
                )
            else:
                point = rng.uniform(self._low, self._high)
            if not self.free(point):
                continue
            gap = min(float(np.hypot(*(point - other))) for other in taken_m)
            if gap >= START_GAP_M and (attempt > 100 or self._reaches_goal(point)):
                return point
            if gap > best_gap:
                best, best_gap = point, gap
        return best

    def errand(
        self, rng: np.random.Generator, position_m: Array, heading_rad: float | None, target_s_m: float | None
    ) -> Array | None:
        """A walk to a new goal.

        Args:
            rng: The person's own stream.
            position_m: `(2,)` where it begins.
            heading_rad: Where the person faces: goals ahead are preferred; None if it does not matter.
            target_s_m: How far the target is along its path: half of the errands lead to where it will be; None for
                none of them.

        Returns:
            `(K, 2)` points to walk through; None when nothing can be reached.
        """
        for attempt in range(16):
            goal = self._draw_goal(rng, target_s_m)
            way = goal - position_m
            length = float(np.hypot(*way))
            if length < (5.0 if attempt < 8 else 2.0) or not self.free(goal):
                continue
            if heading_rad is not None and attempt < 8:
                onward = way[0] * np.cos(heading_rad) + way[1] * np.sin(heading_rad)
                if onward < -0.3 * length:
                    continue
            route = self._routes.route(position_m, goal)
            if route is not None:
                return route
        return None

    def walk_off(self, position_m: Array, velocity_m_s: Array, camera_m: Array, target_m: Array) -> Array | None:
        """A walk straight on, as far as that does not stay between camera and target.

        Args:
            position_m: `(2,)` where it begins.
            velocity_m_s: `(2,)` of the walker.
            camera_m: `(K, 2)` where the camera will be at `WALK_OFF_S`.
            target_m: `(K, 2)` where the target will be.

        Returns:
            `(K, 2)` points to walk through; None when nothing can be reached.
        """
        angles = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
        around = position_m + 8.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        choices = np.vstack([self.goals_m, np.clip(around, self._low + 0.6, self._high - 0.6)])
        way = choices - position_m
        length = np.hypot(*way.T) + 1e-9
        onward = (way @ velocity_m_s) / (length * max(float(np.hypot(*velocity_m_s)), 1e-6))
        run = np.minimum(_WALK_OFF_M_S * np.array(WALK_OFF_S), length[:, None]) / length[:, None]
        offset = position_m + run[..., None] * way[:, None] - camera_m
        sight = target_m - camera_m
        distance = np.maximum(np.hypot(*sight.T), 1e-6)
        along = (offset * sight).sum(axis=2) / distance
        across = (sight[:, 0] * offset[..., 1] - sight[:, 1] * offset[..., 0]) / distance
        between = (np.abs(across) < 0.5) & (along > 0.0) & (along < distance)
        score = onward - 4.0 * between.mean(axis=1) - 2.0 * (length < 2.5)
        for index in np.argsort(-score, kind="stable")[:8]:
            if self.free(choices[index]):
                route = self._routes.route(position_m, choices[index])
                if route is not None:
                    return route
        return None

    def walk_aside(self, position_m: Array, heading_rad: float, others_m: Array) -> Array | None:
        """A walk to a place well away from the target's path, ahead rather than behind.

        Args:
            position_m: `(2,)` where it begins.
            heading_rad: Where the person faces.
            others_m: `(N, 2)` where others are.

        Returns:
            `(K, 2)` points to walk through; None when nothing can be reached.
        """
        goals = positions_away_from(self._path, self._ground, (*self._low.tolist(), *self._high.tolist()))
        goals = goals[np.hypot(*(goals[:, None] - others_m).transpose(2, 0, 1)).min(axis=1) > _ELBOW_ROOM_M]
        way = goals - position_m
        onward = way @ (np.cos(heading_rad), np.sin(heading_rad))
        for index in np.argsort(np.hypot(*way.T) - 2.0 * onward, kind="stable")[:8]:
            route = self._routes.route(position_m, goals[index])
            if route is not None:
                return route
        return None

    def waiting_position(self, wanted_m: Array, taken_m: Sequence[Array]) -> Array:
        """`(2,)` the free position nearest to the wanted one that is at least 0.8 m from all `taken_m`."""
        for radius in (0.0, 0.4, 0.8, 1.2, 1.7, 2.3, 3.0, 4.0, 5.5, 7.5):
            for step in range(12 if radius else 1):
                angle = step * np.pi / 6.0
                point = wanted_m + radius * np.array([np.cos(angle), np.sin(angle)])
                apart = all(np.hypot(*(point - other)) >= 0.8 for other in taken_m)
                if apart and self.free(point):
                    return point
        return wanted_m

    def _draw_goal(self, rng: np.random.Generator, target_s_m: float | None) -> Array:
        if rng.random() < _NEAR_TARGET_CHANCE and target_s_m is not None:
            return self.beside_target(target_s_m + rng.uniform(3.0, 14.0), rng.normal(0.0, 2.0))
        if len(self.goals_m):
            return self.goals_m[int(rng.integers(len(self.goals_m)))]
        return rng.uniform(self._low, self._high)

    def _reaches_goal(self, point_m: Array) -> bool:
        """Whether a place is connected to the rest: not a closed pocket between things."""
        anchors = self.goals_m[:3] if len(self.goals_m) else self.track_m[:1]
        return any(self._routes.route(point_m, anchor) is not None for anchor in anchors)
