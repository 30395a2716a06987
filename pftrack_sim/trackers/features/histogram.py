"""Weighted histograms of boxes, compared by the Bhattacharyya similarity.

Every box, whatever its size, is sampled at the same ROWS x COLUMNS points, so that cost does not depend on size and
histograms of different boxes are comparable. They are counted from *pixel codes* (a colour's bin, a texture's pattern);
a `BinLayout` holds the weight of each point, or divides the box into cells with a histogram each.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.boxes import Box
from pftrack_sim.core.compiled import kernel, part_of_kernel
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.image_region import ImageRegion, crop

Codes: TypeAlias = NDArray[np.uint8]  # `(H, W, C)` pixel codes
ROWS, COLUMNS = 48, 24
CELLS = 4
"""Rows and columns of cells in a layout that has cells."""
PATTERN_COUNT = 16
"""Codes that such a layout counts."""


@dataclass(frozen=True, eq=False)
class BinLayout:
    """Weights of the points of a box, or cells of points of equal weight.

    Attributes:
        weights: `(rows, columns)` whole weights >= 0, the same upside down and left to right, whose sum fits an int32.
        channel_count: Codes per pixel, 1 or 3; 1 in cells.
        bin_count: Bins per channel and cell, at most 256; `PATTERN_COUNT` in cells. Codes are below it.
        in_cells: Whether CELLS x CELLS parts of the box have a histogram each; all weights are then 1.
    """

    weights: NDArray[np.int32]
    channel_count: int
    bin_count: int
    in_cells: bool = False

    @cached_property
    def total(self) -> float:
        """Sum of all counts of a box inside the image."""
        return float(self.weights.sum()) * self.channel_count

    @property
    def size(self) -> int:
        """Bins of the whole histogram."""
        return (CELLS * CELLS if self.in_cells else 1) * self.channel_count * self.bin_count


def uniform_layout(channel_count: int, bin_count: int) -> BinLayout:
    """Equal weights, one histogram."""
    return BinLayout(np.ones((ROWS, COLUMNS), np.int32), channel_count, bin_count)


def cell_layout() -> BinLayout:
    """CELLS x CELLS cells, whose histograms follow each other row by row."""
    return BinLayout(np.ones((ROWS, COLUMNS), np.int32), 1, PATTERN_COUNT, in_cells=True)


def epanechnikov_layout(channel_count: int, bin_count: int) -> BinLayout:
    """Weights K(r^2) = 1 - r^2 in the ellipse inscribed in the box, 0 outside it (Ko et al. 2012, eq. 1)."""
    # Points lie at v = (2 i + 1) / ROWS - 1 and u = (2 j + 1) / COLUMNS - 1, here multiplied by ROWS * COLUMNS.
    v = COLUMNS * (2 * np.arange(ROWS) + 1 - ROWS)
    u = ROWS * (2 * np.arange(COLUMNS) + 1 - COLUMNS)
    squares = np.square(v)[:, None] + np.square(u)[None, :]
    return BinLayout(np.clip((ROWS * COLUMNS) ** 2 - squares, 0, None).astype(np.int32), channel_count, bin_count)


def distance_layout(rows: int, columns: int, bin_count: int) -> BinLayout:
    """Weights 1 - r^2 with r the distance to the centre over that of the farthest point (Lee et al. 2012, eq. 1).

    Distances are those in a box resized to rows x columns: the corners have weight 0.
    """
    # Doubled distances are whole numbers.
    v, u = 2 * np.arange(rows) - (rows - 1), 2 * np.arange(columns) - (columns - 1)
    squares = np.square(v)[:, None] + np.square(u)[None, :]
    return BinLayout((squares.max() - squares).astype(np.int32), 1, bin_count)


def histogram(codes: Codes, box: Box, layout: BinLayout) -> FloatArray:
    """`(layout.size,)` normalised histogram of one `(4,)` box [px], counted from the points inside the image.

    It sums to 1, or is all 0 if there are none.
    """
    counts = _counts(codes, box[None], layout)[0].astype(np.float64)
    return counts / max(counts.sum(), 1.0)


def histograms(codes: Codes, boxes: FloatArray, layout: BinLayout) -> FloatArray:
    """Histograms of `(N, 4)` boxes: `(N, layout.size)`, each summing to the share of its weight inside the image."""
    return np.divide(_counts(codes, boxes, layout), layout.total, dtype=np.float64)


def similarities(codes: Codes, boxes: FloatArray, layout: BinLayout, model: FloatArray) -> FloatArray:
    """Bhattacharyya similarity sum(sqrt(p q)), in [0, 1], of `(N, 4)` boxes [px] with a normalised histogram: `(N,)`.

    Points outside the image match nothing: a box with half its weight outside reaches sqrt(1/2) at most.
    """
    roots = np.sqrt(_counts(codes, boxes, layout))
    return np.minimum(roots @ np.sqrt(model / layout.total).astype(np.float32), 1.0).astype(np.float64)


def _counts(codes: Codes, boxes: FloatArray, layout: BinLayout) -> NDArray[np.float32]:
    """`(N, layout.size)` weighted counts of `(N, 4)` boxes."""
    out = np.empty((len(boxes), layout.size), np.float32)
    if layout.in_cells:
        _count_patterns(codes[..., 0], boxes, out)
    else:
        _count(codes, boxes, layout.weights, layout.bin_count, out)
    return out


@part_of_kernel
def _place(near: float, size: float, limit: int, step: int, places: NDArray[np.uintp], inside: NDArray[Any]) -> None:
    """Fill the place of each point along an axis, times `step`, and 1 where it lies in the image, 0 where it does not.

    A point outside has the place of the nearest pixel.
    """
    for k in range(places.size):
        pixel = math.floor(near + (k + 0.5) * size / places.size)
        places[k] = np.uintp(min(max(pixel, 0), limit - 1) * step)
        inside[k] = 0 <= pixel < limit


# Neighbours often fall into the same bin, and an addition waits for the one before it to be stored: each quarter of the
# points has counts of its own. Unsigned indices spare a test for negative ones; constant distances need one register.
_CODES = np.uintp(256)
_SECOND, _THIRD, _FOURTH = np.uintp(3 * 256), np.uintp(6 * 256), np.uintp(9 * 256)


@kernel
def _count(
    codes: Codes, boxes: FloatArray, weights: NDArray[np.int32], bin_count: int, out: NDArray[np.float32]
) -> None:
    """Fill `out` with the counts of each box. Four points that mirror each other have one weight."""
    height, width, channels = codes.shape
    rows, columns = np.uintp(weights.shape[0]), np.uintp(weights.shape[1])
    flat = codes.reshape(-1)
    lines, places = np.empty(rows, np.uintp), np.empty(columns, np.uintp)
    down, across = np.empty(rows, np.int32), np.empty(columns, np.int32)
    counts = np.empty(np.uintp(4) * _SECOND, np.int32)
    one, two = np.uintp(1), np.uintp(2)
    for n in range(boxes.shape[0]):
        _place(boxes[n, 0], boxes[n, 2], width, channels, places, across)
        _place(boxes[n, 1], boxes[n, 3], height, width * channels, lines, down)
        for k in range(counts.size):
            counts[k] = 0
        for i in range(rows // two):
            upper, lower, above, below = lines[i], lines[rows - one - i], down[i], down[rows - one - i]
            for j in range(columns // two):
                weight = weights[i, j]
                if weight == 0:
                    continue
                left, right = places[j], places[columns - one - j]
                near, far = weight * across[j], weight * across[columns - one - j]
                _add(flat, upper + left, channels, above * near, counts, np.uintp(0))
                _add(flat, upper + right, channels, above * far, counts, _SECOND)
                _add(flat, lower + left, channels, below * near, counts, _THIRD)
                _add(flat, lower + right, channels, below * far, counts, _FOURTH)
        for c in range(channels):
            for k in range(bin_count):
                at = np.uintp(c) * _CODES + np.uintp(k)
                total = counts[at] + counts[at + _SECOND] + counts[at + _THIRD] + counts[at + _FOURTH]
                out[n, c * bin_count + k] = total


@part_of_kernel
def _add(
    flat: Codes, at: np.uintp, channels: int, weight: np.int32, counts: NDArray[np.int32], first: np.uintp
) -> None:
    """Add the weight of one point to the counts from `first` on; unrolled, as a loop takes half as long again."""
    counts[first + np.uintp(flat[at])] += weight
    if channels == 3:
        counts[first + _CODES + np.uintp(flat[at + np.uintp(1)])] += weight
        counts[first + _CODES + _CODES + np.uintp(flat[at + np.uintp(2)])] += weight


_EVEN, _BITS, _BYTE = np.uint64(0x0F0F0F0F0F0F0F0F), np.uint64(4), np.uint64(255)


@kernel
def _count_patterns(patterns: NDArray[np.uint8], boxes: FloatArray, out: NDArray[np.float32]) -> None:
    """Fill `out` with the counts in each cell of each box.

    A register counts two rows of a cell, 12 points, in 16 fields of 4 bits; two others the cell, 72 points, in 8 fields
    of 8 bits each, for even and odd patterns.
    """
    height, width = patterns.shape
    flat = patterns.reshape(-1)
    lines, places = np.empty(ROWS, np.uintp), np.empty(COLUMNS, np.uintp)
    down, across = np.empty(ROWS, np.uint64), np.empty(COLUMNS, np.uint64)
    cell_rows, cell_columns = np.uintp(ROWS // CELLS), np.uintp(COLUMNS // CELLS)
    one, two = np.uintp(1), np.uintp(2)
    for n in range(boxes.shape[0]):
        _place(boxes[n, 0], boxes[n, 2], width, 1, places, across)
        _place(boxes[n, 1], boxes[n, 3], height, width, lines, down)
        for cell in range(CELLS * CELLS):
            top, left = np.uintp(cell // CELLS) * cell_rows, np.uintp(cell % CELLS) * cell_columns
            even = odd = np.uint64(0)
            for i in range(top, top + cell_rows, two):
                upper, lower, both = lines[i], lines[i + one], np.uint64(0)
                for j in range(left, left + cell_columns):
                    both += (down[i] & across[j]) << (_BITS * np.uint64(flat[upper + places[j]]))
                    both += (down[i + one] & across[j]) << (_BITS * np.uint64(flat[lower + places[j]]))
                even += both & _EVEN
                odd += (both >> _BITS) & _EVEN
            for k in range(PATTERN_COUNT // 2):
                shift, first = np.uint64(8 * k), PATTERN_COUNT * cell + 2 * k
                out[n, first], out[n, first + 1] = (even >> shift) & _BYTE, (odd >> shift) & _BYTE


@dataclass(frozen=True, eq=False)
class Feature:
    """A histogram of a box.

    Attributes:
        encode: Maps an `(H, W, 3)` uint8 RGB image to `(H, W, C)` pixel codes, C is 1 or 3.
        layout: Weights and cells of the histogram.
    """

    encode: Callable[[Image], Codes]
    layout: BinLayout


Encoded: TypeAlias = tuple[ImageRegion, list[Codes]]  # A part of an image, and its codes in every feature of a model


class HistogramModel:
    """One histogram per feature, taken from the first frame and constant.

    Attributes:
        features: F features.
        histograms: The normalised histogram in each.
    """

    def __init__(self, features: Sequence[Feature], image: Image, box: Box) -> None:
        self.features = tuple(features)
        region = crop(image, box[None])
        local = region.to_region(box[None])[0]
        self.histograms = tuple(histogram(one.encode(region.pixels), local, one.layout) for one in self.features)

    def encode(self, image: Image, boxes: FloatArray) -> Encoded:
        """Encode the part of an image that `(N, 4)` boxes [px] touch: the expensive step, done once for all boxes."""
        region = crop(image, boxes)
        return region, [feature.encode(region.pixels) for feature in self.features]

    def similarities(self, encoded: Encoded, boxes: FloatArray) -> FloatArray:
        """`(F, N)` Bhattacharyya similarities in [0, 1] of `(N, 4)` boxes [px] with the model in each feature.

        The boxes lie inside the hull of those that were encoded. The distance d of Ko et al. 2012, eq. 7, is `sqrt(1 -
        similarity)`.
        """
        region, codes = encoded
        local, parts = region.to_region(boxes), zip(codes, self.features, self.histograms, strict=True)
        return np.array([similarities(one, local, feature.layout, model) for one, feature, model in parts])
