"""The ground people stand on: how far it is to the nearest thing, and whether a straight walk is free."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.scene.layout import WalkableArea

Array = NDArray[np.float64]

_BORDER_HALF_M = 50.0
"""Half thickness of the slabs beyond the walkable area: thicker than anyone could walk through."""


class ObstacleMap:
    """Upright boxes seen from above: the footprints of a layout, and the border of its walkable area.

    Args:
        layout: Walkable area and what stands in it.

    Attributes:
        count: Number of rectangles, `F`: the footprints in their order, then four of the border.
        footprint_count: How many of them are footprints.
    """

    def __init__(self, layout: WalkableArea) -> None:
        rows = [(*print_.centre_m, *print_.half_m, print_.yaw_rad) for print_ in layout.footprints]
        self.footprint_count = len(rows)
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
        self._x, self._y, self._hx, self._hy = table[:, :4].T.copy()
        self._cos, self._sin = np.cos(table[:, 4]), np.sin(table[:, 4])

    def distances(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        """Signed distance to every rectangle and the direction away from it.

        Args:
            x: `(N,)` world x [m].
            y: `(N,)` world y [m].

        Returns:
            `(N, F)` distance [m], negative inside; `(N, F)` x and `(N, F)` y of the unit vector pointing away.
        """
        dx, dy = x[:, None] - self._x, y[:, None] - self._y
        u = self._cos * dx + self._sin * dy
        v = self._cos * dy - self._sin * dx
        over_u, over_v = np.abs(u) - self._hx, np.abs(v) - self._hy
        out_u, out_v = np.maximum(over_u, 0.0), np.maximum(over_v, 0.0)
        outside = np.hypot(out_u, out_v)
        inside = outside <= 0.0
        if inside.any():
            nearer_u = over_u > over_v
            out_u = np.where(inside, nearer_u, out_u)
            out_v = np.where(inside, ~nearer_u, out_v)
            distance = np.where(inside, np.maximum(over_u, over_v), outside)
            length = np.where(inside, 1.0, outside)
        else:
            distance = length = outside
        away_u = np.copysign(out_u / length, u)
        away_v = np.copysign(out_v / length, v)
        return distance, self._cos * away_u - self._sin * away_v, self._sin * away_u + self._cos * away_v

    def clearance_m(self, points_m: ArrayLike) -> Array:
        """Distance from each of `(N, 2)` points to the nearest rectangle `(N,)` [m], negative inside."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        return self.distances(points[:, 0], points[:, 1])[0].min(axis=1)

    def outside(self, point_m: tuple[float, float], gap_m: float) -> tuple[float, float]:
        """The point, or one nearby that keeps a gap to every rectangle."""
        x, y = np.array([point_m[0]]), np.array([point_m[1]])
        distance, away_x, away_y = self.distances(x, y)
        lack = np.maximum(gap_m - distance, 0.0)
        if not lack.any():
            return point_m
        return point_m[0] + float((lack * away_x).sum()), point_m[1] + float((lack * away_y).sum())

    def growths_m(self, points_m: ArrayLike) -> Array:
        """How much each rectangle must grow on every side to reach each of `(N, 2)` points: `(N, F)` [m]."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        dx, dy = points[:, :1] - self._x, points[:, 1:] - self._y
        u, v = self._cos * dx + self._sin * dy, self._cos * dy - self._sin * dx
        return np.maximum(np.abs(u) - self._hx, np.abs(v) - self._hy)

    def blocked(self, start_m: ArrayLike, ends_m: ArrayLike, margin_m: float | Array) -> NDArray[np.bool_]:
        """Whether straight walks from one point touch a rectangle grown by a margin.

        Args:
            start_m: `(2,)` where the walks begin.
            ends_m: `(N, 2)` where they end.
            margin_m: How much every rectangle grows on each side; a number, or `(F,)`.

        Returns:
            `(N,)`, true where the walk is blocked.
        """
        start = np.asarray(start_m, dtype=np.float64)
        ends = np.asarray(ends_m, dtype=np.float64).reshape(-1, 2)
        x, y = start[0] - self._x, start[1] - self._y
        u, v = self._cos * x + self._sin * y, self._cos * y - self._sin * x
        step = ends - start
        du = step[:, :1] * self._cos + step[:, 1:] * self._sin
        dv = step[:, 1:] * self._cos - step[:, :1] * self._sin
        du, dv = np.where(np.abs(du) < 1e-12, 1e-12, du), np.where(np.abs(dv) < 1e-12, 1e-12, dv)
        # Slab test: the share of the walk between the two sides along each axis of the rectangle.
        at_u, span_u = -u / du, (self._hx + margin_m) / np.abs(du)
        at_v, span_v = -v / dv, (self._hy + margin_m) / np.abs(dv)
        enter = np.maximum(np.maximum(at_u - span_u, at_v - span_v), 0.0)
        leave = np.minimum(np.minimum(at_u + span_u, at_v + span_v), 1.0)
        return (enter < leave).any(axis=1)

    def grown_corners(self, margin_m: float) -> Array:
        """`(4 * footprint_count, 2)` corners of the footprints grown by a margin [m]."""
        count = self.footprint_count
        if not count:
            return np.zeros((0, 2))
        signs = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)], dtype=np.float64)
        u = signs[:, 0] * (self._hx[:count, None] + margin_m)
        v = signs[:, 1] * (self._hy[:count, None] + margin_m)
        cos, sin = self._cos[:count, None], self._sin[:count, None]
        x, y = self._x[:count, None] + cos * u - sin * v, self._y[:count, None] + sin * u + cos * v
        return np.stack([x.ravel(), y.ravel()], axis=1)
