"""Colour model: histograms of the target and of its surround (Possegger et al. 2015, eq. 3; Bertinetto et al. 2016).

A pixel's score is the probability that it belongs to the target by its colour alone, for equal numbers of pixels of
target and surround. The score of a position is the mean over a box of the target's size.
"""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.core.records import Image

BITS = 4  # per channel: 16 x 16 x 16 bins
INNER, OUTER = 0.8, 1.15  # the border of a box belongs neither to the target nor to the surround
CORE = 0.9  # share of the box that scores are averaged over

_PRIOR = np.float32(1e-3)
_HALF = np.float32(0.5)


class ColourModel:
    """Colours of the target and of its surround in patches that are centred on the target."""

    def __init__(self) -> None:
        self._histograms: NDArray[np.float32] | None = None
        self._scores = np.full(1 << 3 * BITS, 0.5, np.float32)

    def learn(self, patch: Image, width_px: float, height_px: float, rate: float) -> None:
        """Add an RGB patch with the target, `width_px` by `height_px`, in its middle, with weight `rate` in [0, 1]."""
        now = np.zeros((2, 1 << 3 * BITS), np.float32)
        _count(patch, width_px, height_px, now)
        if self._histograms is None:
            self._histograms = now
        else:
            self._histograms += np.float32(rate) * (now - self._histograms)
        target, surround = self._histograms
        self._scores = (target + _HALF * _PRIOR) / (target + surround + _PRIOR)

    def respond(self, patch: Image, width_px: float, height_px: float) -> NDArray[np.float32]:
        """`(rows, columns)` score in [0, 1] of a box of the given size centred on each pixel of an RGB patch."""
        scores = np.empty(patch.shape[:2], np.float32)
        _look_up(patch, self._scores, scores)
        box = [max(round(CORE * side) | 1, 1) for side in (width_px, height_px)]
        return np.asarray(cv2.boxFilter(scores, -1, box, borderType=cv2.BORDER_CONSTANT), dtype=np.float32)


@njit(nogil=True, cache=True)
def _bin(red: np.uint8, green: np.uint8, blue: np.uint8) -> int:
    drop = 8 - BITS
    return ((int(red) >> drop) << 2 * BITS) | ((int(green) >> drop) << BITS) | (int(blue) >> drop)


@njit(nogil=True, cache=True)
def _look_up(patch: Image, scores: NDArray[np.float32], out: NDArray[np.float32]) -> None:
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = scores[_bin(patch[i, j, 0], patch[i, j, 1], patch[i, j, 2])]


@njit(nogil=True, cache=True)
def _count(patch: Image, width: float, height: float, out: NDArray[np.float32]) -> None:
    """Fill `out` with the normalised histograms of the target and of the surround."""
    rows, columns = patch.shape[:2]
    for i in range(rows):
        down = 2.0 * abs(i + 0.5 - 0.5 * rows)
        for j in range(columns):
            across = 2.0 * abs(j + 0.5 - 0.5 * columns)
            k = _bin(patch[i, j, 0], patch[i, j, 1], patch[i, j, 2])
            if across < INNER * width and down < INNER * height:
                out[0, k] += np.float32(1)
            elif across > OUTER * width or down > OUTER * height:
                out[1, k] += np.float32(1)
    for part in range(2):
        total = np.float32(0)
        for k in range(out.shape[1]):
            total += out[part, k]
        if total > 0:
            for k in range(out.shape[1]):
                out[part, k] /= total
