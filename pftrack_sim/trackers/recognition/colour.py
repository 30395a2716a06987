"""Colour model: histograms of the target and of its surround (Possegger et al. 2015, eq. 3; Bertinetto et al. 2016).

A pixel's score is the probability that it belongs to the target by its colour alone, for equal numbers of pixels of
target and surround. The score of a position is the mean over a box of the target's size.
"""

from __future__ import annotations

import cv2
import numpy as np
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
        rows, columns = patch.shape[:2]
        down = np.abs(np.arange(1 - rows, rows, 2, dtype=np.float64)) / height_px
        across = np.abs(np.arange(1 - columns, columns, 2, dtype=np.float64)) / width_px
        away = np.maximum(down[:, None], across)
        bins = _bins(patch)
        now = np.stack([_shares(bins[away < INNER]), _shares(bins[away > OUTER])])
        if self._histograms is None:
            self._histograms = now
        else:
            self._histograms += np.float32(rate) * (now - self._histograms)
        target, surround = self._histograms
        self._scores = (target + _HALF * _PRIOR) / (target + surround + _PRIOR)

    def respond(self, patch: Image, width_px: float, height_px: float) -> NDArray[np.float32]:
        """`(rows, columns)` score in [0, 1] of a box of the given size centred on each pixel of an RGB patch."""
        scores = self._scores[_bins(patch)]
        box = [max(round(CORE * side) | 1, 1) for side in (width_px, height_px)]
        return np.asarray(cv2.boxFilter(scores, -1, box, borderType=cv2.BORDER_CONSTANT), dtype=np.float32)


def _bins(patch: Image) -> NDArray[np.int32]:
    """`(rows, columns)` bin of each pixel's colour."""
    red, green, blue = (np.asarray(one, dtype=np.uint8) >> np.uint8(8 - BITS) for one in cv2.split(patch))
    return (red.astype(np.int32) << 2 * BITS) | ((green << np.uint8(BITS)) | blue)


def _shares(bins: NDArray[np.int32]) -> NDArray[np.float32]:
    """Histogram that sums to 1, or is all 0 without pixels."""
    return np.bincount(bins, minlength=1 << 3 * BITS).astype(np.float32) / np.float32(max(bins.size, 1))
