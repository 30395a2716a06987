"""Histograms of oriented gradients (HOG) of boxes resized to 16x24 (Lee et al. 2012, section III.2)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.compiled import kernel
from pftrack_sim.core.types import FloatArray

COLUMNS = 16
ROWS = 24
CELL_PX = 4
CELL_COLUMNS = COLUMNS // CELL_PX
CELL_ROWS = ROWS // CELL_PX
DIRECTION_COUNT = 8
SIZE = CELL_ROWS * CELL_COLUMNS * DIRECTION_COUNT

_STRIDE = COLUMNS + 4  # Pixels of a resized box with its border, per row
_TWO = np.uintp(2)
_TANGENT = np.float32(math.tan(math.pi / DIRECTION_COUNT))
_DIRECTIONS = np.array([5, 7, 3, 1, 4, 0, 4, 0, 6, 6, 2, 2])
"""Nearest of the eight directions, indexed by the sum of 1: right, 2: down, 4: nearly horizontal, 8: nearly vertical.
A table needs neither an arc tangent nor a branch."""


def hog(grey: NDArray[np.uint8], boxes: FloatArray) -> FloatArray:
    """`(N, SIZE)` HOG descriptors of `(N, 4)` boxes [px] in an `(H, W)` uint8 image (Lee et al. 2012, eq. 2 to 5).

    Every box is resized to `COLUMNS` x `ROWS` by bilinear interpolation at the centres of the new pixels, blurred by
    the 5x5 Gaussian whose rows are (1, 4, 6, 4, 1)/16, and differentiated by (-1, 0, 1). Each pixel adds the magnitude
    of its gradient to the nearest of the eight directions 0, 45, ... 315 degrees (y down) in its cell of 4x4 pixels.
    Border pixels of the resized box and of the image are replicated.

    Descriptors are ordered by row of cells, column of cells, direction; each sums to 1, or is all 0 for a uniform box.
    """
    out = np.zeros((len(boxes), SIZE))
    _describe(grey.astype(np.float32), boxes, _DIRECTIONS, out)
    totals = out.sum(axis=1, keepdims=True)
    return np.divide(out, totals, out=out, where=totals > 0.0)


@kernel
def _describe(grey: NDArray[np.float32], boxes: FloatArray, directions: NDArray[np.int64], out: FloatArray) -> None:
    """Add gradient magnitudes to `out`.

    Arrays have the replicated borders that the next step reads, and lie in one row: loops over all pixels at once are
    vectorised; what they put between two rows is overwritten or never read.
    """
    height, width = grey.shape
    patch = np.empty((ROWS + 4) * _STRIDE, np.float32)
    down = np.zeros((ROWS + 1) * _STRIDE, np.float32)
    smooth = np.zeros((ROWS + 3) * _STRIDE, np.float32)
    magnitudes, sectors = np.empty(ROWS * _STRIDE, np.float32), np.empty(ROWS * _STRIDE, np.int32)
    lefts, rights, shares = np.empty(COLUMNS, np.uintp), np.empty(COLUMNS, np.uintp), np.empty(COLUMNS, np.float32)
    line = np.empty(width, np.float32)
    four, six, scale = np.float32(4.0), np.float32(6.0), np.float32(1.0 / 256.0)
    for n in range(boxes.shape[0]):
        for j in range(COLUMNS):
            u = min(max(boxes[n, 0] + (j + 0.5) * boxes[n, 2] / COLUMNS - 0.5, 0.0), width - 1.0)
            lefts[j], rights[j], shares[j] = np.uintp(u), np.uintp(min(int(u) + 1, width - 1)), u - int(u)
        for i in range(ROWS + 4):
            row = min(max(i - 2, 0), ROWS - 1)
            v = min(max(boxes[n, 1] + (row + 0.5) * boxes[n, 3] / ROWS - 0.5, 0.0), height - 1.0)
            upper, lower, share = grey[int(v)], grey[min(int(v) + 1, height - 1)], np.float32(v - int(v))
            for k in range(lefts[0], rights[COLUMNS - 1] + np.uintp(1)):
                line[k] = upper[k] + (lower[k] - upper[k]) * share
            first = np.uintp(i * _STRIDE)
            for j in range(np.uintp(COLUMNS)):
                patch[first + j + _TWO] = line[lefts[j]] + (line[rights[j]] - line[lefts[j]]) * shares[j]
            for j in range(_TWO):
                patch[first + j] = patch[first + _TWO]
                patch[first + np.uintp(COLUMNS + 2) + j] = patch[first + np.uintp(COLUMNS + 1)]
        for k in range(ROWS * _STRIDE):
            near, far = patch[k + _STRIDE] + patch[k + 3 * _STRIDE], patch[k] + patch[k + 4 * _STRIDE]
            down[k] = far + four * near + six * patch[k + 2 * _STRIDE]
        for k in range(ROWS * _STRIDE):
            inner = four * (down[k + 1] + down[k + 3]) + six * down[k + 2]
            smooth[k + _STRIDE + 1] = (down[k] + down[k + 4] + inner) * scale
        for i in range(1, ROWS + 1):
            smooth[i * _STRIDE] = smooth[i * _STRIDE + 1]
            smooth[i * _STRIDE + COLUMNS + 1] = smooth[i * _STRIDE + COLUMNS]
        for j in range(_STRIDE):
            smooth[j] = smooth[_STRIDE + j]
            smooth[(ROWS + 1) * _STRIDE + j] = smooth[ROWS * _STRIDE + j]
        for k in range(ROWS * _STRIDE):
            gx = smooth[k + _STRIDE + 2] - smooth[k + _STRIDE]
            gy = smooth[k + 2 * _STRIDE + 1] - smooth[k + 1]
            across, up = abs(gx), abs(gy)
            magnitudes[k] = np.sqrt(gx * gx + gy * gy)
            sectors[k] = (
                np.int32(gx > 0)
                + np.int32(2) * np.int32(gy > 0)
                + np.int32(4) * np.int32(up < _TANGENT * across)
                + np.int32(8) * np.int32(across < _TANGENT * up)
            )
        for i in range(np.uintp(ROWS)):
            for j in range(np.uintp(COLUMNS)):
                cell = i // np.uintp(CELL_PX) * np.uintp(CELL_COLUMNS) + j // np.uintp(CELL_PX)
                k = i * np.uintp(_STRIDE) + j
                direction = np.uintp(directions[np.uintp(sectors[k])])
                out[n, cell * np.uintp(DIRECTION_COUNT) + direction] += magnitudes[k]
