"""Weighted histograms of boxes on a fixed grid, compared by Bhattacharyya.

Every box, however large, is read at the same ROWS x COLUMNS points, so that its size costs nothing and its
histogram is comparable with that of any other box. A *code image* holds small numbers per pixel (a colour's bin, a
texture's pattern); a *layout* says how much each point weighs and into which part of the histogram it counts. One
kernel serves every histogram in the papers. Weights are whole numbers, as only their ratios matter: sums are exact in
any order, and quicker than those of fractions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

ROWS = 48
COLUMNS = 24


@dataclass(frozen=True, eq=False)
class BinLayout:
    """How the points of a box fill its histogram.

    Attributes:
        weights: `(rows, columns)` what each point counts, >= 0 and small enough for their sum to be an int32;
            `(ROWS, COLUMNS)` unless a paper says otherwise.
        cells: `(rows, columns)` which cell each point lies in, from 0.
        cell_count: Number of cells.
        channel_count: Numbers per pixel of the code image.
        bin_count: Bins per channel and cell: codes are below it.
    """

    weights: NDArray[np.int32]
    cells: NDArray[np.int64]
    cell_count: int
    channel_count: int
    bin_count: int

    @cached_property
    def firsts(self) -> NDArray[np.uintp]:
        """`(rows, columns)` the first bin that each point may count into."""
        return self.cells.astype(np.uintp) * np.uintp(self.channel_count * self.bin_count)

    @cached_property
    def spans(self) -> NDArray[np.int64]:
        """`(rows, 2)` the first point of each row that weighs anything, and the one after the last."""
        columns = self.weights.shape[1]
        first = np.argmax(self.weights > 0, axis=1)
        last = columns - np.argmax(np.flip(self.weights, axis=1) > 0, axis=1)
        empty = self.weights.max(axis=1) == 0
        return np.where(empty[:, None], 0, np.stack([first, last], axis=1)).astype(np.int64)

    @cached_property
    def total(self) -> float:
        """What a box that lies wholly inside the image counts."""
        return float(self.weights.sum()) * self.channel_count

    @property
    def size(self) -> int:
        """Bins of the whole histogram."""
        return self.cell_count * self.channel_count * self.bin_count


def flat_layout(channel_count: int, bin_count: int) -> BinLayout:
    """Every point counts the same, in one cell."""
    weights = np.ones((ROWS, COLUMNS), np.int32)
    return BinLayout(weights, np.zeros((ROWS, COLUMNS), np.int64), 1, channel_count, bin_count)


def epanechnikov_layout(channel_count: int, bin_count: int) -> BinLayout:
    """Points weigh K(r^2) = 1 - r^2 in the ellipse inscribed in the box, nothing outside it (Ko et al. 2012, eq. 1)."""
    # Points lie at v = (2 i + 1) / ROWS - 1 and u = (2 j + 1) / COLUMNS - 1: all times (ROWS COLUMNS)^2 it is whole.
    v = COLUMNS * (2 * np.arange(ROWS) + 1 - ROWS)
    u = ROWS * (2 * np.arange(COLUMNS) + 1 - COLUMNS)
    squares = np.square(v)[:, None] + np.square(u)[None, :]
    return _whole(np.clip((ROWS * COLUMNS) ** 2 - squares, 0, None), channel_count, bin_count)


def distance_layout(rows: int, columns: int, channel_count: int, bin_count: int) -> BinLayout:
    """Points weigh 1 - r^2, where r is the distance to the centre over that of the farthest (Lee et al. 2012, eq. 1).

    Distances are taken between the points of a box resized to rows x columns, so that the corners weigh nothing.
    """
    # Twice the distance from the centre is whole.
    v, u = 2 * np.arange(rows) - (rows - 1), 2 * np.arange(columns) - (columns - 1)
    squares = np.square(v)[:, None] + np.square(u)[None, :]
    return _whole(squares.max() - squares, channel_count, bin_count)


def cell_layout(rows: int, columns: int, channel_count: int, bin_count: int) -> BinLayout:
    """The box is cut into rows x columns cells with a histogram each; every point counts the same."""
    row = np.arange(ROWS) * rows // ROWS
    column = np.arange(COLUMNS) * columns // COLUMNS
    cells = row[:, None] * columns + column[None, :]
    return BinLayout(np.ones((ROWS, COLUMNS), np.int32), cells, rows * columns, channel_count, bin_count)


def _whole(weights: NDArray[np.int64], channel_count: int, bin_count: int) -> BinLayout:
    """One cell of whole weights in lowest terms."""
    least = weights // np.gcd.reduce(weights, axis=None)
    return BinLayout(least.astype(np.int32), np.zeros(weights.shape, np.int64), 1, channel_count, bin_count)


def histogram(codes: NDArray[np.uint8], box: NDArray[np.float64], layout: BinLayout) -> NDArray[np.float64]:
    """The histogram of one box.

    Args:
        codes: `(H, W, channel_count)` codes.
        box: `(4,)` x, y, w, h [px] in the code image.
        layout: How points count.

    Returns:
        `(layout.size,)` numbers summing to 1; points outside the image do not count. All zero if all are outside.
    """
    out = np.zeros(layout.size, np.int32)
    across = np.empty(layout.weights.shape[1], np.uintp)
    _fill(
        codes,
        box[0],
        box[1],
        box[2],
        box[3],
        layout.weights,
        layout.spans,
        layout.firsts,
        layout.bin_count,
        across,
        out,
    )
    return out / max(int(out.sum()), 1)


def similarities(
    codes: NDArray[np.uint8], boxes: NDArray[np.float64], layout: BinLayout, model: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Bhattacharyya coefficient sum(sqrt(p q)) of every box with a model.

    Points outside the image match nothing: a box with half its weight outside reaches sqrt(1/2) at most.

    Args:
        codes: `(H, W, channel_count)` codes.
        boxes: `(N, 4)` x, y, w, h [px] in the code image.
        layout: How points count.
        model: `(layout.size,)` a `histogram`.

    Returns:
        `(N,)` numbers in [0, 1].
    """
    out = np.empty(len(boxes))
    across, scratch = np.empty(layout.weights.shape[1], np.uintp), np.empty(layout.size, np.int32)
    root = np.sqrt(model / layout.total)
    _compare(codes, boxes, layout.weights, layout.spans, layout.firsts, layout.bin_count, root, across, scratch, out)
    return np.minimum(out, 1.0, out=out)


def histograms(codes: NDArray[np.uint8], boxes: NDArray[np.float64], layout: BinLayout) -> NDArray[np.float64]:
    """The histograms of many boxes, of which what lies outside the image is missing.

    Args:
        codes: `(H, W, channel_count)` codes.
        boxes: `(N, 4)` x, y, w, h [px] in the code image.
        layout: How points count.

    Returns:
        `(N, layout.size)`; each sums to the share of its weight that lies inside the image.
    """
    out = np.zeros((len(boxes), layout.size), np.int32)
    across = np.empty(layout.weights.shape[1], np.uintp)
    _fill_all(codes, boxes, layout.weights, layout.spans, layout.firsts, layout.bin_count, across, out)
    return out / layout.total


@njit(nogil=True, cache=True)
def _fill_all(
    codes: NDArray[np.uint8],
    boxes: NDArray[np.float64],
    weights: NDArray[np.int32],
    spans: NDArray[np.int64],
    firsts: NDArray[np.uintp],
    bins: int,
    across: NDArray[np.uintp],
    out: NDArray[np.int32],
) -> None:
    """Fill `out` with the histogram of every box, not normalised; nothing is allocated."""
    for n in range(boxes.shape[0]):
        _fill(codes, boxes[n, 0], boxes[n, 1], boxes[n, 2], boxes[n, 3], weights, spans, firsts, bins, across, out[n])


@njit(nogil=True, cache=True)
def _fill(
    codes: NDArray[np.uint8],
    x: float,
    y: float,
    w: float,
    h: float,
    weights: NDArray[np.int32],
    spans: NDArray[np.int64],
    firsts: NDArray[np.uintp],
    bins: int,
    across: NDArray[np.uintp],
    out: NDArray[np.int32],
) -> None:
    """Add the points of one box to `out`; `across` is scratch for the image columns of the points.

    Indices are unsigned, which spares a test for negative ones at every access; one or three channels
    are written out, which spares a loop. Together that is half the time.
    """
    height, width, channels = codes.shape
    rows, columns = weights.shape
    flat = codes.reshape(-1)
    stride, one = np.uintp(bins), np.uintp(1)
    left, right = columns, 0
    for j in range(columns):
        column = int(np.floor(x + (j + 0.5) * w / columns))
        if 0 <= column < width:
            across[j] = np.uintp(column * channels)
            left, right = min(left, j), j + 1
    for i in range(rows):
        line = int(np.floor(y + (i + 0.5) * h / rows))
        if line < 0 or line >= height:
            continue
        row = np.uintp(line * width * channels)
        for j in range(np.uintp(max(spans[i, 0], left)), np.uintp(min(spans[i, 1], right))):
            weight, at, first = weights[i, j], row + across[j], firsts[i, j]
            if channels == 3:
                out[first + np.uintp(flat[at])] += weight
                out[first + stride + np.uintp(flat[at + one])] += weight
                out[first + stride + stride + np.uintp(flat[at + one + one])] += weight
            elif channels == 1:
                out[first + np.uintp(flat[at])] += weight
            else:
                for c in range(channels):
                    out[first + np.uintp(c) * stride + np.uintp(flat[at + np.uintp(c)])] += weight


# Summing in any order lets the square roots be taken several at once.
@njit(nogil=True, cache=True, fastmath={"reassoc"})
def _affinity(histogram: NDArray[np.int32], root_model: NDArray[np.float64]) -> float:
    """sum(sqrt(histogram) * root_model)."""
    total = 0.0
    for k in range(histogram.size):
        total += np.sqrt(np.float64(histogram[k])) * root_model[k]
    return total


@njit(nogil=True, cache=True)
def _compare(
    codes: NDArray[np.uint8],
    boxes: NDArray[np.float64],
    weights: NDArray[np.int32],
    spans: NDArray[np.int64],
    firsts: NDArray[np.uintp],
    bins: int,
    root_model: NDArray[np.float64],
    across: NDArray[np.uintp],
    scratch: NDArray[np.int32],
    out: NDArray[np.float64],
) -> None:
    """Fill `out` with sum(sqrt(p) * root_model) of every box; nothing is allocated."""
    for n in range(boxes.shape[0]):
        scratch[:] = 0
        _fill(codes, boxes[n, 0], boxes[n, 1], boxes[n, 2], boxes[n, 3], weights, spans, firsts, bins, across, scratch)
        out[n] = _affinity(scratch, root_model)
