"""The region of an image that boxes touch, at full resolution or downsampled.

Only this region is converted and compared. It is downsampled for large boxes, so that a large target costs no more
than a small one. Blocks of pixels lie on a grid fixed to the image, so that a still target looks the same wherever the
boxes are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray


@dataclass(frozen=True, eq=False)
class ImageRegion:
    """A region of an image, whose pixels are means of blocks of the image's pixels.

    Attributes:
        pixels: `(h, w, 3)` uint8 RGB, at least one pixel.
        origin: `(2,)` x, y of its corner in the image [px].
        step: `(2,)` width and height of a block [px of the image].
    """

    pixels: Image
    origin: FloatArray
    step: FloatArray

    def to_region(self, boxes: FloatArray) -> FloatArray:
        """`(N, 4)` boxes [px of the region], given `(N, 4)` boxes [px of the image]."""
        out = np.empty((len(boxes), 4))
        fill_in_region(boxes, self.origin, self.step, out)
        return out


@njit(nogil=True, cache=True)
def fill_in_region(boxes: FloatArray, origin: FloatArray, step: FloatArray, out: FloatArray) -> None:
    """Fill `(N, 4)` with boxes in pixels of the region."""
    for n in range(boxes.shape[0]):
        for axis in range(2):
            out[n, axis] = (boxes[n, axis] - origin[axis]) / step[axis]
            out[n, axis + 2] = boxes[n, axis + 2] / step[axis]


def crop(image: Image, boxes: FloatArray) -> ImageRegion:
    """The pixels that `(N, 4)` boxes touch, with a margin of one pixel, which texture patterns at the border need."""
    left, right, top, bottom = _pixels_touched(boxes, image.shape[1], image.shape[0])
    return ImageRegion(np.ascontiguousarray(image[top:bottom, left:right]), np.array([left, top], float), np.ones(2))


def downsample(image: Image, boxes: FloatArray, size: tuple[float, float], points: tuple[int, int]) -> ImageRegion:
    """The region that `(N, 4)` boxes [px] touch, with as many pixels to a box of `size` [px] as points, or more.

    `points` are the columns and rows that are sampled in a box. The region has a margin of one block for interpolation.
    """
    starts, stops, steps = [0, 0], [0, 0], [1, 1]
    for axis, room in enumerate((image.shape[1], image.shape[0])):
        # Never so coarse that the image itself has fewer blocks than there are points.
        step = max(min(math.floor(size[axis] / points[axis]), room // points[axis]), 1)
        first, last = _blocks_touched(boxes, axis, step, room // step)
        starts[axis], stops[axis], steps[axis] = first * step, last * step, step
    pixels = image[starts[1] : stops[1], starts[0] : stops[0]]
    if steps == [1, 1]:
        pixels = np.ascontiguousarray(pixels)
    else:
        shape = ((stops[0] - starts[0]) // steps[0], (stops[1] - starts[1]) // steps[1])
        pixels = np.asarray(cv2.resize(pixels, shape, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    return ImageRegion(pixels, np.array(starts, dtype=np.float64), np.array(steps, dtype=np.float64))


def block_size(first: FloatArray, now: FloatArray, points: tuple[int, int]) -> tuple[float, float]:
    """Width and height of blocks [px], at least 1, of which a box has about as many as columns and rows of points.

    The size is proportional to the `(2,)` width and height of the first box [px], so that appearance is constant for a
    constant size and independent of the image's resolution. It is multiplied by the power of two that best fits the
    present box.
    """
    turns = (round(math.log2(now[axis] / first[axis])) for axis in (0, 1))
    width, height = (max(first[axis] / points[axis] * 2.0**turn, 1.0) for axis, turn in enumerate(turns))
    return width, height


def block_means(image: Image, boxes: FloatArray, block: tuple[float, float]) -> ImageRegion:
    """The region that `(N, 4)` boxes [px] touch, as means over blocks whose size, at least 1 px, need not be whole.

    The region has a margin of one block for interpolation. Pixels of the image beyond the last whole block are ignored.
    Blocks are reduced where the image is smaller.
    """
    width, height = (min(block[axis], float(image.shape[1 - axis])) for axis in (0, 1))
    left, right = _blocks_touched(boxes, 0, width, int(image.shape[1] / width))
    top, bottom = _blocks_touched(boxes, 1, height, int(image.shape[0] / height))
    if width == height == 1.0:
        pixels = np.ascontiguousarray(image[top:bottom, left:right])
    else:
        pixels = np.empty((bottom - top, right - left, 3), np.uint8)
        first, last = int(left * width), min(math.ceil(right * width), image.shape[1])
        row_sums = np.empty(3 * (last - first), np.float32)
        rows = image.reshape(image.shape[0], -1)[:, 3 * first : 3 * last]
        _block_means(rows, first, left, top, width, height, row_sums, pixels)
    step = np.array([width, height])
    return ImageRegion(pixels, np.array([left, top]) * step, step)


def shrink(image: Image, size: tuple[int, int]) -> Image:
    """An `(H, W, 3)` image reduced to `size` = (width, height) [px], each pixel the mean of its part of the image.

    The values are those of OpenCV's `INTER_AREA`, in a third of its time where the factor is not whole.
    """
    height, width = image.shape[:2]
    enlarged = size[0] > width or size[1] > height
    if enlarged or (width % size[0] == 0 and height % size[1] == 0):
        return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    out = np.empty((size[1], 3 * size[0]), np.uint8)
    _shrink(image.reshape(height, -1), *_shares(width, size[0]), *_shares(height, size[1]), out)
    return out.reshape(size[1], size[0], 3)


@lru_cache(maxsize=16)
def _shares(length: int, count: int) -> tuple[NDArray[np.uintp], NDArray[np.float32]]:
    """First pixel `(count,)` of each of the equal parts of a line, and `(count, K)` shares that K pixels have in it."""
    step = length / count
    low = np.arange(count) * step
    high = np.minimum(low + step, length)
    most = min(math.ceil(step) + 1, length)
    first = np.minimum(low.astype(np.int64), length - most)
    pixel = first[:, None] + np.arange(most)
    inside = np.minimum(high[:, None], pixel + 1) - np.maximum(low[:, None], pixel)
    # OpenCV leaves out slivers.
    shares = np.where(inside > 1e-3, inside, 0.0) / np.minimum(step, length - low)[:, None]
    return first.astype(np.uintp), shares.astype(np.float32)


@njit(nogil=True, cache=True)
def _shrink(
    rows: NDArray[np.uint8],
    first_columns: NDArray[np.uintp],
    column_shares: NDArray[np.float32],
    first_rows: NDArray[np.uintp],
    row_shares: NDArray[np.float32],
    out: NDArray[np.uint8],
) -> None:
    """Fill `(h, 3 w)` with the weighted means of the red, green and blue of `(H, 3 W)`."""
    one, three = np.uintp(1), np.uintp(3)
    line = np.empty(rows.shape[1], np.float32)
    along, total = np.empty(out.shape[1], np.float32), np.empty(out.shape[1], np.float32)
    for i in range(out.shape[0]):
        total[:] = np.float32(0)
        for k in range(row_shares.shape[1]):
            if row_shares[i, k] == 0:
                continue
            row = rows[first_rows[i] + np.uintp(k)]
            for u in range(line.size):
                line[u] = np.float32(row[u])
            for j in range(first_columns.size):
                at = three * first_columns[j]
                red, green, blue = np.float32(0), np.float32(0), np.float32(0)
                for c in range(column_shares.shape[1]):
                    share = column_shares[j, c]
                    red += line[at] * share
                    green += line[at + one] * share
                    blue += line[at + one + one] * share
                    at += three
                along[3 * j], along[3 * j + 1], along[3 * j + 2] = red, green, blue
            for j in range(total.size):
                total[j] += row_shares[i, k] * along[j]
        for j in range(total.size):
            out[i, j] = np.uint8(np.rint(total[j]))


@njit(nogil=True, cache=True)
def _pixels_touched(boxes: FloatArray, width: int, height: int) -> tuple[int, int, int, int]:
    """`_blocks_touched` along both axes of an image, for blocks of one pixel."""
    return *_blocks_touched(boxes, 0, 1.0, width), *_blocks_touched(boxes, 1, 1.0, height)


@njit(nogil=True, cache=True)
def _blocks_touched(boxes: FloatArray, axis: int, step: float, count: int) -> tuple[int, int]:
    """First block and one after the last that boxes touch along an axis, with a margin of one; at least one."""
    near, far = _hull(boxes, axis)
    first = min(max(math.floor(near / step) - 1, 0), count - 1)
    return first, max(min(math.ceil(far / step) + 1, count), first + 1)


@njit(nogil=True, cache=True)
def _hull(boxes: FloatArray, axis: int) -> tuple[float, float]:
    """Least and greatest coordinate of `(N, 4)` boxes along an axis, N >= 1."""
    near, far = boxes[0, axis], boxes[0, axis] + boxes[0, axis + 2]
    for n in range(1, boxes.shape[0]):
        near, far = min(near, boxes[n, axis]), max(far, boxes[n, axis] + boxes[n, axis + 2])
    return near, far


@njit(nogil=True, cache=True)
def _block_means(
    image: NDArray[np.uint8],
    left: int,
    first_column: int,
    first_row: int,
    width: float,
    height: float,
    row_sums: NDArray[np.float32],
    out: NDArray[np.uint8],
) -> None:
    """Fill `out` with means over blocks; pixels at a block's border count by the share that lies inside."""
    rows, columns = out.shape[:2]
    scale = np.float32(1.0 / (width * height))
    for i in range(rows):
        top, bottom = (first_row + i) * height, (first_row + i + 1) * height
        row_sums[:] = np.float32(0)
        for v in range(int(top), min(int(np.ceil(bottom)), image.shape[0])):
            share = np.float32(min(v + 1.0, bottom) - max(float(v), top))
            row = image[v]
            for k in range(row_sums.size):
                row_sums[k] += share * np.float32(row[k])
        for j in range(columns):
            start, stop = (first_column + j) * width, (first_column + j + 1) * width
            red, green, blue = np.float32(0), np.float32(0), np.float32(0)
            for u in range(int(start), min(int(np.ceil(stop)), left + row_sums.size // 3)):
                share = np.float32(min(u + 1.0, stop) - max(float(u), start))
                k = 3 * (u - left)
                red += share * row_sums[k]
                green += share * row_sums[k + 1]
                blue += share * row_sums[k + 2]
            # Rounded at a little more than a half: means half-way between two values are common, and must not depend
            # on rounding errors.
            out[i, j, 0] = np.uint8(min(red * scale + _HALF, _TOP))
            out[i, j, 1] = np.uint8(min(green * scale + _HALF, _TOP))
            out[i, j, 2] = np.uint8(min(blue * scale + _HALF, _TOP))


_HALF = np.float32(0.501)
_TOP = np.float32(255)
