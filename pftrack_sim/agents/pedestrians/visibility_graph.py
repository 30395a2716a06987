"""Shortest walks around obstacles.

A visibility graph over the corners of the grown footprints (Lozano-Perez and Wesley, 1979), searched with A*. The edges
of a corner are computed, and kept, when the search first expands it.
"""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.core.types import FloatArray

ROUTE_CLEARANCE_M = 0.40  # Distance of routes from footprints: half a shoulder width and some room


class VisibilityGraph:
    """Shortest walks over one obstacle map, at `ROUTE_CLEARANCE_M` from obstacles."""

    def __init__(self, obstacles: ObstacleMap) -> None:
        self.obstacles = obstacles
        corners = obstacles.grown_corners(ROUTE_CLEARANCE_M + 0.03)
        self._nodes = corners[obstacles.clearance_m(corners) >= ROUTE_CLEARANCE_M]
        self._edges: dict[int, FloatArray] = {}

    def shortest_route(self, start_m: ArrayLike, goal_m: ArrayLike) -> FloatArray | None:
        """`(K, 2)` waypoints from a `(2,)` start (excluded) to a `(2,)` goal (included); None without a route."""
        start, goal = np.asarray(start_m, dtype=np.float64), np.asarray(goal_m, dtype=np.float64)
        from_start = self._lengths(start, np.vstack([self._nodes, goal]), self._margins(start, goal))
        if np.isfinite(from_start[-1]):
            return goal[None]
        to_goal = self._lengths(goal, self._nodes, self._margins(goal))
        lower_bound = np.hypot(*(self._nodes - goal).T)
        cost, previous = from_start[:-1].copy(), np.full(len(self._nodes), -1)
        queue = [(cost[node] + lower_bound[node], int(node)) for node in np.flatnonzero(np.isfinite(cost))]
        heapq.heapify(queue)
        best_cost, last, expanded = np.inf, -1, set[int]()
        while queue:
            bound, node = heapq.heappop(queue)
            if bound >= best_cost:
                break
            if node in expanded:
                continue
            expanded.add(node)
            if cost[node] + to_goal[node] < best_cost:
                best_cost, last = cost[node] + to_goal[node], node
            if node not in self._edges:
                self._edges[node] = self._lengths(self._nodes[node], self._nodes, ROUTE_CLEARANCE_M)
            through = cost[node] + self._edges[node]
            for other in np.flatnonzero(through < cost - 1e-9):
                cost[other], previous[other] = through[other], node
                heapq.heappush(queue, (cost[other] + lower_bound[other], int(other)))
        if last < 0:
            return None
        route = [goal]
        while last >= 0:
            route.append(self._nodes[last])
            last = int(previous[last])
        return np.array(route[::-1])

    def _lengths(self, start: FloatArray, ends: FloatArray, margin_m: float | FloatArray) -> FloatArray:
        """`(N,)` lengths of the straight walks to `(N, 2)` ends [m]; infinite where blocked."""
        lengths = np.hypot(*(ends - start).T)
        lengths[self.obstacles.blocked(start, ends, margin_m)] = np.inf
        return lengths

    def _margins(self, *points: FloatArray) -> FloatArray:
        """`(F,)` clearances [m], reduced where one of the points is nearer to a rectangle, so that it can get away."""
        margins = self.obstacles.margins_reaching(np.array(points)).min(axis=0)
        return np.clip(margins - 0.01, 0.0, ROUTE_CLEARANCE_M)
