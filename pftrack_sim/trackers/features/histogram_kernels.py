"""Counting of the histograms of `histogram`: weighted counts of pixel codes at the points of a box.

All three ways to count give the same whole numbers. Boxes inside the image whose layout is symmetric, or has small
cells of equal weights, are counted in a half or a third of the time of the general loop. What costs there is that
neighbours often fall into the same bin: an addition then waits for the one before it to be stored.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.core.types import FloatArray

Codes: TypeAlias = NDArray[np.uint8]  # `(H, W, C)` pixel codes

GENERAL, MIRRORED, CELLS = 0, 1, 2
"""Ways to count: any layout; one cell of one or three channels, whose weights are the same upside down and left to
right; the layout of `CELL_GRID`^2 cells of weight 1 with one channel of at most `PATTERN_COUNT` codes."""
ROWS, COLUMNS = 48, 24
CELL_GRID = 4
PATTERN_COUNT = 16
CODE_COUNT = 256  # Of a byte
_CELL_ROWS, _CELL_COLUMNS = ROWS // CELL_GRID, COLUMNS // CELL_GRID


class BinTables(NamedTuple):
    """A `BinLayout` as the kernels need it.

    Attributes:
        weights: `(rows, columns)` weight of each point.
        spans: `(rows, 2)` first point of each row with a weight, and one after the last.
        first_bins: `(rows, columns)` first bin of each point's cell.
        bin_count: Bins per channel and cell.
        way: How boxes inside the image are counted: `GENERAL`, `MIRRORED` or `CELLS`.
    """

    weights: NDArray[np.int32]
    spans: NDArray[np.int64]
    first_bins: NDArray[np.uintp]
    bin_count: int
    way: int


class Scratch(NamedTuple):
    """Memory of one call, for all its boxes.

    Attributes:
        lines: `(rows,)` place of the image line of each row of points in the flat codes.
        places: `(columns,)` place of each column of points within a line.
        quarters: `(4 * channels * CODE_COUNT,)` counts of a quarter of the points each.
    """

    lines: NDArray[np.uintp]
    places: NDArray[np.uintp]
    quarters: NDArray[np.int32]


@njit(nogil=True, cache=True)
def new_scratch(tables: BinTables, channels: int) -> Scratch:
    """Memory for `count_box`."""
    rows, columns = tables.weights.shape
    quarters = np.empty(4 * channels * CODE_COUNT, np.int32)
    return Scratch(np.empty(rows, np.uintp), np.empty(columns, np.uintp), quarters)


@njit(nogil=True, cache=True)
def count_all(codes: Codes, boxes: FloatArray, tables: BinTables, out: NDArray[np.int32]) -> None:
    """Fill `(N, size)` with the counts of `(N, 4)` boxes."""
    scratch = new_scratch(tables, codes.shape[2])
    for n in range(boxes.shape[0]):
        count_box(codes, boxes[n], tables, scratch, out[n])


@njit(nogil=True, cache=True)
def compare(codes: Codes, boxes: FloatArray, tables: BinTables, root_model: FloatArray, out: FloatArray) -> None:
    """Fill `out` with sum(sqrt(counts) * root_model) of every box, at most 1, which rounding may exceed."""
    scratch = new_scratch(tables, codes.shape[2])
    counts = np.empty(root_model.size, np.int32)
    for n in range(boxes.shape[0]):
        count_box(codes, boxes[n], tables, scratch, counts)
        out[n] = min(_affinity(counts, root_model), 1.0)


# Reassociation lets the square roots be vectorised.
@njit(nogil=True, cache=True, fastmath={"reassoc"})
def _affinity(counts: NDArray[np.int32], root_model: FloatArray) -> float:
    total = 0.0
    for k in range(counts.size):
        total += np.sqrt(np.float64(counts[k])) * root_model[k]
    return total


@njit(nogil=True, cache=True)
def count_box(codes: Codes, box: FloatArray, tables: BinTables, scratch: Scratch, out: NDArray[np.int32]) -> None:
    """Fill `out` with the counts of one box.

    Unsigned indices spare a test for negative ones at every access.
    """
    rows, columns = tables.weights.shape
    top, bottom = _inside(box[1], box[3], codes.shape[0], codes.shape[1] * codes.shape[2], scratch.lines)
    left, right = _inside(box[0], box[2], codes.shape[1], codes.shape[2], scratch.places)
    whole = top == 0 and bottom == rows and left == 0 and right == columns
    if whole and tables.way == MIRRORED:
        if codes.shape[2] == 3:
            _count_mirrored_colours(codes, tables, scratch)
        else:
            _count_mirrored(codes, tables, scratch)
        _add_quarters(scratch.quarters, codes.shape[2], tables.bin_count, out)
    elif whole and tables.way == CELLS:
        _count_cells(codes, scratch, out)
    else:
        out[:] = 0
        _count_points(codes, tables, scratch, (top, bottom, left, right), out)


@njit(nogil=True, cache=True)
def _inside(near: float, size: float, limit: int, step: int, places: NDArray[np.uintp]) -> tuple[int, int]:
    """Fill `places` with the pixels along an axis, times `step`; first point inside the image, one after the last.

    The points are in order, so that those inside follow each other. Without branches, and with integers as short as the
    largest image allows, the loop is vectorised; a point outside gets the pixel before the first or after the last one.
    """
    count, end = places.size, np.uintp(limit * step)
    for k in range(count):
        pixel = np.floor(near + (np.int32(k) + 0.5) * size / count)
        places[k] = np.uintp(np.int32(min(max(pixel, -1.0), float(limit)) * step))
    first, last = 0, count
    while first < count and places[first] >= end:
        first += 1
    while last > 0 and places[last - 1] >= end:
        last -= 1
    return first, last


@njit(nogil=True, cache=True)
def _count_mirrored(codes: Codes, tables: BinTables, scratch: Scratch) -> None:
    """Count four points of one weight at a time, each into a histogram of its own, so that none waits for another."""
    weights, spans = tables.weights, tables.spans
    lines, places, quarters = scratch
    rows, columns = weights.shape
    flat = codes.reshape(-1)
    last_row, last_column = np.uintp(rows - 1), np.uintp(columns - 1)
    _clear(quarters, tables.bin_count)
    for i in range(np.uintp(rows // 2)):
        upper, lower = lines[i], lines[last_row - i]
        for j in range(np.uintp(spans[i, 0]), np.uintp(columns // 2)):
            weight, left, right = weights[i, j], places[j], places[last_column - j]
            quarters[np.uintp(flat[upper + left])] += weight
            quarters[_SECOND + np.uintp(flat[upper + right])] += weight
            quarters[_THIRD + np.uintp(flat[lower + left])] += weight
            quarters[_FOURTH + np.uintp(flat[lower + right])] += weight


# Histograms at constant distances need one register for them all.
_SECOND, _THIRD, _FOURTH = np.uintp(CODE_COUNT), np.uintp(2 * CODE_COUNT), np.uintp(3 * CODE_COUNT)


@njit(nogil=True, cache=True)
def _count_mirrored_colours(codes: Codes, tables: BinTables, scratch: Scratch) -> None:
    """As `_count_mirrored`, of three channels at once: twelve additions share their places and wait even less."""
    weights, spans = tables.weights, tables.spans
    lines, places, quarters = scratch
    rows, columns = weights.shape
    flat = codes.reshape(-1)
    last_row, last_column = np.uintp(rows - 1), np.uintp(columns - 1)
    _clear(quarters, tables.bin_count)
    for i in range(np.uintp(rows // 2)):
        upper, lower = lines[i], lines[last_row - i]
        for j in range(np.uintp(spans[i, 0]), np.uintp(columns // 2)):
            weight, left, right = weights[i, j], places[j], places[last_column - j]
            _add_colour(flat, upper + left, weight, quarters, np.uintp(0))
            _add_colour(flat, upper + right, weight, quarters, np.uintp(3 * CODE_COUNT))
            _add_colour(flat, lower + left, weight, quarters, np.uintp(6 * CODE_COUNT))
            _add_colour(flat, lower + right, weight, quarters, np.uintp(9 * CODE_COUNT))


@njit(nogil=True, cache=True)
def _add_colour(
    flat: NDArray[np.uint8], at: np.uintp, weight: np.int32, quarters: NDArray[np.int32], first: np.uintp
) -> None:
    """Count the three codes of one point into the three histograms from `first` on."""
    one, two = np.uintp(1), np.uintp(2)
    quarters[first + np.uintp(flat[at])] += weight
    quarters[first + _SECOND + np.uintp(flat[at + one])] += weight
    quarters[first + _THIRD + np.uintp(flat[at + two])] += weight


@njit(nogil=True, cache=True)
def _clear(quarters: NDArray[np.int32], bin_count: int) -> None:
    """Set the bins of all histograms to 0."""
    for first in range(0, quarters.size, CODE_COUNT):
        quarters[first : first + bin_count] = 0


@njit(nogil=True, cache=True)
def _add_quarters(quarters: NDArray[np.int32], channels: int, bin_count: int, out: NDArray[np.int32]) -> None:
    """Fill `out` with the sums of the four histograms of each channel."""
    distance = np.uintp(channels * CODE_COUNT)
    for c in range(channels):
        counts = out[c * bin_count : (c + 1) * bin_count]
        first = np.uintp(c * CODE_COUNT)
        second, third, fourth = first + distance, first + distance + distance, first + distance + distance + distance
        for k in range(np.uintp(bin_count)):
            counts[k] = quarters[first + k] + quarters[second + k] + quarters[third + k] + quarters[fourth + k]


@njit(nogil=True, cache=True)
def _count_cells(codes: Codes, scratch: Scratch, out: NDArray[np.int32]) -> None:
    """Count in registers: of two rows of a cell in 16 fields of 4 bits, of the cell in 16 fields of 8 bits."""
    lines, places = scratch.lines, scratch.places
    flat = codes.reshape(-1)
    for cell in range(CELL_GRID * CELL_GRID):
        top, left = cell // CELL_GRID * _CELL_ROWS, cell % CELL_GRID * _CELL_COLUMNS
        even = odd = np.uint64(0)
        for i in range(np.uintp(top), np.uintp(top + _CELL_ROWS), np.uintp(2)):
            upper, lower = lines[i], lines[i + np.uintp(1)]
            both = np.uint64(0)
            for j in range(np.uintp(left), np.uintp(left + _CELL_COLUMNS)):
                both += _field(flat, upper + places[j]) + _field(flat, lower + places[j])
            even, odd = even + (both & _EVEN), odd + ((both >> _FOUR) & _EVEN)
        _unpack(even, odd, out[PATTERN_COUNT * cell : PATTERN_COUNT * (cell + 1)])


_EVEN, _FOUR = np.uint64(0x0F0F0F0F0F0F0F0F), np.uint64(4)


@njit(nogil=True, cache=True)
def _field(codes: Codes, place: np.uintp) -> np.uint64:
    """A one in the field of 4 bits of the code at a place."""
    return np.uint64(1) << (_FOUR * np.uint64(codes[place]))


@njit(nogil=True, cache=True)
def _unpack(even: np.uint64, odd: np.uint64, out: NDArray[np.int32]) -> None:
    """Fill `(PATTERN_COUNT,)` with the fields of 8 bits of the even and the odd codes."""
    for k in range(PATTERN_COUNT // 2):
        shift = np.uint64(8 * k)
        out[2 * k] = np.int32((even >> shift) & np.uint64(255))
        out[2 * k + 1] = np.int32((odd >> shift) & np.uint64(255))


@njit(nogil=True, cache=True)
def _count_points(
    codes: Codes, tables: BinTables, scratch: Scratch, inside: tuple[int, int, int, int], out: NDArray[np.int32]
) -> None:
    """Add the counts of the points in rows and columns `inside` (top, bottom, left, right).

    Unrolled loops over one or three channels are faster.
    """
    weights, spans, first_bins = tables.weights, tables.spans, tables.first_bins
    lines, places = scratch.lines, scratch.places
    channels = codes.shape[2]
    flat = codes.reshape(-1)
    stride, one = np.uintp(tables.bin_count), np.uintp(1)
    for i in range(inside[0], inside[1]):
        row = lines[i]
        for j in range(np.uintp(max(spans[i, 0], inside[2])), np.uintp(min(spans[i, 1], inside[3]))):
            weight, at, first = weights[i, j], row + places[j], first_bins[i, j]
            if channels == 3:
                out[first + np.uintp(flat[at])] += weight
                out[first + stride + np.uintp(flat[at + one])] += weight
                out[first + stride + stride + np.uintp(flat[at + one + one])] += weight
            elif channels == 1:
                out[first + np.uintp(flat[at])] += weight
            else:
                for c in range(channels):
                    out[first + np.uintp(c) * stride + np.uintp(flat[at + np.uintp(c)])] += weight
