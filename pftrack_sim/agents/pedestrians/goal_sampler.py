"""Sampling of start positions and goals, from each pedestrian's own random stream."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.obstacle_map import ROUTE_CLEARANCE_M, VisibilityGraph
from pftrack_sim.agents.pedestrians.oncoming import positions_away_from
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.layout import WalkableArea

PREDICTION_TIMES_S = tuple(np.arange(1.0, 9.0, 0.5).tolist())
"""Times ahead at which `route_off_line_of_sight` is given camera and target positions."""

_START_DISTANCE_M = 1.0  # Least distance between start positions.
_OFF_SPEED_M_S = 1.2
_ASIDE_DISTANCE_M = 2.0  # Least distance from other pedestrians of a goal aside of the target's path.
_NEAR_TARGET_PROBABILITY = 0.5  # Share of goals near the target's future positions: distractors come into view.


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
        from_camera = position_m + walked[..., None] * offset[:, None] - camera_m
        sight = target_m - camera_m
        distance = np.maximum(np.hypot(*sight.T), 1e-6)
        along = (from_camera * sight).sum(axis=2) / distance
        across = (sight[:, 0] * from_camera[..., 1] - sight[:, 1] * from_camera[..., 0]) / distance
        between = (np.abs(across) < 0.5) & (along > 0.0) & (along < distance)
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
