"""The region of an image that boxes touch, at full resolution or downsampled.

Only this region is converted and compared. It is downsampled for large boxes, so that a large target costs no more
than a small one. Blocks of pixels lie on a grid fixed to the image, so that a still target looks the same wherever the
boxes are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.compiled import kernel
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
        """`(N, 4+)` boxes [px of the region], given `(N, 4+)` boxes or states that are alike [px of the image]."""
        local = boxes.copy()
        local[:, :2] -= self.origin
        local[:, :4] /= np.tile(self.step, 2)
        return local


def block_size(first: FloatArray, now: FloatArray, points: tuple[int, int]) -> tuple[float, float]:
    """Width and height of blocks [px], at least 1, of which a box has about as many as columns and rows of points.

    The size is proportional to the `(2,)` width and height of the first box [px], so that appearance is constant for a
    constant size and independent of the image's resolution. It is multiplied by the power of two that best fits the
    present box.
    """
    turns = (round(math.log2(now[axis] / first[axis])) for axis in (0, 1))
    width, height = (max(first[axis] / points[axis] * 2.0**turn, 1.0) for axis, turn in enumerate(turns))
    return width, height


def whole_block_size(image: Image, size: FloatArray, points: tuple[int, int]) -> tuple[float, float]:
    """Width and height of the largest blocks of whole pixels of which a box has no fewer than columns and rows.

    `size` is the `(2,)` width and height of the box [px]. Blocks are never so large that the image itself has fewer.
    """
    room = image.shape[1::-1]
    width, height = (max(min(math.floor(size[axis] / points[axis]), room[axis] // points[axis]), 1) for axis in (0, 1))
    return float(width), float(height)


def crop(image: Image, boxes: FloatArray) -> ImageRegion:
    """The pixels that `(N, 4)` boxes touch, with a margin of one pixel, which texture patterns at the border need."""
    return block_means(image, boxes, (1.0, 1.0))


def block_means(image: Image, boxes: FloatArray, block: tuple[float, float]) -> ImageRegion:
    """The region that `(N, 4)` boxes [px] touch, as means over blocks whose size, at least 1 px, need not be whole.

    The region has a margin of one block for interpolation. Pixels of the image beyond the last whole block are ignored.
    Blocks are reduced where the image is smaller.
    """
    spans, steps = [(0, 1), (0, 1)], [1.0, 1.0]
    for axis, room in enumerate(image.shape[1::-1]):
        steps[axis] = step = min(block[axis], float(room))
        near, far = boxes[:, axis].min(), (boxes[:, axis] + boxes[:, axis + 2]).max()
        count = int(room / step)
        first = min(max(math.floor(near / step) - 1, 0), count - 1)
        spans[axis] = first, max(min(math.ceil(far / step) + 1, count), first + 1)
    (left, right), (top, bottom) = spans
    width, height = steps
    if width == height == 1.0:
        pixels = np.ascontiguousarray(image[top:bottom, left:right])
    else:
        pixels = np.empty((bottom - top, right - left, 3), np.uint8)
        _fill_means(image, left, top, width, height, pixels)
    step = np.array(steps)
    return ImageRegion(pixels, np.array([left, top]) * step, step)


def shrink(image: Image, size: tuple[int, int]) -> Image:
    """An `(H, W, 3)` image resized to `size` = (width, height) [px]; where reduced, the means of the parts.

    The values are those of OpenCV's `INTER_AREA`, in a third of its time where the factor is not whole.
    """
    height, width = image.shape[:2]
    if size[0] > width or size[1] > height or (width % size[0] == 0 and height % size[1] == 0):
        return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    out = np.empty((size[1], size[0], 3), np.uint8)
    _fill_means(image, 0, 0, width / size[0], height / size[1], out)
    return out


def _fill_means(image: Image, left: int, top: int, width: float, height: float, out: Image) -> None:
    """Fill `(h, w, 3)` with means over blocks of `width` x `height` px, the first one `left` and `top` blocks away."""
    first, end = int(left * width), min(math.ceil((left + out.shape[1]) * width), image.shape[1])
    rows, flat = image.reshape(image.shape[0], -1)[:, 3 * first : 3 * end], out.reshape(out.shape[0], -1)
    _area_means(rows, first, left, top, width, height, flat)


# Rows of red, green and blue one after the other let the sums over rows be vectorised.
@kernel
def _area_means(
    rows: NDArray[np.uint8], first: int, left: int, top: int, width: float, height: float, out: NDArray[np.uint8]
) -> None:
    """Means over blocks; pixels at a block's border count by the share that lies inside. `rows` begin at `first`."""
    end = first + rows.shape[1] // 3
    sums = np.empty(rows.shape[1], np.float32)
    scale, half, most = np.float32(1.0 / (width * height)), np.float32(0.501), np.float32(255.0)
    for i in range(out.shape[0]):
        upper, lower = (top + i) * height, (top + i + 1) * height
        for k in range(sums.size):
            sums[k] = np.float32(0.0)
        for v in range(int(upper), min(math.ceil(lower), rows.shape[0])):
            share = np.float32(min(v + 1.0, lower) - max(float(v), upper))
            row = rows[v]
            for k in range(sums.size):
                sums[k] += share * np.float32(row[k])
        for j in range(out.shape[1] // 3):
            start, stop = (left + j) * width, (left + j + 1) * width
            red, green, blue = np.float32(0.0), np.float32(0.0), np.float32(0.0)
            for u in range(int(start), min(math.ceil(stop), end)):
                share = np.float32(min(u + 1.0, stop) - max(float(u), start))
                k = 3 * (u - first)
                red += share * sums[k]
                green += share * sums[k + 1]
                blue += share * sums[k + 2]
            # Rounded at a little more than a half: means half-way between two values are common, and must not depend
            # on rounding errors.
            out[i, 3 * j] = np.uint8(min(red * scale + half, most))
            out[i, 3 * j + 1] = np.uint8(min(green * scale + half, most))
            out[i, 3 * j + 2] = np.uint8(min(blue * scale + half, most))
