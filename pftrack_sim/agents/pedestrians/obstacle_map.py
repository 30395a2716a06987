"""Obstacle map: distances to oriented rectangles on the ground, and tests of straight walks against them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scene.layout import WalkableArea

Xy: TypeAlias = tuple[float, float]
"""x, y [m] in the world frame."""

_BORDER_HALF_M = 50.0
"""Half thickness of the slabs around the walkable area."""


class ObstacleMap:
    """`F` oriented rectangles: the footprints of a layout in their order, then the four slabs around its bounds.

    Args:
        layout: Walkable area and the footprints in it.

    Attributes:
        count: Number of rectangles, `F`.
    """

    def __init__(self, layout: WalkableArea) -> None:
        rows = [(*footprint.centre_m, *footprint.half_m, footprint.yaw_rad) for footprint in layout.footprints]
        x_min, y_min, x_max, y_max = layout.bounds_m
        x_mid, y_mid = 0.5 * (x_min + x_max), 0.5 * (y_min + y_max)
        reach_x, reach_y = 0.5 * (x_max - x_min) + 2 * _BORDER_HALF_M, 0.5 * (y_max - y_min) + 2 * _BORDER_HALF_M
        rows += [
            (x_min - _BORDER_HALF_M, y_mid, _BORDER_HALF_M, reach_y, 0.0),
            (x_max + _BORDER_HALF_M, y_mid, _BORDER_HALF_M, reach_y, 0.0),
            (x_mid, y_min - _BORDER_HALF_M, reach_x, _BORDER_HALF_M, 0.0),
            (x_mid, y_max + _BORDER_HALF_M, reach_x, _BORDER_HALF_M, 0.0),
        ]
        table = np.array(rows, dtype=np.float64)
        self.count = len(rows)
        self._footprint_count = len(layout.footprints)
        self._x, self._y, self._half_u, self._half_v = table[:, :4].T.copy()
        self._cos, self._sin = np.cos(table[:, 4]), np.sin(table[:, 4])

    def distances(self, xy_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signed distance of `(2, N)` points to every rectangle, and the direction away from it.

        Returns:
            `(N, F)` distance [m], negative inside; `(2, N, F)` unit vectors pointing away, world frame.
        """
        u, v = self._rotated(xy_m[0][:, None] - self._x, xy_m[1][:, None] - self._y)
        over_u, over_v = np.abs(u) - self._half_u, np.abs(v) - self._half_v
        out_u, out_v = np.maximum(over_u, 0.0), np.maximum(over_v, 0.0)
        distance = length = np.hypot(out_u, out_v)
        inside = distance <= 0.0
        if inside.any():
            nearer_u = over_u > over_v
            out_u = np.where(inside, nearer_u, out_u)
            out_v = np.where(inside, ~nearer_u, out_v)
            length = np.where(inside, 1.0, distance)
            distance = np.where(inside, np.maximum(over_u, over_v), distance)
        away_u = np.copysign(out_u / length, u)
        away_v = np.copysign(out_v / length, v)
        away = (self._cos * away_u - self._sin * away_v, self._sin * away_u + self._cos * away_v)
        return distance, np.stack(away)

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

    def margins_reaching(self, points_m: ArrayLike) -> FloatArray:
        """Margin by which each rectangle must grow on every side to reach each of `(N, 2)` points: `(N, F)` [m]."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        u, v = self._rotated(points[:, :1] - self._x, points[:, 1:] - self._y)
        return np.maximum(np.abs(u) - self._half_u, np.abs(v) - self._half_v)

    def blocked(self, start_m: ArrayLike, ends_m: ArrayLike, margin_m: float | FloatArray) -> BoolArray:
        """Whether straight walks from one point touch a rectangle that is grown by a margin (slab test).

        Args:
            start_m: `(2,)` start of all walks.
            ends_m: `(N, 2)` their ends.
            margin_m: Growth of the rectangles on every side [m]: a number, or `(F,)`.

        Returns:
            `(N,)`, true where the walk is blocked.
        """
        start = np.asarray(start_m, dtype=np.float64)
        step = np.asarray(ends_m, dtype=np.float64).reshape(-1, 2) - start
        u, v = self._rotated(start[0] - self._x, start[1] - self._y)
        du, dv = self._rotated(step[:, :1], step[:, 1:])
        du, dv = np.where(np.abs(du) < 1e-12, 1e-12, du), np.where(np.abs(dv) < 1e-12, 1e-12, dv)
        # Shares of the walk at which it is level with the middle of each rectangle, and half the shares it is within.
        middle_u, span_u = -u / du, (self._half_u + margin_m) / np.abs(du)
        middle_v, span_v = -v / dv, (self._half_v + margin_m) / np.abs(dv)
        enter = np.maximum(np.maximum(middle_u - span_u, middle_v - span_v), 0.0)
        leave = np.minimum(np.minimum(middle_u + span_u, middle_v + span_v), 1.0)
        return (enter < leave).any(axis=1)

    def grown_corners(self, margin_m: float) -> FloatArray:
        """`(N, 2)` corners of the footprints, grown by a margin [m]."""
        count = self._footprint_count
        signs = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)], dtype=np.float64)
        u = signs[:, 0] * (self._half_u[:count, None] + margin_m)
        v = signs[:, 1] * (self._half_v[:count, None] + margin_m)
        cos, sin = self._cos[:count, None], self._sin[:count, None]
        x, y = self._x[:count, None] + cos * u - sin * v, self._y[:count, None] + sin * u + cos * v
        return np.stack([x.ravel(), y.ravel()], axis=1)

    def _rotated(self, dx: FloatArray, dy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """World offsets in the axes of the rectangles."""
        return self._cos * dx + self._sin * dy, self._cos * dy - self._sin * dx


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
