"""Mean shift of rotated boxes to the nearest mode of their colour similarity (Comaniciu, Ramesh & Meer 2003).

A box may be divided into areas, each with a colour histogram of its own (after Khan, Gu & Backhouse 2011): every area
climbs to its mode, and the shifts of all, weighted by how alike each area still is, move the box. The size and the
angle follow from two sources: the principal axes of the points that pull (anisotropic mean shift: Comaniciu 2003), and
the places that the areas have moved to, relative to each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pftrack_sim.core.compiled import kernel
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.histogram import Codes

SIDE = 24
"""Points along each side of a box."""
LEAST_STEP = 0.01
"""A box has arrived when a step is shorter than this share of its size."""
MOST_CHANGE = 0.1
"""Greatest relative change of size, and of angle [rad], per frame."""

_PLACES = (np.arange(SIDE) + 0.5) / SIDE - 0.5  # Of the points along one side, in shares of it from the centre


@dataclass(frozen=True)
class Partition:
    """The whole box, which is the first area, and a grid of areas.

    Attributes:
        rows: Rows of the grid; 0: the whole box alone.
        columns: Columns of the grid.
    """

    rows: int = 0
    columns: int = 0

    @cached_property
    def centres(self) -> FloatArray:
        """`(A, 2)` centre of each area, in shares of the box from its centre."""
        grid = [((j + 0.5) / self.columns - 0.5, (i + 0.5) / self.rows - 0.5)
                for i in range(self.rows) for j in range(self.columns)]  # fmt: skip
        return np.array([(0.0, 0.0), *grid])

    @cached_property
    def weights(self) -> FloatArray:
        """`(A, SIDE, SIDE)` weight of each point in each area: Epanechnikov kernels that sum to 1."""
        counts = np.array([(1.0, 1.0), *[(self.columns, self.rows)] * (len(self.centres) - 1)])
        across, down = (2.0 * (_PLACES - self.centres[:, axis, None]) * counts[:, axis, None] for axis in (0, 1))
        weights = np.maximum(1.0 - np.square(across)[:, None, :] - np.square(down)[:, :, None], 0.0)
        return weights / weights.sum(axis=(1, 2), keepdims=True)


def area_histograms(codes: Codes, states: FloatArray, partition: Partition, bin_count: int) -> FloatArray:
    """`(N, A, bin_count)` histograms of `(N, 5)` states: centre x, y, width, height [px], angle [rad].

    Each sums to the share of its weight that lies inside the `(H, W, 1)` codes.
    """
    x, y, width, height, angle = (column[:, None, None] for column in states.T)
    u, v = width * _PLACES, height * _PLACES[:, None]
    columns = np.floor(x + u * np.cos(angle) - v * np.sin(angle)).astype(int)
    rows = np.floor(y + u * np.sin(angle) + v * np.cos(angle)).astype(int)
    inside = (rows >= 0) & (rows < codes.shape[0]) & (columns >= 0) & (columns < codes.shape[1])
    box, i, j = np.nonzero(inside)
    bins = box * bin_count + codes[rows[inside], columns[inside], 0]
    counts = [
        np.bincount(bins, weights[i, j], len(states) * bin_count).astype(np.float64) for weights in partition.weights
    ]
    return np.stack([one.reshape(len(states), bin_count) for one in counts], axis=1)


def mean_shift(
    codes: Codes, states: FloatArray, partition: Partition, model: FloatArray, iteration_count: int, shape_gain: float
) -> FloatArray:
    """`(N, 5)` states after at most `iteration_count` steps uphill and one change of shape.

    Every point of an area pulls with sqrt(q_u / p_u), where u is the bin of its colour, q the model and p the histogram
    of the area: the gradient of their similarity under an Epanechnikov kernel. Points outside the image do not pull.

    Args:
        codes: `(H, W, 1)` bins of colours.
        states: `(N, 5)` starts, see `area_histograms`.
        partition: The areas.
        model: `(A, bin_count)` histograms of the target.
        iteration_count: Greatest number of steps.
        shape_gain: Share of the estimated change of size and angle that is made, in [0, 1].
    """
    out = states.copy()
    shifts, trust = np.zeros((len(states), len(model), 2)), np.zeros((len(states), len(model)))
    moments = np.empty((len(states), 3))
    _climb(codes, out, _PLACES, partition.weights, partition.centres, model, iteration_count, shifts, trust, moments)
    if shape_gain > 0.0:
        changed = trust.sum(axis=1) > 0.0
        change = _shape_change(out[changed], partition.centres, shifts[changed], trust[changed], moments[changed])
        change = shape_gain * np.clip(change, -MOST_CHANGE, MOST_CHANGE)
        out[changed, 2:4] *= np.exp(change[:, :2])
        out[changed, 4] += change[:, 2]
    return out


@kernel
def _climb(
    codes: Codes,
    states: FloatArray,
    places: FloatArray,
    weights: FloatArray,
    centres: FloatArray,
    model: FloatArray,
    iteration_count: int,
    shifts: FloatArray,
    trust: FloatArray,
    moments: FloatArray,
) -> None:
    """Move `(N, 5)` states uphill.

    Fills `(N, A, 2)` shifts of the areas where each state arrives, `(N, A)` squared similarities there, all 0 where
    nothing pulls, and `(N, 3)` second moments uu, uv, vv of the whole box's pulls. The moments are relative to those of
    equal pulls: 1, 0, 1 where box and model agree.
    """
    height, width = codes.shape[0], codes.shape[1]
    areas, bins = model.shape
    side = places.size
    seen, counts, pulls = np.empty((side, side), np.int64), np.empty((areas, bins)), np.empty(bins)
    for n in range(states.shape[0]):
        for iteration in range(iteration_count + 1):
            cosine, sine = math.cos(states[n, 4]), math.sin(states[n, 4])
            for a in range(areas):
                for k in range(bins):
                    counts[a, k] = 0.0
            for i in range(side):
                v = places[i] * states[n, 3]
                for j in range(side):
                    u = places[j] * states[n, 2]
                    column = math.floor(states[n, 0] + u * cosine - v * sine)
                    row = math.floor(states[n, 1] + u * sine + v * cosine)
                    seen[i, j] = -1
                    if 0 <= row < height and 0 <= column < width:
                        seen[i, j] = codes[row, column, 0]
                        for a in range(areas):
                            counts[a, seen[i, j]] += weights[a, i, j]
            total, across, down = 0.0, 0.0, 0.0
            for a in range(areas):
                similarity = 0.0
                for k in range(bins):
                    similarity += math.sqrt(model[a, k] * counts[a, k])
                    pulls[k] = math.sqrt(model[a, k] / counts[a, k]) if counts[a, k] > 0.0 else 0.0
                mass, u, v, uu, uv, vv = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                points, spread_u, spread_v = 0.0, 0.0, 0.0
                for i in range(side):
                    y = places[i] - centres[a, 1]
                    for j in range(side):
                        if weights[a, i, j] > 0.0:
                            x = places[j] - centres[a, 0]
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
                    u, v, uu, uv, vv = u / mass, v / mass, uu / mass, uv / mass, vv / mass
                if a == 0:
                    moments[n, 0] = (uu - u * u) * points / spread_u if mass > 0.0 else 1.0
                    moments[n, 1] = (uv - u * v) * points / math.sqrt(spread_u * spread_v) if mass > 0.0 else 0.0
                    moments[n, 2] = (vv - v * v) * points / spread_v if mass > 0.0 else 1.0
                shifts[n, a, 0], shifts[n, a, 1], trust[n, a] = u, v, similarity * similarity
                total += trust[n, a]
                across += trust[n, a] * u
                down += trust[n, a] * v
            if total <= 0.0 or iteration == iteration_count:
                break
            across, down = across / total, down / total
            states[n, 0] += across * states[n, 2] * cosine - down * states[n, 3] * sine
            states[n, 1] += across * states[n, 2] * sine + down * states[n, 3] * cosine
            if max(abs(across), abs(down)) < LEAST_STEP:
                break


def _shape_change(
    states: FloatArray, centres: FloatArray, shifts: FloatArray, trust: FloatArray, moments: FloatArray
) -> FloatArray:
    """`(N, 3)` changes of the logarithms of width and height and of the angle: the mean of what axes and areas say.

    Arguments are as in `_climb`.
    """
    width, height = states[:, 2], states[:, 3]
    # Principal axes of the pulls [px^2].
    p, q, r = moments[:, 0] * width**2, moments[:, 1] * width * height, moments[:, 2] * height**2
    mean, half = 0.5 * (p + r), np.hypot(0.5 * (p - r), q)
    long, short = np.sqrt(mean + half), np.sqrt(np.maximum(mean - half, 0.0))
    lies = width >= height
    axis_width, axis_height = np.where(lies, long, short) / width, np.where(lies, short, long) / height
    axis_turn = 0.5 * np.where(lies, np.arctan2(2.0 * q, p - r), np.arctan2(-2.0 * q, r - p))
    # The axes of a box that is about as wide as high say nothing about its angle.
    certain = np.abs(width**2 - height**2) / (width**2 + height**2)
    # Least squares of the areas' shifts on their places: a linear map in shares of the box.
    x, y = centres[1:].T
    weights, (u, v) = trust[:, 1:], np.moveaxis(shifts[:, 1:] - shifts[:, :1], 2, 0)

    def slope(moved: FloatArray, place: FloatArray) -> FloatArray:
        squares = weights @ np.square(place)
        return np.divide((weights * moved) @ place, squares, out=np.zeros(len(states)), where=squares > 0.0)

    wide, turned = 1.0 + slope(u, x), slope(v, x) * height / width
    high, leant = 1.0 + slope(v, y), slope(u, y) * width / height
    widen = np.sqrt(np.maximum(axis_width, 0.1) * np.hypot(wide, turned))
    heighten = np.sqrt(np.maximum(axis_height, 0.1) * np.hypot(high, leant))
    turn = 0.5 * (np.arctan2(turned, wide) + np.arctan2(-leant, high))
    turn = (turn + certain * axis_turn) / (1.0 + certain)
    return np.column_stack([np.log(np.maximum(widen, 0.1)), np.log(np.maximum(heighten, 0.1)), turn])
