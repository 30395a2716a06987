"""The part of an image that boxes touch, in blocks of pixels, so that a large box costs no more than a small one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Blocks:
    """A part of an image whose pixels are means of blocks of the image's.

    Attributes:
        pixels: `(h, w, 3)` uint8 RGB.
        origin: `(2,)` x, y of its corner in the image [px].
        step: `(2,)` width and height of a block, at least 1 and not always whole [px].
    """

    pixels: NDArray[np.uint8]
    origin: NDArray[np.float64]
    step: NDArray[np.float64]

    def local(self, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """`(N, 4)` boxes in its own pixels, given boxes in the image's."""
        out = boxes.copy()
        out[:, :2] -= self.origin
        out[:, :2] /= self.step
        out[:, 2:] /= self.step
        return out


def block_size(first: NDArray[np.float64], now: NDArray[np.float64], points: tuple[int, int]) -> tuple[float, float]:
    """How coarse an image may be read, so that a box has about as many blocks as points are read in it.

    A share of the first box, so that what keeps its size always looks the same, and an image twice as large is read
    the same in blocks twice as large. Halved or doubled where the target has come to be nearer to that.

    Args:
        first: `(2,)` width and height of the target's first box [px].
        now: `(2,)` the same of its box now [px].
        points: Columns and rows that will be read in a box.

    Returns:
        Width and height of a block, at least 1 [px].
    """
    turns = (round(math.log2(now[axis] / first[axis])) for axis in (0, 1))
    width, height = (max(first[axis] / points[axis] * 2.0**turn, 1.0) for axis, turn in enumerate(turns))
    return width, height


def read_blocks(image: NDArray[np.uint8], boxes: NDArray[np.float64], block: tuple[float, float]) -> Blocks:
    """What boxes touch, as means over blocks.

    Blocks lie on a grid fixed to the image, so that what stands still looks the same wherever the boxes are. One block
    more on every side is there for reading between blocks; what is left of the image beyond the last whole block is
    not read.

    Args:
        image: `(H, W, 3)` uint8 RGB.
        boxes: `(N, 4)` boxes [px].
        block: Width and height of a block, at least 1 [px]; less is taken where the image is smaller.
    """
    near = boxes[:, :2].min(axis=0)
    far = (boxes[:, :2] + boxes[:, 2:]).max(axis=0)
    starts: list[int] = []
    counts: list[int] = []
    steps: list[float] = []
    for axis, room in enumerate((image.shape[1], image.shape[0])):
        step = min(block[axis], float(room))
        blocks = int(room / step)
        first = min(max(math.floor(near[axis] / step) - 1, 0), blocks - 1)
        last = max(min(math.ceil(far[axis] / step) + 1, blocks), first + 1)
        starts.append(first)
        counts.append(last - first)
        steps.append(step)
    columns, rows = counts
    step = np.array(steps)
    if steps == [1.0, 1.0]:
        pixels = np.ascontiguousarray(image[starts[1] : starts[1] + rows, starts[0] : starts[0] + columns])
    else:
        pixels = np.empty((rows, columns, 3), np.uint8)
        left, right = int(starts[0] * steps[0]), min(math.ceil((starts[0] + columns) * steps[0]), image.shape[1])
        band = np.empty(3 * (right - left), np.float32)
        rowwise = image.reshape(image.shape[0], -1)[:, 3 * left : 3 * right]
        _average(rowwise, left, starts[0], starts[1], steps[0], steps[1], band, pixels)
    return Blocks(pixels, np.array(starts) * step, step)


@njit(nogil=True, cache=True)
def _average(
    image: NDArray[np.uint8],
    left: int,
    first_column: int,
    first_row: int,
    width: float,
    height: float,
    band: NDArray[np.float32],
    out: NDArray[np.uint8],
) -> None:
    """Fill `out` with means over blocks, of which pixels at the border count by the share that lies inside."""
    rows, columns = out.shape[:2]
    scale = np.float32(1.0 / (width * height))
    for i in range(rows):
        top, bottom = (first_row + i) * height, (first_row + i + 1) * height
        band[:] = np.float32(0)
        for v in range(int(top), min(int(np.ceil(bottom)), image.shape[0])):
            share = np.float32(min(v + 1.0, bottom) - max(float(v), top))
            row = image[v]
            for k in range(band.size):
                band[k] += share * np.float32(row[k])
        for j in range(columns):
            start, stop = (first_column + j) * width, (first_column + j + 1) * width
            red, green, blue = np.float32(0), np.float32(0), np.float32(0)
            for u in range(int(start), min(int(np.ceil(stop)), left + band.size // 3)):
                share = np.float32(min(u + 1.0, stop) - max(float(u), start))
                k = 3 * (u - left)
                red += share * band[k]
                green += share * band[k + 1]
                blue += share * band[k + 2]
            # A little more than a half: means that lie half way between two values are common, and must not be
            # left to rounding.
            out[i, j, 0] = np.uint8(min(red * scale + _HALF, _TOP))
            out[i, j, 1] = np.uint8(min(green * scale + _HALF, _TOP))
            out[i, j, 2] = np.uint8(min(blue * scale + _HALF, _TOP))


_HALF = np.float32(0.501)
_TOP = np.float32(255)
