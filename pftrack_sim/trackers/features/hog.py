"""Histograms of oriented gradients (HOG) of boxes resized to 16x24 (Lee et al. 2012, section III.2)."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.core.types import FloatArray

Floats: TypeAlias = NDArray[np.float32]

COLUMNS = 16
ROWS = 24
CELL_PX = 4
CELL_COLUMNS = COLUMNS // CELL_PX
CELL_ROWS = ROWS // CELL_PX
DIRECTION_COUNT = 8
SIZE = CELL_ROWS * CELL_COLUMNS * DIRECTION_COUNT

_BLUR_PX = 2  # radius of the blur
_STRIDE = COLUMNS + 2 * _BLUR_PX
_TANGENT = math.tan(math.pi / DIRECTION_COUNT)


def hog(grey: NDArray[np.uint8], boxes: FloatArray) -> FloatArray:
    """`(N, SIZE)` HOG descriptors of `(N, 4)` boxes [px] in an `(H, W)` uint8 image (Lee et al. 2012, eq. 2 to 5).

    Every box is resized to `COLUMNS` x `ROWS` by bilinear interpolation at the centres of the new pixels, blurred by
    the 5x5 Gaussian whose rows are (1, 4, 6, 4, 1)/16, and differentiated by (-1, 0, 1). Each pixel adds the magnitude
    of its gradient to the nearest of the eight directions 0, 45, ... 315 degrees (y down) in its cell of 4x4 pixels.
    Border pixels of the resized box and of the image are replicated.

    Descriptors are ordered by row of cells, column of cells, direction; each sums to 1, or is all 0 for a uniform box.
    """
    out = np.empty((len(boxes), SIZE))
    _describe(grey.astype(np.float32), boxes, out)
    return out


@njit(nogil=True, cache=True)
def _describe(grey: Floats, boxes: FloatArray, out: FloatArray) -> None:
    """Fill `out`. Loops apply the same operations to all pixels, so that they are vectorised."""
    patch = np.empty((ROWS + 2 * _BLUR_PX, _STRIDE), np.float32)
    smooth = np.zeros((ROWS + 3, _STRIDE), np.float32)
    column_sums = np.zeros((ROWS + 1) * _STRIDE, np.float32)
    line = np.empty(grey.shape[1], np.float32)
    lefts, rights, shares = np.empty(COLUMNS, np.uintp), np.empty(COLUMNS, np.uintp), np.empty(COLUMNS, np.float32)
    magnitudes, sectors = np.empty(ROWS * _STRIDE, np.float32), np.empty(ROWS * _STRIDE, np.int32)
    for n in range(boxes.shape[0]):
        _resize(grey, boxes[n], lefts, rights, shares, line, patch)
        _blur(patch, column_sums, smooth)
        _gradients(smooth, magnitudes, sectors, out[n])
        total = _sum(out[n])
        if total > 0.0:
            scale = 1.0 / total
            for k in range(SIZE):
                out[n, k] *= scale


@njit(nogil=True, cache=True)
def _resize(
    grey: Floats,
    box: FloatArray,
    lefts: NDArray[np.uintp],
    rights: NDArray[np.uintp],
    shares: Floats,
    line: Floats,
    patch: Floats,
) -> None:
    """Resize a box into the middle of `patch`, and replicate its border."""
    x, y, w, h = box[0], box[1], box[2], box[3]
    height, width = grey.shape
    for j in range(COLUMNS):
        u = min(max(x + (j + 0.5) * w / COLUMNS - 0.5, 0.0), width - 1.0)
        left = int(u)
        # Unsigned indices spare a test for negative ones at every access.
        lefts[j], rights[j] = np.uintp(left), np.uintp(min(left + 1, width - 1))
        shares[j] = np.float32(u - left)
    first, last = lefts[0], rights[COLUMNS - 1]
    for i in range(ROWS):
        v = min(max(y + (i + 0.5) * h / ROWS - 0.5, 0.0), height - 1.0)
        top = int(v)
        upper, lower = grey[top], grey[min(top + 1, height - 1)]
        down = np.float32(v - top)
        for k in range(first, last + np.uintp(1)):
            line[k] = upper[k] + (lower[k] - upper[k]) * down
        row = patch[i + _BLUR_PX]
        for j in range(COLUMNS):
            value = line[lefts[j]]
            row[j + _BLUR_PX] = value + (line[rights[j]] - value) * shares[j]
        for j in range(_BLUR_PX):
            row[j] = row[_BLUR_PX]
            row[COLUMNS + _BLUR_PX + j] = row[COLUMNS + _BLUR_PX - 1]
    for i in range(_BLUR_PX):
        patch[i] = patch[_BLUR_PX]
        patch[ROWS + _BLUR_PX + i] = patch[ROWS + _BLUR_PX - 1]


@njit(nogil=True, cache=True)
def _blur(patch: Floats, column_sums: Floats, smooth: Floats) -> None:
    """Blur `patch`, columns first, into the middle of `smooth`, and replicate its border.

    The loops run over all rows at once; what they put between two rows is overwritten or never read.
    """
    four, six, scale = np.float32(4), np.float32(6), np.float32(1 / 256)
    pixels, out = patch.reshape(-1), smooth.reshape(-1)[_STRIDE + 1 :]
    for k in range(ROWS * _STRIDE):
        upper, lower = pixels[k + _STRIDE], pixels[k + 3 * _STRIDE]
        column_sums[k] = pixels[k] + pixels[k + 4 * _STRIDE] + four * (upper + lower) + six * pixels[k + 2 * _STRIDE]
    for k in range(ROWS * _STRIDE):
        outer = column_sums[k] + column_sums[k + 4]
        out[k] = (outer + four * (column_sums[k + 1] + column_sums[k + 3]) + six * column_sums[k + 2]) * scale
    for i in range(1, ROWS + 1):
        smooth[i, 0] = smooth[i, 1]
        smooth[i, COLUMNS + 1] = smooth[i, COLUMNS]
    smooth[0] = smooth[1]
    smooth[ROWS + 1] = smooth[ROWS]


@njit(nogil=True, cache=True)
def _gradients(smooth: Floats, magnitudes: Floats, sectors: NDArray[np.int32], out: FloatArray) -> None:
    """Add the gradient magnitudes of `smooth` to their cells and directions."""
    out[:] = 0.0
    tangent = np.float32(_TANGENT)
    pixels = smooth.reshape(-1)
    for k in range(ROWS * _STRIDE):
        gx = pixels[k + _STRIDE + 2] - pixels[k + _STRIDE]
        gy = pixels[k + 2 * _STRIDE + 1] - pixels[k + 1]
        magnitudes[k] = np.sqrt(gx * gx + gy * gy)
        across, down = abs(gx), abs(gy)
        sectors[k] = (
            np.int32(gx > 0)
            + np.int32(2) * np.int32(gy > 0)
            + np.int32(4) * np.int32(down < tangent * across)
            + np.int32(8) * np.int32(across < tangent * down)
        )
    for i in range(np.uintp(ROWS)):
        first_cell = (i // np.uintp(CELL_PX)) * np.uintp(CELL_COLUMNS)
        for j in range(np.uintp(COLUMNS)):
            k = i * np.uintp(_STRIDE) + j
            first = (first_cell + j // np.uintp(CELL_PX)) * np.uintp(DIRECTION_COUNT)
            out[first + np.uintp(_DIRECTIONS[np.uintp(sectors[k])])] += magnitudes[k]


# Reassociation lets the sum be vectorised.
@njit(nogil=True, cache=True, fastmath={"reassoc"})
def _sum(values: FloatArray) -> float:
    total = 0.0
    for k in range(values.size):
        total += values[k]
    return total


_DIRECTIONS = np.array([5, 7, 3, 1, 4, 0, 4, 0, 6, 6, 2, 2, 0, 0, 0, 0])
"""Nearest of the eight directions, indexed by the sum of 1: right, 2: down, 4: nearly horizontal, 8: nearly vertical.
A table needs neither an arc tangent nor a branch."""
