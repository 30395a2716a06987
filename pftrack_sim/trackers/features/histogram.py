"""Weighted histograms of boxes, compared by the Bhattacharyya similarity.

Every box, whatever its size, is sampled at the same ROWS x COLUMNS points, so that cost does not depend on size and
histograms of different boxes are comparable. They are counted from *pixel codes* (a colour's bin, a texture's pattern);
a `BinLayout` holds the weight of each point and the part of the histogram that it counts into. One kernel serves all
histograms of the papers. Weights are whole numbers, as only their ratios matter: their sums are exact in any order and
faster than those of floats.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.core.boxes import Box
from pftrack_sim.core.types import FloatArray

Codes: TypeAlias = NDArray[np.uint8]  # `(H, W, C)` pixel codes

ROWS = 48
COLUMNS = 24


class BinTables(NamedTuple):
    """A `BinLayout` as the kernels need it.

    Attributes:
        weights: `(rows, columns)` weight of each point.
        spans: `(rows, 2)` first point of each row with a weight, and one after the last.
        first_bins: `(rows, columns)` first bin of each point's cell.
        bin_count: Bins per channel and cell.
    """

    weights: NDArray[np.int32]
    spans: NDArray[np.int64]
    first_bins: NDArray[np.uintp]
    bin_count: int


@dataclass(frozen=True, eq=False)
class BinLayout:
    """Weights and cells of the points of a box.

    Attributes:
        weights: `(rows, columns)` weights >= 0 whose sum fits an int32; `(ROWS, COLUMNS)` by default.
        cells: `(rows, columns)` cell of each point, from 0.
        cell_count: Number of cells.
        channel_count: Codes per pixel.
        bin_count: Bins per channel and cell; codes are below it.
    """

    weights: NDArray[np.int32]
    cells: NDArray[np.int64]
    cell_count: int
    channel_count: int
    bin_count: int

    @cached_property
    def tables(self) -> BinTables:
        """Derived tables."""
        first = np.argmax(self.weights > 0, axis=1)
        last = self.weights.shape[1] - np.argmax(np.flip(self.weights, axis=1) > 0, axis=1)
        empty = self.weights.max(axis=1) == 0
        spans = np.where(empty[:, None], 0, np.stack([first, last], axis=1)).astype(np.int64)
        first_bins = self.cells.astype(np.uintp) * np.uintp(self.channel_count * self.bin_count)
        return BinTables(self.weights, spans, first_bins, self.bin_count)

    @cached_property
    def total(self) -> float:
        """Sum of all counts of a box inside the image."""
        return float(self.weights.sum()) * self.channel_count

    @property
    def size(self) -> int:
        """Bins of the whole histogram."""
        return self.cell_count * self.channel_count * self.bin_count


def uniform_layout(channel_count: int, bin_count: int) -> BinLayout:
    """Equal weights, one cell."""
    return cell_layout(1, 1, channel_count, bin_count)


def cell_layout(rows: int, columns: int, channel_count: int, bin_count: int) -> BinLayout:
    """Equal weights, rows x columns cells."""
    row = np.arange(ROWS) * rows // ROWS
    column = np.arange(COLUMNS) * columns // COLUMNS
    cells = row[:, None] * columns + column[None, :]
    return BinLayout(np.ones((ROWS, COLUMNS), np.int32), cells, rows * columns, channel_count, bin_count)


def epanechnikov_layout(channel_count: int, bin_count: int) -> BinLayout:
    """Weights K(r^2) = 1 - r^2 in the ellipse inscribed in the box, 0 outside it (Ko et al. 2012, eq. 1)."""
    # Points lie at v = (2 i + 1) / ROWS - 1 and u = (2 j + 1) / COLUMNS - 1, here multiplied by ROWS * COLUMNS.
    v = COLUMNS * (2 * np.arange(ROWS) + 1 - ROWS)
    u = ROWS * (2 * np.arange(COLUMNS) + 1 - COLUMNS)
    squares = np.square(v)[:, None] + np.square(u)[None, :]
    return _kernel_layout(np.clip((ROWS * COLUMNS) ** 2 - squares, 0, None), channel_count, bin_count)


def distance_layout(rows: int, columns: int, channel_count: int, bin_count: int) -> BinLayout:
    """Weights 1 - r^2 with r the distance to the centre over that of the farthest point (Lee et al. 2012, eq. 1).

    Distances are those in a box resized to rows x columns: the corners have weight 0.
    """
    # Doubled distances are whole numbers.
    v, u = 2 * np.arange(rows) - (rows - 1), 2 * np.arange(columns) - (columns - 1)
    squares = np.square(v)[:, None] + np.square(u)[None, :]
    return _kernel_layout(squares.max() - squares, channel_count, bin_count)


def _kernel_layout(weights: NDArray[np.int64], channel_count: int, bin_count: int) -> BinLayout:
    """One cell, with weights in lowest terms."""
    least = weights // np.gcd.reduce(weights, axis=None)
    return BinLayout(least.astype(np.int32), np.zeros(weights.shape, np.int64), 1, channel_count, bin_count)


def histogram(codes: Codes, box: Box, layout: BinLayout) -> FloatArray:
    """`(layout.size,)` normalised histogram of one `(4,)` box [px], counted from the points inside the image.

    It sums to 1, or is all 0 if there are none.
    """
    counts = _counts(codes, box[None], layout)[0]
    return counts / max(int(counts.sum()), 1)


def histograms(codes: Codes, boxes: FloatArray, layout: BinLayout) -> FloatArray:
    """Histograms of `(N, 4)` boxes: `(N, layout.size)`, each summing to the share of its weight inside the image."""
    return _counts(codes, boxes, layout) / layout.total


def similarities(codes: Codes, boxes: FloatArray, layout: BinLayout, model: FloatArray) -> FloatArray:
    """Bhattacharyya similarity sum(sqrt(p q)), in [0, 1], of `(N, 4)` boxes [px] with a normalised histogram: `(N,)`.

    Points outside the image match nothing: a box with half its weight outside reaches sqrt(1/2) at most.
    """
    out = np.empty(len(boxes))
    _compare(codes, boxes, layout.tables, np.sqrt(model / layout.total), out)
    return np.minimum(out, 1.0, out=out)


def _counts(codes: Codes, boxes: FloatArray, layout: BinLayout) -> NDArray[np.int32]:
    """`(N, layout.size)` weighted counts of `(N, 4)` boxes."""
    out = np.zeros((len(boxes), layout.size), np.int32)
    _count_all(codes, boxes, layout.tables, out)
    return out


@njit(nogil=True, cache=True)
def _count_all(codes: Codes, boxes: FloatArray, tables: BinTables, out: NDArray[np.int32]) -> None:
    """Add the counts of every box to `out`."""
    offsets = np.empty(tables.weights.shape[1], np.uintp)
    for n in range(boxes.shape[0]):
        count_points(codes, boxes[n], tables, offsets, out[n])


@njit(nogil=True, cache=True)
def _compare(codes: Codes, boxes: FloatArray, tables: BinTables, root_model: FloatArray, out: FloatArray) -> None:
    """Fill `out` with sum(sqrt(counts) * root_model) of every box."""
    offsets = np.empty(tables.weights.shape[1], np.uintp)
    counts = np.empty(root_model.size, np.int32)
    for n in range(boxes.shape[0]):
        counts[:] = 0
        count_points(codes, boxes[n], tables, offsets, counts)
        out[n] = _affinity(counts, root_model)


# Reassociation lets the square roots be vectorised.
@njit(nogil=True, cache=True, fastmath={"reassoc"})
def _affinity(counts: NDArray[np.int32], root_model: FloatArray) -> float:
    total = 0.0
    for k in range(counts.size):
        total += np.sqrt(np.float64(counts[k])) * root_model[k]
    return total


@njit(nogil=True, cache=True)
def count_points(
    codes: Codes, box: FloatArray, tables: BinTables, offsets: NDArray[np.uintp], out: NDArray[np.int32]
) -> None:
    """Add the counts of one box to `out`; `offsets` is scratch for the image columns of the points.

    Unsigned indices spare a test for negative ones at every access, and unrolled loops over one or three channels are
    faster: together they halve the time.
    """
    weights, spans, first_bins = tables.weights, tables.spans, tables.first_bins
    x, y, w, h = box[0], box[1], box[2], box[3]
    height, width, channels = codes.shape
    rows, columns = weights.shape
    flat = codes.reshape(-1)
    stride, one = np.uintp(tables.bin_count), np.uintp(1)
    left, right = columns, 0
    for j in range(columns):
        column = int(np.floor(x + (j + 0.5) * w / columns))
        if 0 <= column < width:
            offsets[j] = np.uintp(column * channels)
            left, right = min(left, j), j + 1
    for i in range(rows):
        line = int(np.floor(y + (i + 0.5) * h / rows))
        if line < 0 or line >= height:
            continue
        row = np.uintp(line * width * channels)
        for j in range(np.uintp(max(spans[i, 0], left)), np.uintp(min(spans[i, 1], right))):
            weight, at, first = weights[i, j], row + offsets[j], first_bins[i, j]
            if channels == 3:
                out[first + np.uintp(flat[at])] += weight
                out[first + stride + np.uintp(flat[at + one])] += weight
                out[first + stride + stride + np.uintp(flat[at + one + one])] += weight
            elif channels == 1:
                out[first + np.uintp(flat[at])] += weight
            else:
                for c in range(channels):
                    out[first + np.uintp(c) * stride + np.uintp(flat[at + np.uintp(c)])] += weight
