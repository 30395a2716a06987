"""Histograms of oriented gradients of boxes, each resized to 16x24 (Lee et al. 2012, section III.2)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

COLUMNS = 16
ROWS = 24
CELL_PX = 4
CELL_COLUMNS = COLUMNS // CELL_PX
CELL_ROWS = ROWS // CELL_PX
DIRECTION_COUNT = 8
SIZE = CELL_ROWS * CELL_COLUMNS * DIRECTION_COUNT

_BLUR_PX = 2  # how far the blur reaches
_TANGENT = math.tan(math.pi / DIRECTION_COUNT)


def hog(grey: NDArray[np.uint8], boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Descriptors of many boxes (Lee et al. 2012, eq. 2 to 5).

    Every box is resized to `COLUMNS` x `ROWS` by bilinear interpolation at the centres of the new pixels, blurred by
    the 5x5 Gaussian whose rows are (1, 4, 6, 4, 1)/16, and differentiated by (-1, 0, 1). Each pixel adds the length of
    its gradient to the nearest of the eight directions 0, 45, ... 315 degrees (y down) in its cell of 4x4 pixels.
    Beyond the edge of the resized box, and of the image, the edge repeats.

    Args:
        grey: `(H, W)` uint8.
        boxes: `(N, 4)` x, y, w, h [px].

    Returns:
        `(N, SIZE)` numbers: row of cells, column of cells, direction; each descriptor sums to 1, or is all 0 where
        the box is of one grey.
    """
    out = np.empty((len(boxes), SIZE))
    wide = COLUMNS + 2 * _BLUR_PX
    patch = np.empty((ROWS + 2 * _BLUR_PX, wide), np.float32)
    mixed = np.empty((ROWS, wide), np.float32)
    smooth = np.empty((ROWS + 2, COLUMNS + 2), np.float32)
    lefts, rights, shares = np.empty(COLUMNS, np.int64), np.empty(COLUMNS, np.int64), np.empty(COLUMNS, np.float32)
    _describe(grey, boxes, patch, mixed, smooth, lefts, rights, shares, out)
    return out


@njit(nogil=True, cache=True)
def _describe(
    grey: NDArray[np.uint8],
    boxes: NDArray[np.float64],
    patch: NDArray[np.float32],
    mixed: NDArray[np.float32],
    smooth: NDArray[np.float32],
    lefts: NDArray[np.int64],
    rights: NDArray[np.int64],
    shares: NDArray[np.float32],
    out: NDArray[np.float64],
) -> None:
    """Fill `out`; everything else is scratch, and nothing is allocated."""
    for n in range(boxes.shape[0]):
        _resize(grey, boxes[n, 0], boxes[n, 1], boxes[n, 2], boxes[n, 3], lefts, rights, shares, patch)
        _blur(patch, mixed, smooth)
        total = _gradients(smooth, out[n])
        if total > 0.0:
            for k in range(SIZE):
                out[n, k] /= total


@njit(nogil=True, cache=True)
def _resize(
    grey: NDArray[np.uint8],
    x: float,
    y: float,
    w: float,
    h: float,
    lefts: NDArray[np.int64],
    rights: NDArray[np.int64],
    shares: NDArray[np.float32],
    patch: NDArray[np.float32],
) -> None:
    """Read a box into the middle of `patch`, and repeat its edge around it."""
    height, width = grey.shape
    for j in range(COLUMNS):
        u = min(max(x + (j + 0.5) * w / COLUMNS - 0.5, 0.0), width - 1.0)
        lefts[j] = int(u)
        rights[j] = min(lefts[j] + 1, width - 1)
        shares[j] = np.float32(u - lefts[j])
    for i in range(ROWS):
        v = min(max(y + (i + 0.5) * h / ROWS - 0.5, 0.0), height - 1.0)
        upper = int(v)
        lower = min(upper + 1, height - 1)
        down = np.float32(v - upper)
        row = patch[i + _BLUR_PX]
        for j in range(COLUMNS):
            left, right, along = lefts[j], rights[j], shares[j]
            above = np.float32(grey[upper, left]) * (np.float32(1) - along) + np.float32(grey[upper, right]) * along
            below = np.float32(grey[lower, left]) * (np.float32(1) - along) + np.float32(grey[lower, right]) * along
            row[j + _BLUR_PX] = above + (below - above) * down
        for j in range(_BLUR_PX):
            row[j] = row[_BLUR_PX]
            row[COLUMNS + _BLUR_PX + j] = row[COLUMNS + _BLUR_PX - 1]
    for i in range(_BLUR_PX):
        patch[i] = patch[_BLUR_PX]
        patch[ROWS + _BLUR_PX + i] = patch[ROWS + _BLUR_PX - 1]


@njit(nogil=True, cache=True)
def _blur(patch: NDArray[np.float32], mixed: NDArray[np.float32], smooth: NDArray[np.float32]) -> None:
    """5x5 Gaussian of `patch`, down and then across, into the middle of `smooth`; its edge is repeated around it."""
    four, six, scale = np.float32(4), np.float32(6), np.float32(1 / 256)
    for i in range(ROWS):
        for j in range(COLUMNS + 2 * _BLUR_PX):
            outer = patch[i, j] + patch[i + 4, j]
            mixed[i, j] = outer + four * (patch[i + 1, j] + patch[i + 3, j]) + six * patch[i + 2, j]
    for i in range(ROWS):
        for j in range(COLUMNS):
            outer = mixed[i, j] + mixed[i, j + 4]
            value = outer + four * (mixed[i, j + 1] + mixed[i, j + 3]) + six * mixed[i, j + 2]
            smooth[i + 1, j + 1] = value * scale
        smooth[i + 1, 0] = smooth[i + 1, 1]
        smooth[i + 1, COLUMNS + 1] = smooth[i + 1, COLUMNS]
    smooth[0] = smooth[1]
    smooth[ROWS + 1] = smooth[ROWS]


@njit(nogil=True, cache=True)
def _gradients(smooth: NDArray[np.float32], out: NDArray[np.float64]) -> float:
    """Put the gradients of `smooth` into their cells and directions; returns the sum of their lengths."""
    out[:] = 0.0
    total = 0.0
    for i in range(ROWS):
        first_of_row = (i // CELL_PX) * CELL_COLUMNS
        for j in range(COLUMNS):
            gx = smooth[i + 1, j + 2] - smooth[i + 1, j]
            gy = smooth[i + 2, j + 1] - smooth[i, j + 1]
            length = np.sqrt(gx * gx + gy * gy)
            direction = _direction(gx, gy)
            out[(first_of_row + j // CELL_PX) * DIRECTION_COUNT + direction] += length
            total += length
    return total


@njit(nogil=True, cache=True)
def _direction(gx: float, gy: float) -> int:
    """Nearest of the eight directions, without the cost of an arc tangent."""
    if abs(gy) < _TANGENT * abs(gx):
        return 0 if gx > 0 else 4
    if abs(gx) < _TANGENT * abs(gy):
        return 2 if gy > 0 else 6
    if gy > 0:
        return 1 if gx > 0 else 3
    return 7 if gx > 0 else 5
