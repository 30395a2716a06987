"""Anisotropic mean shift of a rotated box that is divided into areas, each with a colour histogram of its own.

After Khan, Gu & Backhouse 2011: every area climbs to its mode, and the shifts of all, weighted by how alike each area
still is, move the box. The size and the angle follow from two sources: the principal axes of the points that pull
(anisotropic mean shift: Comaniciu 2003), and the places that the areas have moved to, relative to each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.histogram import Codes

SIDE = 24
"""Points along each side of a box."""
LEAST_STEP = 0.01
"""A box has arrived when a step is shorter than this share of its size."""
MOST_CHANGE = 0.1
"""Greatest relative change of size, and of angle [rad], per frame."""


class AreaTables(NamedTuple):
    """Areas as the kernels need them.

    Attributes:
        places: `(P,)` positions of the points along one side, in shares of it from the centre.
        weights: `(A, P, P)` weight of each point in each area: Epanechnikov kernels that sum to 1.
        centres: `(A, 2)` centre of each area, in the same shares.
    """

    places: FloatArray
    weights: FloatArray
    centres: FloatArray


@dataclass(frozen=True)
class Partition:
    """The whole box and a grid of areas.

    Attributes:
        rows: Rows of the grid.
        columns: Columns of the grid.
    """

    rows: int
    columns: int

    @cached_property
    def tables(self) -> AreaTables:
        """Derived tables; the whole box is the first area."""
        places = (np.arange(SIDE) + 0.5) / SIDE - 0.5
        centres, sizes = [(0.0, 0.0)], [(1.0, 1.0)]
        for row in range(self.rows):
            for column in range(self.columns):
                centres.append(((column + 0.5) / self.columns - 0.5, (row + 0.5) / self.rows - 0.5))
                sizes.append((1.0 / self.columns, 1.0 / self.rows))
        weights: list[FloatArray] = []
        for (u, v), (width, height) in zip(centres, sizes, strict=True):
            squares = np.square(2.0 * (places - u) / width)[None] + np.square(2.0 * (places - v) / height)[:, None]
            kernel = np.maximum(1.0 - squares, 0.0)
            weights.append(kernel / kernel.sum())
        return AreaTables(places, np.array(weights), np.array(centres))


def area_histograms(codes: Codes, states: FloatArray, partition: Partition, bin_count: int) -> FloatArray:
    """`(N, A, bin_count)` histograms of `(N, 5)` states: centre x, y, width, height [px], angle [rad].

    Each sums to the share of its weight that lies inside the `(H, W, 1)` codes.
    """
    tables = partition.tables
    out = np.empty((len(states), len(tables.centres), bin_count))
    seen = np.empty((SIDE, SIDE), np.int64)
    for state, counts in zip(states, out, strict=True):
        _count(codes, state, tables, seen, counts)
    return out


def partitioned_mean_shift(
    codes: Codes, states: FloatArray, partition: Partition, model: FloatArray, iteration_count: int, shape_gain: float
) -> FloatArray:
    """`(N, 5)` states after at most `iteration_count` steps uphill and one change of shape.

    Args:
        codes: `(H, W, 1)` bins of colours.
        states: `(N, 5)` starts, see `area_histograms`.
        partition: The areas.
        model: `(A, bin_count)` histograms of the target.
        iteration_count: Greatest number of steps.
        shape_gain: Share of the estimated change of size and angle that is made, in [0, 1].
    """
    out = states.copy()
    _climb_all(codes, out, partition.tables, model, iteration_count, shape_gain)
    return out


@njit(nogil=True, cache=True)
def _count(codes: Codes, state: FloatArray, tables: AreaTables, seen: NDArray[np.int64], out: FloatArray) -> None:
    """Fill `seen` with the code of each point, -1 outside, and `out` with the histograms of the areas."""
    height, width = codes.shape[:2]
    cosine, sine = math.cos(state[4]), math.sin(state[4])
    out[:] = 0.0
    for i in range(SIDE):
        v = tables.places[i] * state[3]
        for j in range(SIDE):
            u = tables.places[j] * state[2]
            column = int(np.floor(state[0] + u * cosine - v * sine))
            row = int(np.floor(state[1] + u * sine + v * cosine))
            seen[i, j] = -1
            if 0 <= row < height and 0 <= column < width:
                code = int(codes[row, column, 0])
                seen[i, j] = code
                for a in range(out.shape[0]):
                    if tables.weights[a, i, j] > 0.0:
                        out[a, code] += tables.weights[a, i, j]


@njit(nogil=True, cache=True)
def _climb_all(
    codes: Codes, states: FloatArray, tables: AreaTables, model: FloatArray, iteration_count: int, gain: float
) -> None:
    seen, counts = np.empty((SIDE, SIDE), np.int64), np.empty(model.shape)
    areas = model.shape[0]
    shifts, trust, moments = np.empty((areas, 2)), np.empty(areas), np.empty(3)
    for n in range(states.shape[0]):
        state = states[n]
        for iteration in range(iteration_count + 1):
            _count(codes, state, tables, seen, counts)
            _pull(seen, counts, tables, model, shifts, trust, moments)
            total = trust.sum()
            if total <= 0.0:
                break
            if iteration == iteration_count:
                _reshape(state, tables, shifts, trust, moments, gain)
                break
            u, v = 0.0, 0.0
            for a in range(areas):
                u += trust[a] / total * shifts[a, 0]
                v += trust[a] / total * shifts[a, 1]
            cosine, sine = math.cos(state[4]), math.sin(state[4])
            state[0] += u * state[2] * cosine - v * state[3] * sine
            state[1] += u * state[2] * sine + v * state[3] * cosine
            if max(abs(u), abs(v)) < LEAST_STEP:
                _reshape(state, tables, shifts, trust, moments, gain)
                break


@njit(nogil=True, cache=True)
def _pull(
    seen: NDArray[np.int64],
    counts: FloatArray,
    tables: AreaTables,
    model: FloatArray,
    shifts: FloatArray,
    trust: FloatArray,
    moments: FloatArray,
) -> None:
    """Fill the shift of each area, its squared similarity, and the second moments uu, uv, vv of the whole box's pulls.

    The moments are relative to those of equal pulls: 1, 0, 1 where box and model agree.
    """
    pulls = np.empty(model.shape[1])
    for a in range(model.shape[0]):
        similarity = 0.0
        for k in range(model.shape[1]):
            similarity += math.sqrt(model[a, k] * counts[a, k])
            pulls[k] = math.sqrt(model[a, k] / counts[a, k]) if counts[a, k] > 0.0 else 0.0
        trust[a] = similarity * similarity
        mass, u, v, uu, uv, vv, points, spread_u, spread_v = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(SIDE):
            y = tables.places[i] - tables.centres[a, 1]
            for j in range(SIDE):
                if tables.weights[a, i, j] <= 0.0:
                    continue
                x = tables.places[j] - tables.centres[a, 0]
                points += 1.0
                spread_u += x * x
                spread_v += y * y
                if seen[i, j] >= 0:
                    pull = pulls[seen[i, j]]
                    mass += pull
                    u += pull * x
                    v += pull * y
                    uu += pull * x * x
                    uv += pull * x * y
                    vv += pull * y * y
        if mass > 0.0:
            u, v = u / mass, v / mass
        shifts[a, 0], shifts[a, 1] = u, v
        if a == 0:
            moments[:] = (1.0, 0.0, 1.0)
            if mass > 0.0:
                moments[0] = (uu / mass - u * u) * points / spread_u
                moments[1] = (uv / mass - u * v) * points / math.sqrt(spread_u * spread_v)
                moments[2] = (vv / mass - v * v) * points / spread_v


@njit(nogil=True, cache=True)
def _reshape(
    state: FloatArray, tables: AreaTables, shifts: FloatArray, trust: FloatArray, moments: FloatArray, gain: float
) -> None:
    """Change width, height and angle by the share `gain` of the mean of what axes and areas say."""
    width, height = state[2], state[3]
    # Principal axes of the pulls [px^2].
    p, q, r = moments[0] * width * width, moments[1] * width * height, moments[2] * height * height
    mean, half = 0.5 * (p + r), math.hypot(0.5 * (p - r), q)
    long, short = math.sqrt(mean + half), math.sqrt(max(mean - half, 0.0))
    if width >= height:
        from_axes = (long / width, short / height, 0.5 * math.atan2(2.0 * q, p - r))
    else:
        from_axes = (short / width, long / height, 0.5 * math.atan2(-2.0 * q, r - p))
    # The axes of a box that is about as wide as high say nothing about its angle.
    certain = abs(width * width - height * height) / (width * width + height * height)
    # Least squares of the areas' shifts on their places: a linear map in shares of the box.
    square_u, square_v, uu, uv, vu, vv = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(1, len(trust)):
        x, y = tables.centres[a, 0], tables.centres[a, 1]
        square_u += trust[a] * x * x
        square_v += trust[a] * y * y
        uu += trust[a] * x * (shifts[a, 0] - shifts[0, 0])
        vu += trust[a] * x * (shifts[a, 1] - shifts[0, 1])
        uv += trust[a] * y * (shifts[a, 0] - shifts[0, 0])
        vv += trust[a] * y * (shifts[a, 1] - shifts[0, 1])
    wide, turned, high, leant = 1.0, 0.0, 1.0, 0.0
    if square_u > 0.0:
        wide, turned = 1.0 + uu / square_u, vu / square_u * height / width
    if square_v > 0.0:
        high, leant = 1.0 + vv / square_v, uv / square_v * width / height
    turn = 0.5 * (math.atan2(turned, wide) + math.atan2(-leant, high))
    widen = math.log(max(math.sqrt(max(from_axes[0], 0.1) * math.hypot(wide, turned)), 0.1))
    heighten = math.log(max(math.sqrt(max(from_axes[1], 0.1) * math.hypot(high, leant)), 0.1))
    turn = (turn + certain * from_axes[2]) / (1.0 + certain)
    state[2] *= math.exp(gain * min(max(widen, -MOST_CHANGE), MOST_CHANGE))
    state[3] *= math.exp(gain * min(max(heighten, -MOST_CHANGE), MOST_CHANGE))
    state[4] += gain * min(max(turn, -MOST_CHANGE), MOST_CHANGE)
