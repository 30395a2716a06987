"""Obstacle map: distances to oriented rectangles on the ground, and tests of straight walks against them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scene.layout import WalkableArea

Xy: TypeAlias = tuple[float, float]  # x, y [m] in the world frame
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

    def distances(self, xy_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signed distance of `(2, N)` points to every rectangle, and the direction away from it.

        Returns:
            `(N, F)` distance [m], negative inside; `(2, N, F)` unit vectors pointing away, world frame.
        """
        local = self._to_local(xy_m[:, :, None] - self._centre[:, None])
        over = np.abs(local) - self._half[:, None]
        away = np.maximum(over, 0.0)
        distance: FloatArray = np.hypot(away[0], away[1])
        length, inside = distance, distance <= 0.0
        if inside.any():
            nearer_u = over[0] > over[1]
            away = np.where(inside, np.array([nearer_u, ~nearer_u]), away)
            length = np.where(inside, 1.0, distance)
            distance = np.where(inside, over.max(axis=0), distance)
        u, v = np.copysign(away / length, local)
        return distance, np.array([self._cos * u - self._sin * v, self._sin * u + self._cos * v])

    def clearance_m(self, points_m: ArrayLike) -> FloatArray:
        """Distance from each of `(N, 2)` points to the nearest rectangle `(N,)` [m], negative inside."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        return self.distances(points.T)[0].min(axis=1)

    def pushed_out(self, point_m: Xy, distance_m: float) -> Xy:
        """The point, shifted away from every rectangle that is nearer than `distance_m`."""
        distance, away = self.distances(np.array(point_m)[:, None])
        lack = np.maximum(distance_m - distance, 0.0)
        if not lack.any():
            return point_m
        x, y = (lack * away).sum(axis=(1, 2)).tolist()
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


def outside_circle(point_m: Xy, centre_m: Sequence[float], radius_m: float) -> Xy:
    """The point, or the nearest point on the circle if it is inside."""
    dx, dy = point_m[0] - centre_m[0], point_m[1] - centre_m[1]
    length = math.hypot(dx, dy)
    if length >= radius_m or length < 1e-9:
        return point_m
    return centre_m[0] + dx * radius_m / length, centre_m[1] + dy * radius_m / length


def limited_step(start_m: Xy, end_m: Xy, length_m: float) -> Xy:
    """The end, or the point at `length_m` on the way to it if it is farther."""
    dx, dy = end_m[0] - start_m[0], end_m[1] - start_m[1]
    length = math.hypot(dx, dy)
    if length <= length_m:
        return end_m
    return start_m[0] + dx * length_m / length, start_m[1] + dy * length_m / length
