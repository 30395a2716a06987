"""Weighted histograms of boxes, compared by the Bhattacharyya similarity.

Every box, whatever its size, is sampled at the same ROWS x COLUMNS points, so that cost does not depend on size and
histograms of different boxes are comparable. They are counted from *pixel codes* (a colour's bin, a texture's pattern);
a `BinLayout` holds the weight of each point and the part of the histogram that it counts into.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.boxes import Box
from pftrack_sim.core.compiled import kernel
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.image_region import ImageRegion, crop

Codes: TypeAlias = NDArray[np.uint8]  # `(H, W, C)` pixel codes
ROWS, COLUMNS = 48, 24


@dataclass(frozen=True, eq=False)
class BinLayout:
    """Weights and cells of the points of a box.

    Attributes:
        weights: `(rows, columns)` whole weights >= 0 whose sum fits an int32; `(ROWS, COLUMNS)` by default.
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
    def spans(self) -> NDArray[np.uintp]:
        """`(rows, 2)` first point of each row with a weight, and one after the last."""
        weighty = np.greater(self.weights, 0)
        first, last = weighty.argmax(axis=1), self.weights.shape[1] - np.flip(weighty, axis=1).argmax(axis=1)
        empty = ~np.any(weighty, axis=1, keepdims=True)
        return np.where(empty, 0, np.stack([first, last], axis=1)).astype(np.uintp)

    @cached_property
    def first_bins(self) -> NDArray[np.uintp]:
        """`(rows, columns)` first bin of each point's cell."""
        return (self.cells * (self.channel_count * self.bin_count)).astype(np.uintp)

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
    row, column = np.arange(ROWS) * rows // ROWS, np.arange(COLUMNS) * columns // COLUMNS
    cells = row[:, None] * columns + column[None, :]
    return BinLayout(np.ones((ROWS, COLUMNS), np.int32), cells, rows * columns, channel_count, bin_count)


def epanechnikov_layout(channel_count: int, bin_count: int) -> BinLayout:
    """Weights K(r^2) = 1 - r^2 in the ellipse inscribed in the box, 0 outside it (Ko et al. 2012, eq. 1)."""
    # Points lie at v = (2 i + 1) / ROWS - 1 and u = (2 j + 1) / COLUMNS - 1, here multiplied by ROWS * COLUMNS.
    v = COLUMNS * (2 * np.arange(ROWS) + 1 - ROWS)
    u = ROWS * (2 * np.arange(COLUMNS) + 1 - COLUMNS)
    squares = np.square(v)[:, None] + np.square(u)[None, :]
    return _one_cell(np.clip((ROWS * COLUMNS) ** 2 - squares, 0, None), channel_count, bin_count)


def distance_layout(rows: int, columns: int, channel_count: int, bin_count: int) -> BinLayout:
    """Weights 1 - r^2 with r the distance to the centre over that of the farthest point (Lee et al. 2012, eq. 1).

    Distances are those in a box resized to rows x columns: the corners have weight 0.
    """
    # Doubled distances are whole numbers.
    v, u = 2 * np.arange(rows) - (rows - 1), 2 * np.arange(columns) - (columns - 1)
    squares = np.square(v)[:, None] + np.square(u)[None, :]
    return _one_cell(squares.max() - squares, channel_count, bin_count)


def _one_cell(weights: NDArray[np.int64], channel_count: int, bin_count: int) -> BinLayout:
    return BinLayout(weights.astype(np.int32), np.zeros(weights.shape, np.int64), 1, channel_count, bin_count)


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
    _count(codes, boxes, layout.weights, layout.spans, layout.first_bins, layout.bin_count, out)
    return out


@kernel
def _count(
    codes: Codes,
    boxes: FloatArray,
    weights: NDArray[np.int32],
    spans: NDArray[np.uintp],
    first_bins: NDArray[np.uintp],
    bin_count: int,
    out: NDArray[np.float32],
) -> None:
    """Fill `out` with the counts of each box.

    Neighbours often fall into the same bin, and an addition waits for the one before it to be stored: points of odd
    columns have counts of their own. Unsigned indices spare a test for negative ones at every access.
    """
    height, width, channels = codes.shape
    rows, columns = weights.shape
    flat = codes.reshape(-1)
    places = np.empty(columns, np.uintp)
    counts = np.empty(2 * out.shape[1], np.int32)
    size, stride, one = np.uintp(out.shape[1]), np.uintp(bin_count), np.uintp(1)
    for n in range(boxes.shape[0]):
        for k in range(counts.size):
            counts[k] = 0
        # The points are in order, so that those inside the image follow each other.
        left, right = columns, 0
        for j in range(columns):
            column = math.floor(boxes[n, 0] + (j + 0.5) * boxes[n, 2] / columns)
            if 0 <= column < width:
                left, right = min(left, j), j + 1
                places[j] = np.uintp(column * channels)
        for i in range(rows):
            line = math.floor(boxes[n, 1] + (i + 0.5) * boxes[n, 3] / rows)
            if line < 0 or line >= height:
                continue
            start = np.uintp(line * width * channels)
            for j in range(np.uintp(max(spans[i, 0], left)), np.uintp(min(spans[i, 1], right))):
                at, weight, first = start + places[j], weights[i, j], first_bins[i, j] + size * (j & one)
                counts[first + np.uintp(flat[at])] += weight
                # Unrolled, as a loop over three channels takes half as long again.
                if channels == 3:
                    counts[first + stride + np.uintp(flat[at + one])] += weight
                    counts[first + stride + stride + np.uintp(flat[at + one + one])] += weight
        for k in range(size):
            out[n, k] = counts[k] + counts[k + size]


@dataclass(frozen=True, eq=False)
class Feature:
    """A histogram of a box.

    Attributes:
        encode: Maps an `(H, W, 3)` uint8 RGB image to `(H, W, C)` pixel codes, C is 1 or 3.
        layout: Weights and cells of the histogram.
    """

    encode: Callable[[Image], Codes]
    layout: BinLayout


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

    def encode(self, image: Image, boxes: FloatArray) -> EncodedRegion:
        """Encode the part of an image that `(N, 4)` boxes [px] touch: the expensive step, done once for all boxes."""
        region = crop(image, boxes)
        return EncodedRegion(self, region, tuple(feature.encode(region.pixels) for feature in self.features))


@dataclass(frozen=True, eq=False)
class EncodedRegion:
    """A part of an image as pixel codes in every feature of a model."""

    model: HistogramModel
    region: ImageRegion
    codes: tuple[Codes, ...]

    def similarities(self, boxes: FloatArray) -> FloatArray:
        """`(F, N)` Bhattacharyya similarities in [0, 1] of `(N, 4)` boxes [px] with the model in each feature.

        The boxes lie inside the hull of those that were encoded. The distance d of Ko et al. 2012, eq. 7, is `sqrt(1 -
        similarity)`.
        """
        local = self.region.to_region(boxes)
        parts = zip(self.codes, self.model.features, self.model.histograms, strict=True)
        return np.array([similarities(codes, local, feature.layout, model) for codes, feature, model in parts])
