"""Weighted histograms of boxes, compared by the Bhattacharyya similarity.

Every box, whatever its size, is sampled at the same ROWS x COLUMNS points, so that cost does not depend on size and
histograms of different boxes are comparable. They are counted from *pixel codes* (a colour's bin, a texture's pattern);
a `BinLayout` holds the weight of each point and the part of the histogram that it counts into. `histogram_kernels`
counts all histograms of the papers. Weights are whole numbers, as only their ratios matter: their sums are exact in any
order and faster than those of floats.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.boxes import Box
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.histogram_kernels import (
    CELL_GRID,
    CELLS,
    CODE_COUNT,
    COLUMNS,
    GENERAL,
    MIRRORED,
    PATTERN_COUNT,
    ROWS,
    BinTables,
    Codes,
    compare,
    count_all,
)


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
        return BinTables(self.weights, spans, first_bins, self.bin_count, self._way())

    def _way(self) -> int:
        """The fastest way to count boxes inside the image."""
        rows, columns = self.weights.shape
        if self.cell_count == 1:
            mirrored = all(np.array_equal(self.weights, np.flip(self.weights, axis)) for axis in (0, 1))
            counted = self.channel_count in (1, 3) and self.bin_count <= CODE_COUNT
            return MIRRORED if mirrored and counted and rows % 2 == columns % 2 == 0 else GENERAL
        patterns = self.channel_count == 1 and self.bin_count == PATTERN_COUNT and bool((self.weights == 1).all())
        return CELLS if patterns and np.array_equal(self.cells, _grid(CELL_GRID, CELL_GRID)) else GENERAL

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
    weights = np.ones((ROWS, COLUMNS), np.int32)
    return BinLayout(weights, _grid(rows, columns), rows * columns, channel_count, bin_count)


def _grid(rows: int, columns: int) -> NDArray[np.int64]:
    """`(ROWS, COLUMNS)` cell of each point, of rows x columns cells."""
    row, column = np.arange(ROWS) * rows // ROWS, np.arange(COLUMNS) * columns // COLUMNS
    return row[:, None] * columns + column[None, :]


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
    compare(codes, boxes, layout.tables, root_model(layout, model), out)
    return out


def root_model(layout: BinLayout, model: FloatArray) -> FloatArray:
    """`(layout.size,)` factors of the square roots of a box's counts in its similarity with a normalised histogram."""
    return np.sqrt(model / layout.total)


def _counts(codes: Codes, boxes: FloatArray, layout: BinLayout) -> NDArray[np.int32]:
    """`(N, layout.size)` weighted counts of `(N, 4)` boxes."""
    out = np.empty((len(boxes), layout.size), np.int32)
    count_all(codes, boxes, layout.tables, out)
    return out
