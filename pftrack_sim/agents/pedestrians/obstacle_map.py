"""Obstacle map: distances to oriented rectangles on the ground, straight walks between them, and shortest routes.

Routes come from a visibility graph over the corners of the grown footprints (Lozano-Perez and Wesley, 1979), searched
with A*. The edges of a corner are computed, and kept, when the search first expands it.
"""

from __future__ import annotations

import heapq
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.pedestrians.avoidance import RECTANGLE
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scene.layout import WalkableArea

Xy: TypeAlias = tuple[float, float]  # x, y [m] in the world frame
ROUTE_CLEARANCE_M = 0.40  # Distance of routes from footprints: half a shoulder width and some room
_BORDER_HALF_M = 50.0  # Half thickness of the slabs around the walkable area


class ObstacleMap:
    """`F` oriented rectangles: the footprints of a layout in their order, then four slabs around its bounds."""

    def __init__(self, layout: WalkableArea) -> None:
        rows = [(*footprint.centre_m, *footprint.half_m, footprint.yaw_rad) for footprint in layout.footprints]
        self._footprint_count = len(rows)
        x_min, y_min, x_max, y_max = layout.bounds_m
        x_mid, y_mid, half = 0.5 * (x_min + x_max), 0.5 * (y_min + y_max), _BORDER_HALF_M
        reach_x, reach_y = 0.5 * (x_max - x_min) + 2 * half, 0.5 * (y_max - y_min) + 2 * half
        rows += [(x, y_mid, half, reach_y, 0.0) for x in (x_min - half, x_max + half)]
        rows += [(x_mid, y, reach_x, half, 0.0) for y in (y_min - half, y_max + half)]
        table: FloatArray = np.array(rows, dtype=np.float64).T.copy()
        self._centre, self._half = table[:2], table[2:4]
        self._cos: FloatArray = np.cos(table[4])
        self._sin: FloatArray = np.sin(table[4])
        self.rectangles = np.zeros(len(rows), RECTANGLE)
        columns = (*table[:4], self._cos, self._sin, np.hypot(*self._half))
        for name, column in zip(RECTANGLE.names or (), columns, strict=True):
            self.rectangles[name] = column

    def distances(self, xy_m: FloatArray) -> FloatArray:
        """`(N, F)` signed distances of `(2, N)` points to every rectangle [m], negative inside."""
        over = np.abs(self._to_local(xy_m[:, :, None] - self._centre[:, None])) - self._half[:, None]
        inside = np.minimum(np.maximum(over[0], over[1]), 0.0)
        np.maximum(over, 0.0, out=over)
        return np.sqrt(over[0] * over[0] + over[1] * over[1]) + inside

    def directions(self, xy_m: FloatArray) -> FloatArray:
        """`(2, N, F)` unit vectors away from every rectangle at `(2, N)` points; inside, to its nearest edge."""
        local = self._to_local(xy_m[:, :, None] - self._centre[:, None])
        over = np.abs(local) - self._half[:, None]
        nearest = over.max(axis=0)
        to_edge = np.where(nearest > 0.0, np.maximum(over, 0.0), over == nearest)
        u, v = np.copysign(to_edge / np.hypot(*to_edge), local)
        return np.array([self._cos * u - self._sin * v, self._sin * u + self._cos * v])

    def clearance_m(self, points_m: ArrayLike) -> FloatArray:
        """Distance from each of `(N, 2)` points to the nearest rectangle `(N,)` [m], negative inside."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        return self.distances(points.T).min(axis=1)

    def pushed_out(self, point_m: Xy, distance_m: float) -> Xy:
        """The point, shifted away from every rectangle that is nearer than `distance_m`."""
        point = np.array(point_m)[:, None]
        lack = np.maximum(distance_m - self.distances(point), 0.0)
        if not lack.any():
            return point_m
        x, y = (lack * self.directions(point)).sum(axis=(1, 2)).tolist()
        return point_m[0] + x, point_m[1] + y

    def margins_reaching(self, points_m: FloatArray) -> FloatArray:
        """Margin by which each rectangle must grow on every side to reach each of `(N, 2)` points: `(N, F)` [m]."""
        local = self._to_local(points_m.T[:, :, None] - self._centre[:, None])
        return (np.abs(local) - self._half[:, None]).max(axis=0)

    def blocked(self, start_m: ArrayLike, ends_m: ArrayLike, margin_m: float | FloatArray) -> BoolArray:
        """Whether straight walks from a `(2,)` start to `(N, 2)` ends touch a rectangle: `(N,)`, by the slab test.

        The rectangles are grown by a margin [m] on every side, a number or `(F,)`.
        """
        start = np.asarray(start_m, dtype=np.float64)
        steps = np.asarray(ends_m, dtype=np.float64).reshape(-1, 2) - start
        local_start = self._to_local(start[:, None] - self._centre)[:, None]
        local_steps = self._to_local(steps.T[:, :, None])
        local_steps = np.where(np.abs(local_steps) < 1e-12, 1e-12, local_steps)
        # Per axis: share of the walk at the rectangle's middle, and half the share that is between its sides.
        middle, span = -local_start / local_steps, (self._half[:, None] + margin_m) / np.abs(local_steps)
        enter = np.maximum((middle - span).max(axis=0), 0.0)
        leave = np.minimum((middle + span).min(axis=0), 1.0)
        return (enter < leave).any(axis=1)

    def grown_corners(self, margin_m: float) -> FloatArray:
        """`(N, 2)` corners of the footprints, grown by a margin [m]."""
        signs = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)], dtype=np.float64).T
        (x, y), (u, v) = self._centre[:, None], signs[:, :, None] * (self._half[:, None] + margin_m)
        corners = np.array([x + self._cos * u - self._sin * v, y + self._sin * u + self._cos * v])
        return corners[:, :, : self._footprint_count].T.reshape(-1, 2)

    def _to_local(self, offset: FloatArray) -> FloatArray:
        """World vectors `(2, ..., F)` in the axes of the rectangles."""
        x, y = offset
        return np.array([self._cos * x + self._sin * y, self._cos * y - self._sin * x])


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
