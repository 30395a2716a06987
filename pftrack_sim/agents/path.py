"""Paths on the ground: straight lines joined by arcs, parametrised by arc length."""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray

_CORNER_M = 1.5
_FAR_M = 1e6
_MIN_LENGTH_M = 1e-6
_REVERSAL_RAD = 3.0


class _Piece(NamedTuple):
    """A line or an arc."""

    x: float
    y: float
    heading: float
    length: float
    curvature: float

    def pose(self, run_m: float) -> tuple[float, float, float]:
        """x, y and heading at a way from its origin."""
        # The chord has the mean heading; its length is that of the arc times sinc(half the turn).
        half = 0.5 * run_m * self.curvature
        chord = run_m * math.sin(half) / half if half else run_m
        middle = self.heading + half
        return self.x + chord * math.cos(middle), self.y + chord * math.sin(middle), middle + half


class Path:
    """A polyline with rounded corners, parametrised by arc length `s` [m].

    Every corner is replaced by the arc that is tangent to both sides, of radius `corner_m`, or smaller where it would
    take more than half of a side. Corners of 3 rad or more stay sharp. The path extends straight before `s = 0` and
    beyond `s = length_m`.

    Args:
        points_m: `(N, 2)` points x, y [m], world frame, at least two different ones; repeated points are dropped.
        corner_m: Radius of the corners; 0 leaves them sharp.

    Raises:
        ParameterError: `points_m` is not of this shape, not finite, or has fewer than two different points.
    """

    def __init__(self, points_m: ArrayLike, corner_m: float = _CORNER_M) -> None:
        self._corners = _distinct(points_m)
        self._corner_m = corner_m
        inner = tuple(_pieces(self._corners, corner_m))
        lengths = [piece.length for piece in inner]
        self.length_m = float(sum(lengths))
        first = inner[0]
        # The extension before the start has its origin at s = 0, so that no digits are lost to a far origin.
        before = _Piece(first.x, first.y, first.heading, _FAR_M, 0.0)
        self._pieces = (before, *inner, _Piece(*inner[-1].pose(inner[-1].length), _FAR_M, 0.0))
        self._origins_m = [0.0, *itertools.accumulate(lengths, initial=0.0)]
        self._first_m = [-_FAR_M, *self._origins_m[1:]]
        self._ends_m = [*self._origins_m[1:], self.length_m + _FAR_M]

    def __eq__(self, other: object) -> bool:
        """Whether it is a path through the same points with the same corners."""
        return isinstance(other, Path) and self._content == other._content

    def __hash__(self) -> int:
        return hash(self._content)

    @property
    def _content(self) -> tuple[bytes, float]:
        return self._corners.tobytes(), self._corner_m

    def pose(self, s_m: float) -> tuple[float, float, float]:
        """x, y [m] and heading [rad, without jumps of 2 pi] at one arc length."""
        index = max(bisect.bisect_right(self._first_m, s_m) - 1, 0)
        return self._pieces[index].pose(s_m - self._origins_m[index])

    def at(self, s_m: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """x, y [m] and heading [rad] as by `pose` at arc lengths, each of the shape of `s_m`."""
        s = np.asarray(s_m, dtype=np.float64)
        poses = np.array([self.pose(one) for one in s.ravel().tolist()]).reshape(*s.shape, 3)
        return poses[..., 0], poses[..., 1], poses[..., 2]

    def beside(self, s_m: float, left_m: float) -> tuple[float, float]:
        """x, y [m] of the point at an arc length, shifted to the left."""
        x, y, heading = self.pose(s_m)
        return x - left_m * math.sin(heading), y + left_m * math.cos(heading)

    def curvature(self, s_m: float) -> float:
        """Curvature [1/m] at an arc length; positive turns left."""
        return self._pieces[max(bisect.bisect_right(self._first_m, s_m) - 1, 0)].curvature

    def bends(self, s_m: float, ahead_m: float) -> Iterable[tuple[float, float]]:
        """First arc lengths [m] and curvatures [1/m] of the lines and arcs from one arc length to this far ahead."""
        for index in range(bisect.bisect_right(self._ends_m, s_m), bisect.bisect_right(self._first_m, s_m + ahead_m)):
            yield self._first_m[index], self._pieces[index].curvature

    def project(self, xy_m: Sequence[float] | FloatArray, near_s_m: float, within_m: float = 2.0) -> float:
        """Arc length of the point nearest to `(2,)` x, y [m] among those within `within_m` of `near_s_m`."""
        x, y = float(xy_m[0]), float(xy_m[1])
        low, high = near_s_m - within_m, near_s_m + within_m
        best_m, least_m = low, math.inf
        for index in range(bisect.bisect_left(self._ends_m, low), bisect.bisect_right(self._first_m, high)):
            piece, origin = self._pieces[index], self._origins_m[index]
            from_x, from_y, heading, _, bend = piece
            start, end = max(self._first_m[index], low), min(self._ends_m[index], high)
            cos, sin, dx, dy = math.cos(heading), math.sin(heading), x - from_x, y - from_y
            s_m = origin + cos * dx + sin * dy
            if bend:
                # The angle about the centre of an arc, at most half a circle from the middle of the arc.
                angle = math.atan2(bend * (s_m - origin), 1.0 - bend * (cos * dy - sin * dx))
                middle = 0.5 * (start + end)
                s_m = middle + math.remainder(origin + angle / bend - middle, 2.0 * math.pi / bend)
            s_m = min(max(s_m, start), end)
            there_x, there_y, _ = piece.pose(s_m - origin)
            distance_m = math.hypot(there_x - x, there_y - y)
            if distance_m < least_m:
                best_m, least_m = s_m, distance_m
        return best_m

    def offset(self, left_m: float) -> Path:
        """The parallel path `left_m` to the left (negative: right), with mitred, then rounded corners."""
        if left_m == 0.0:
            return self
        sides = np.diff(self._corners, axis=0)
        sides = sides / np.linalg.norm(sides, axis=1, keepdims=True)
        normals = np.stack([-sides[:, 1], sides[:, 0]], axis=1)
        # Mitre: along the bisector, longer by 1 / cos(half the turn), up to twice the offset.
        bisectors = normals[:-1] + normals[1:]
        squared = np.maximum(0.5 * (bisectors**2).sum(axis=1, keepdims=True), 0.5)
        shifted = self._corners + left_m * np.concatenate([normals[:1], bisectors / squared, normals[-1:]])
        # A side that is shorter than the inside of its corners would be reversed: it shrinks to a point.
        for index in np.flatnonzero((np.diff(shifted, axis=0) * sides).sum(axis=1) <= 0.0):
            shifted[index : index + 2] = shifted[index : index + 2].mean(axis=0)
        return Path(shifted, self._corner_m)


def _distinct(points_m: ArrayLike) -> FloatArray:
    points: FloatArray = np.array(points_m, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise ParameterError(f"a path needs finite points x, y [m] of shape (N, 2), got {points_m!r}")
    distinct = points[np.hypot(*np.diff(points, axis=0, prepend=np.inf).T) > _MIN_LENGTH_M]
    if len(distinct) < 2:
        raise ParameterError(f"a path needs at least two different points, got {points.tolist()}")
    return distinct


def _pieces(points: FloatArray, corner_m: float) -> Iterable[_Piece]:
    sides = np.diff(points, axis=0)
    lengths = np.hypot(sides[:, 0], sides[:, 1])
    headings = np.unwrap(np.arctan2(sides[:, 1], sides[:, 0]))
    turns = np.diff(headings)
    # Length of both sides that each corner replaces: the tangent length of its arc, at most half a side.
    tangents = np.where(np.abs(turns) < _REVERSAL_RAD, np.tan(0.5 * np.abs(turns)), 0.0)
    room = 0.5 * np.minimum(lengths[:-1], lengths[1:])
    taken = np.concatenate([[0.0], np.minimum(corner_m * tangents, room), [0.0]])
    straights: list[float] = (lengths - taken[:-1] - taken[1:]).tolist()
    # Where the straight part of each side begins, and where it ends.
    begins: list[tuple[float, float]] = (points[:-1] + taken[:-1, None] * sides / lengths[:, None]).tolist()
    ends: list[tuple[float, float]] = (points[1:] - taken[1:, None] * sides / lengths[:, None]).tolist()
    corners = zip(taken[1:-1].tolist(), tangents.tolist(), turns.tolist(), strict=True)
    for begin, end, heading, straight in zip(begins, ends, headings.tolist(), straights, strict=True):
        if straight > _MIN_LENGTH_M:
            yield _Piece(*begin, heading, straight, 0.0)
        cut, tangent, turn = next(corners, (0.0, 0.0, 0.0))
        if cut > _MIN_LENGTH_M:
            radius = cut / tangent
            yield _Piece(*end, heading, radius * abs(turn), math.copysign(1.0 / radius, turn))
