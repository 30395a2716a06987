"""Maps of oriented gradients: a descriptor for every cell of 4x4 pixels (Felzenszwalb et al. 2010, section 6).

Nine directions without sign, each the sum over the four normalisations by neighbouring cells, and the four gradient
energies under these normalisations: the 13 channels of the paper's analytic dimensionality reduction (section 6.2).
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.compiled import kernel

Floats: TypeAlias = NDArray[np.float32]

CELL_PX = 4
DIRECTIONS = 9
CHANNELS = DIRECTIONS + 4

_ONE, _HALF, _CLIP = np.float32(1), np.float32(0.5), np.float32(0.2)
_ENERGY_SHARE = np.float32(1 / math.sqrt(18))
_FLOOR = np.float32(0.1)
"""Added to energies: below contrasts of a grey value or so, patches are uniform."""
_COSINES = np.cos(np.arange(DIRECTIONS) * math.pi / DIRECTIONS).astype(np.float32)
_SINES = np.sin(np.arange(DIRECTIONS) * math.pi / DIRECTIONS).astype(np.float32)


def hog_map(grey: NDArray[np.uint8], window: Floats, out: Floats) -> None:
    """Describe the cells of a patch.

    Args:
        grey: `(4 n, 4 m)` uint8.
        window: `(n, m)` factor of each cell.
        out: `(CHANNELS, n, m)`, filled.
    """
    rows, columns = window.shape
    _describe(grey, window, np.zeros((rows + 2, columns + 2, DIRECTIONS), np.float32), out)


@kernel
def _describe(grey: NDArray[np.uint8], window: Floats, histograms: Floats, out: Floats) -> None:
    """Add every pixel's gradient magnitude to its nearest direction in the four nearest cells, then normalise.

    `(n + 2, m + 2, DIRECTIONS)` histograms are 0 and have a border of one cell.
    """
    rows, columns = window.shape
    height, width = grey.shape
    magnitudes = np.empty(width, np.float32)
    directions = np.empty(width, np.int32)
    for i in range(height):
        above, row, below = grey[max(i - 1, 0)], grey[i], grey[min(i + 1, height - 1)]
        for j in range(width):
            dx = np.float32(row[min(j + 1, width - 1)]) - np.float32(row[max(j - 1, 0)])
            dy = np.float32(below[j]) - np.float32(above[j])
            best, direction = np.float32(0), np.int32(0)
            for k in range(DIRECTIONS):
                along = abs(_COSINES[k] * dx + _SINES[k] * dy)
                if along > best:
                    best, direction = along, np.int32(k)
            magnitudes[j], directions[j] = np.sqrt(dx * dx + dy * dy), direction
        v = np.float32((i + 0.5) / CELL_PX + 0.5)
        top = int(v)
        down = v - np.float32(top)
        for j in range(width):
            u = np.float32((j + 0.5) / CELL_PX + 0.5)
            left = int(u)
            right = u - np.float32(left)
            direction = directions[j]
            lower = magnitudes[j] * down
            upper = magnitudes[j] - lower
            histograms[top, left, direction] += upper * (_ONE - right)
            histograms[top, left + 1, direction] += upper * right
            histograms[top + 1, left, direction] += lower * (_ONE - right)
            histograms[top + 1, left + 1, direction] += lower * right
    energies = np.empty((rows + 2, columns + 2), np.float32)
    for i in range(rows + 2):
        for j in range(columns + 2):
            energy = np.float32(0)
            for k in range(DIRECTIONS):
                energy += histograms[i, j, k] * histograms[i, j, k]
            energies[i, j] = energy
    for i in range(rows):
        for j in range(columns):
            here = energies[i + 1, j + 1] + _FLOOR
            up, down = energies[i, j + 1], energies[i + 2, j + 1]
            left, right = energies[i + 1, j], energies[i + 1, j + 2]
            n0 = _ONE / np.sqrt(here + up + left + energies[i, j])
            n1 = _ONE / np.sqrt(here + up + right + energies[i, j + 2])
            n2 = _ONE / np.sqrt(here + down + left + energies[i + 2, j])
            n3 = _ONE / np.sqrt(here + down + right + energies[i + 2, j + 2])
            t0, t1, t2, t3 = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
            for k in range(DIRECTIONS):
                value = histograms[i + 1, j + 1, k]
                c0, c1 = min(value * n0, _CLIP), min(value * n1, _CLIP)
                c2, c3 = min(value * n2, _CLIP), min(value * n3, _CLIP)
                out[k, i, j] = _HALF * window[i, j] * (c0 + c1 + c2 + c3)
                t0 += c0
                t1 += c1
                t2 += c2
                t3 += c3
            share = _ENERGY_SHARE * window[i, j]
            out[DIRECTIONS, i, j] = share * t0
            out[DIRECTIONS + 1, i, j] = share * t1
            out[DIRECTIONS + 2, i, j] = share * t2
            out[DIRECTIONS + 3, i, j] = share * t3
