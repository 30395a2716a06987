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
from pftrack_sim.core.types import FloatArray, IntArray

_CORNER_M = 1.5
_MIN_LENGTH_M = 1e-6
_REVERSAL_RAD = 3.0


class _Piece(NamedTuple):
    """A line or an arc from a point on."""

    x: float
    y: float
    heading: float
    length: float
    curvature: float

    def pose(self, run_m: float) -> tuple[float, float, float]:
        """x, y and heading at a way from its beginning."""
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
        self._corners, self._corner_m = _distinct(points_m), corner_m
        # The first and the last piece are lines.
        self._pieces = tuple(_pieces(self._corners, corner_m))
        *self._begins_m, self.length_m = itertools.accumulate([piece.length for piece in self._pieces], initial=0.0)
        self._table: FloatArray = np.array([*zip(*self._pieces, strict=True), self._begins_m])

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
        index = max(bisect.bisect_right(self._begins_m, s_m) - 1, 0)
        return self._pieces[index].pose(s_m - self._begins_m[index])

    @property
    def points_m(self) -> FloatArray:
        """`(N, 2)` the points that it goes through, with the corners that are rounded."""
        return self._corners.copy()

    def at(self, s_m: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """x, y [m] and heading [rad] as by `pose` at arc lengths, each of the shape of `s_m`."""
        s = np.asarray(s_m, dtype=np.float64)
        x, y, heading, _, curvature, begin_m = self._table[:, self._index(s)]
        half = 0.5 * (s - begin_m) * curvature
        chord, middle = (s - begin_m) * np.sinc(half / np.pi), heading + half
        return x + chord * np.cos(middle), y + chord * np.sin(middle), middle + half

    def beside(self, s_m: float, left_m: float) -> tuple[float, float]:
        """x, y [m] of the point at an arc length, shifted to the left."""
        x, y, heading = self.pose(s_m)
        return x - left_m * math.sin(heading), y + left_m * math.cos(heading)

    def curvature(self, s_m: ArrayLike) -> FloatArray:
        """Curvature [1/m] at arc lengths, of their shape; positive turns left."""
        return self._table[4, self._index(np.asarray(s_m, dtype=np.float64))]

    def project(self, xy_m: Sequence[float] | FloatArray, near_s_m: float, within_m: float = 2.0) -> float:
        """Arc length of the point nearest to `(2,)` x, y [m] among those within `within_m` of `near_s_m`."""
        x, y = float(xy_m[0]), float(xy_m[1])
        low, high = near_s_m - within_m, near_s_m + within_m
        last = len(self._pieces) - 1
        best_m, least_m = low, math.inf
        for index in range(
            max(bisect.bisect_right(self._begins_m, low) - 1, 0), max(bisect.bisect_right(self._begins_m, high), 1)
        ):
            piece, begin = self._pieces[index], self._begins_m[index]
            start = low if index == 0 else max(begin, low)
            end = high if index == last else min(self._begins_m[index + 1], high)
            cos, sin, dx, dy = math.cos(piece.heading), math.sin(piece.heading), x - piece.x, y - piece.y
            s_m, bend = begin + cos * dx + sin * dy, piece.curvature
            if bend:
                # The angle about the centre of an arc, at most half a circle from the middle of the arc.
                angle = math.atan2(bend * (s_m - begin), 1.0 - bend * (cos * dy - sin * dx))
                middle = 0.5 * (start + end)
                s_m = middle + math.remainder(begin + angle / bend - middle, 2.0 * math.pi / bend)
            s_m = min(max(s_m, start), end)
            there_x, there_y, _ = piece.pose(s_m - begin)
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

    def _index(self, s_m: FloatArray) -> IntArray:
        """Rows of the pieces at arc lengths."""
        return np.maximum(np.searchsorted(self._begins_m, s_m, side="right") - 1, 0)


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
