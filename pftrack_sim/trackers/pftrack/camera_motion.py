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
PEAK_RADIUS = 2
CERTAINTY_MIN = 0.5
"""What particle filters ask of a shift: recorded pairs of frames reach 0.5, half an image suddenly covered 0.4."""


class CameraMotion:
    """Shift between the last two images.

    Args:
        certainty_min: Least sum of the correlation within `PEAK_RADIUS` of its peak: below it the shift counts as
            unknown. Of a pure shift it is about 1.
    """

    def __init__(self, certainty_min: float) -> None:
        self._certainty_min = certainty_min
        self._window = np.outer(hann(ROWS), hann(COLUMNS))
        self._spectrum: NDArray[np.complex64] | None = None

    def shift(self, pyramid: ImagePyramid, width_px: int, height_px: int) -> FloatArray:
        """`(2,)` shift x, y [px] of the image's content since the previous call; 0 at first or where unknown."""
        full = pyramid.grey(pyramid.level(min(width_px / COLUMNS, height_px / ROWS)))
        reduced = cv2.resize(full, (COLUMNS, ROWS), interpolation=cv2.INTER_LINEAR)
        grey = np.asarray(reduced, dtype=np.float32)
        spectrum = np.asarray(scipy.fft.rfft2((grey - grey.mean()) * self._window), dtype=np.complex64)
        before, self._spectrum = self._spectrum, spectrum
        if before is None:
            return np.zeros(2)
        cross = spectrum * before.conj()
        cross /= np.abs(cross) + np.float32(1e-3)
        correlation = np.asarray(scipy.fft.irfft2(cross, (ROWS, COLUMNS)), dtype=np.float32)
        row, column = divmod(int(correlation.argmax()), COLUMNS)
        rows = np.arange(row - PEAK_RADIUS, row + PEAK_RADIUS + 1)
        columns = np.arange(column - PEAK_RADIUS, column + PEAK_RADIUS + 1)
        peak = np.maximum(correlation[np.ix_(rows % ROWS, columns % COLUMNS)], 0.0)
        if float(peak.sum()) <= self._certainty_min:
            return np.zeros(2)
        mass = float(peak.sum())
        x, y = float(peak.sum(axis=0) @ columns) / mass, float(peak.sum(axis=1) @ rows) / mass
        x, y = (x - COLUMNS if x > COLUMNS / 2 else x), (y - ROWS if y > ROWS / 2 else y)
        return np.array([x * width_px / COLUMNS, y * height_px / ROWS])
