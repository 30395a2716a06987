"""Motion of the camera between successive images, as a shift of the whole image.

Phase correlation (Kuglin & Hines 1975): the inverse transform of the normalised cross-power spectrum of two images has
a peak at their displacement. Images are sampled at a fixed number of points, so that the cost does not depend on their
size.
"""

from __future__ import annotations

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray

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

    def __init__(self, certainty_min: float = CERTAINTY_MIN) -> None:
        self._certainty_min = certainty_min
        self._window = np.outer(hann(ROWS), hann(COLUMNS))
        self._spectrum: NDArray[np.complex64] | None = None

    def shift(self, image: Image) -> FloatArray:
        """`(2,)` shift x, y [px] of the image's content since the previous call; 0 at first or where unknown."""
        height, width = image.shape[:2]
        # The mean of four pixels in each cell: all of them would move the peak by a tenth of a cell.
        points = cv2.resize(image, (2 * COLUMNS, 2 * ROWS), interpolation=cv2.INTER_NEAREST)
        reduced = cv2.resize(cv2.cvtColor(points, cv2.COLOR_RGB2GRAY), (COLUMNS, ROWS), interpolation=cv2.INTER_AREA)
        grey = np.asarray(reduced, dtype=np.float32)
        spectrum = np.asarray(scipy.fft.rfft2((grey - grey.mean()) * self._window), dtype=np.complex64)
        before, self._spectrum = self._spectrum, spectrum
        if before is None:
            return np.zeros(2)
        cross = spectrum * before.conj()
        cross /= np.abs(cross) + np.float32(1e-3)
        correlation = np.asarray(scipy.fft.irfft2(cross, (ROWS, COLUMNS)), dtype=np.float64)
        row, column = divmod(int(correlation.argmax()), COLUMNS)
        offsets = np.arange(-PEAK_RADIUS, PEAK_RADIUS + 1)
        # The correlation is periodic.
        peak = np.maximum(correlation[np.ix_((row + offsets) % ROWS, (column + offsets) % COLUMNS)], 0.0)
        mass = float(peak.sum())
        if mass <= self._certainty_min:
            return np.zeros(2)
        place = np.array([column + peak.sum(axis=0) @ offsets / mass, row + peak.sum(axis=1) @ offsets / mass])
        cells = np.array([COLUMNS, ROWS])
        return np.where(place > 0.5 * cells, place - cells, place) * (width, height) / cells


def hann(count: int) -> NDArray[np.float32]:
    """`(count,)` Hann window at the centres of `count` samples; positive everywhere."""
    return (0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(count) + 0.5) / count)).astype(np.float32)
