"""Shortest walks around what stands in the way.

A visibility graph over the corners of the grown footprints (Lozano-Perez and Wesley, 1979), searched with A*. A
corner's row of the graph is computed when the search first reaches it and kept, so a layout costs nothing up front.
"""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap

ROUTE_CLEARANCE_M = 0.40
"""Distance that routes keep from footprints: half a shoulder width and a little room."""


class Routes:
    """Routes over one ground.

    Args:
        ground: What stands where.
        clearance_m: Distance to keep from it, where start and goal themselves keep it.
    """

    def __init__(self, ground: ObstacleMap, clearance_m: float = ROUTE_CLEARANCE_M) -> None:
        self._ground = ground
        self._clearance_m = clearance_m
        corners = ground.grown_corners(clearance_m + 0.03)
        self._nodes = corners[ground.clearance_m(corners) >= clearance_m] if len(corners) else corners
        self._rows: dict[int, NDArray[np.float64]] = {}

    def route(self, start_m: ArrayLike, goal_m: ArrayLike) -> NDArray[np.float64] | None:
        """The shortest walk.

        Args:
            start_m: `(2,)` where it begins.
            goal_m: `(2,)` where it ends.

        Returns:
            `(K, 2)` points to walk through, the goal last, the start left out; None when there is no way.
        """
        start, goal = np.asarray(start_m, dtype=np.float64), np.asarray(goal_m, dtype=np.float64)
        ends = np.vstack([self._nodes, goal[None]])
        first = self._lengths(start, ends, self._margins(start, goal))
        if np.isfinite(first[-1]):
            return goal[None]
        last = self._lengths(goal, self._nodes, self._margins(goal))
        ahead = np.hypot(*(self._nodes - goal).T)
        cost, before = first[:-1].copy(), np.full(len(self._nodes), -1)
        queue = [(cost[node] + ahead[node], int(node)) for node in np.flatnonzero(np.isfinite(cost))]
        heapq.heapify(queue)
        best, best_node, done = np.inf, -1, set[int]()
        while queue:
            bound, node = heapq.heappop(queue)
            if bound >= best:
                break
            if node in done:
                continue
            done.add(node)
            if cost[node] + last[node] < best:
                best, best_node = cost[node] + last[node], node
            through = cost[node] + self._row(node)
            for other in np.flatnonzero(through < cost - 1e-9):
                cost[other], before[other] = through[other], node
                heapq.heappush(queue, (cost[other] + ahead[other], int(other)))
        if best_node < 0:
            return None
        walk = [goal]
        while best_node >= 0:
            walk.append(self._nodes[best_node])
            best_node = int(before[best_node])
        return np.array(walk[::-1])

    def _row(self, node: int) -> NDArray[np.float64]:
        """`(N,)` lengths of the straight walks from one corner to the others; inf where blocked."""
        if node not in self._rows:
            self._rows[node] = self._lengths(self._nodes[node], self._nodes, self._clearance_m)
        return self._rows[node]

    def _lengths(
        self, start: NDArray[np.float64], ends: NDArray[np.float64], margin_m: float | NDArray[np.float64]
    ) -> NDArray[np.float64]:
        if not len(ends):
            return np.zeros(0)
        lengths = np.hypot(*(ends - start).T)
        lengths[self._ground.blocked(start, ends, margin_m)] = np.inf
        return lengths

    def _margins(self, *points: NDArray[np.float64]) -> NDArray[np.float64]:
        """`(F,)` margins: smaller where one of the points already stands nearer, so that it can leave."""
        stacked = np.array(points)
        return np.clip(self._ground.growths_m(stacked).min(axis=0) - 0.01, 0.0, self._clearance_m)
