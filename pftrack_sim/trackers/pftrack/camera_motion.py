"""Motion of the camera between successive images, as a shift of the whole image.

Phase correlation (Kuglin & Hines 1975): the inverse transform of the normalised cross-power spectrum of two images has
a peak at their displacement. Images are reduced to a fixed size, so that the cost does not depend on theirs.
"""

from __future__ import annotations

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.pftrack.pyramid import ImagePyramid
from pftrack_sim.trackers.pftrack.windows import hann

COLUMNS, ROWS = 128, 96
QUICK_COLUMNS, QUICK_ROWS = 80, 60
PEAK_RADIUS = 2
CERTAINTY_MIN = 0.5
"""What particle filters ask of a shift: recorded pairs of frames reach 0.5, half an image suddenly covered 0.4."""


class CameraMotion:
    """Shift between the last two images.

    Args:
        certainty_min: Least sum of the correlation within `PEAK_RADIUS` of its peak: below it the shift counts as
            unknown. Of a pure shift it is about 1.
        quick: Whether images are reduced by few samples to 80x60 instead of by means to 128x96: less than half of the
            time. Only the peak's neighbours then tell the place between cells, as far ones are mostly noise.
    """

    def __init__(self, certainty_min: float, *, quick: bool = False) -> None:
        self._certainty_min = certainty_min
        self._quick = quick
        self._shape = (QUICK_ROWS, QUICK_COLUMNS) if quick else (ROWS, COLUMNS)
        self._window = np.outer(*(hann(length) for length in self._shape))
        self._spectrum: NDArray[np.complex64] | None = None

    def shift(self, pyramid: ImagePyramid, width_px: int, height_px: int) -> FloatArray:
        """`(2,)` shift x, y [px] of the image's content since the previous call; 0 at first or where unknown."""
        rows_count, columns_count = self._shape
        reduced = self._reduce(pyramid, width_px, height_px)
        grey = np.asarray(reduced, dtype=np.float32)
        spectrum = np.asarray(scipy.fft.rfft2((grey - grey.mean()) * self._window), dtype=np.complex64)
        before, self._spectrum = self._spectrum, spectrum
        if before is None:
            return np.zeros(2)
        cross = spectrum * before.conj()
        cross /= np.abs(cross) + np.float32(1e-3)
        correlation = np.asarray(scipy.fft.irfft2(cross, self._shape), dtype=np.float32)
        row, column = divmod(int(correlation.argmax()), columns_count)
        rows = np.arange(row - PEAK_RADIUS, row + PEAK_RADIUS + 1)
        columns = np.arange(column - PEAK_RADIUS, column + PEAK_RADIUS + 1)
        peak = np.maximum(correlation[np.ix_(rows % rows_count, columns % columns_count)], 0.0)
        if float(peak.sum()) <= self._certainty_min:
            return np.zeros(2)
        if self._quick:
            peak, rows, columns = peak[1:-1, 1:-1], rows[1:-1], columns[1:-1]
        mass = float(peak.sum())
        x, y = float(peak.sum(axis=0) @ columns) / mass, float(peak.sum(axis=1) @ rows) / mass
        x, y = (x - columns_count if x > columns_count / 2 else x), (y - rows_count if y > rows_count / 2 else y)
        return np.array([x * width_px / columns_count, y * height_px / rows_count])

    def _reduce(self, pyramid: ImagePyramid, width_px: int, height_px: int) -> NDArray[np.uint8]:
        """The grey image at the size that is correlated."""
        rows, columns = self._shape
        if self._quick:
            sampled = cv2.resize(pyramid.image, (2 * columns, 2 * rows), interpolation=cv2.INTER_NEAREST)
            grey, interpolation = cv2.cvtColor(sampled, cv2.COLOR_RGB2GRAY), cv2.INTER_AREA
        else:
            grey = pyramid.grey(pyramid.level(min(width_px / columns, height_px / rows)))
            interpolation = cv2.INTER_LINEAR
        return np.asarray(cv2.resize(grey, (columns, rows), interpolation=interpolation), dtype=np.uint8)
