"""Shift of the whole image between successive frames, for the particle filters on a box.

Phase correlation (Kuglin & Hines 1975), as `pftrack.camera_motion`, but of few samples: the inverse transform of the
normalised cross-power spectrum of two images has a peak at their displacement. Only the peak's neighbours tell the
place between cells, as far ones are mostly noise.
"""

from __future__ import annotations

import cv2
import numpy as np
import scipy.fft
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.pftrack.windows import hann

COLUMNS, ROWS = 80, 60
PEAK_RADIUS = 2

Floats = NDArray[np.float32]


class ImageShift:
    """Shift between the last two images.

    Args:
        certainty_min: Least sum of the correlation within `PEAK_RADIUS` of its peak: below it the shift counts as
            unknown. Of a pure shift it is about 1.
    """

    def __init__(self, certainty_min: float) -> None:
        self._certainty_min = certainty_min
        self._window = np.outer(hann(ROWS), hann(COLUMNS))
        self._spectrum: NDArray[np.complex64] | None = None

    def update(self, image: Image) -> FloatArray:
        """`(2,)` shift x, y [px] of the image's content since the previous call; 0 at first or where unknown."""
        windowed = np.empty((ROWS, COLUMNS), np.float32)
        _apply_window(_reduced(image), self._window, windowed)
        spectrum = np.asarray(scipy.fft.rfft2(windowed), dtype=np.complex64)
        before, self._spectrum = self._spectrum, spectrum
        if before is None:
            return np.zeros(2)
        cross = spectrum * before.conj()
        cross /= np.abs(cross) + np.float32(1e-3)
        correlation = np.asarray(scipy.fft.irfft2(cross, (ROWS, COLUMNS)), dtype=np.float32)
        certainty, x, y = find_peak(correlation)
        if certainty <= self._certainty_min:
            return np.zeros(2)
        return np.array([x * image.shape[1] / COLUMNS, y * image.shape[0] / ROWS])


def _reduced(image: Image) -> NDArray[np.uint8]:
    """`(ROWS, COLUMNS)` grey image from four samples each."""
    sampled = cv2.resize(image, (2 * COLUMNS, 2 * ROWS), interpolation=cv2.INTER_NEAREST)
    grey = cv2.cvtColor(sampled, cv2.COLOR_RGB2GRAY)
    return np.asarray(cv2.resize(grey, (COLUMNS, ROWS), interpolation=cv2.INTER_AREA), dtype=np.uint8)


@njit(nogil=True, cache=True)
def _apply_window(grey: NDArray[np.uint8], window: Floats, out: Floats) -> None:
    """Fill `out` with the grey image less its mean, times the window."""
    total = 0
    for value in grey.flat:
        total += value
    mean = np.float32(total / grey.size)
    for i in range(grey.shape[0]):
        for j in range(grey.shape[1]):
            out[i, j] = (np.float32(grey[i, j]) - mean) * window[i, j]


@njit(nogil=True, cache=True)
def find_peak(correlation: Floats) -> tuple[float, float, float]:
    """Sum of the positive values within `PEAK_RADIUS` of the greatest one, and the x, y [cells] of the peak.

    Both coordinates are between minus and plus half the size: the correlation is periodic. The peak is the centre of
    mass of its neighbours; all are 0 where nothing is positive. Sums have single precision, and the order of NumPy's.
    """
    rows, columns = correlation.shape
    row, column = divmod(correlation.argmax(), columns)
    size = 2 * PEAK_RADIUS + 1
    around = np.empty((size, size), np.float32)
    for i in range(size):
        for j in range(size):
            value = correlation[(row + i - PEAK_RADIUS) % rows, (column + j - PEAK_RADIUS) % columns]
            around[i, j] = max(value, np.float32(0))
    near = around[1:-1, 1:-1].copy()
    mass, x, y = _pairwise(near), 0.0, 0.0
    for i in range(3):
        x += np.float64((near[0, i] + near[1, i]) + near[2, i]) * (column + i - 1)
        y += np.float64((near[i, 0] + near[i, 1]) + near[i, 2]) * (row + i - 1)
    if mass == 0.0:
        return 0.0, 0.0, 0.0
    x, y = x / mass, y / mass
    return _pairwise(around), x - columns if x > columns / 2 else x, y - rows if y > rows / 2 else y


@njit(nogil=True, cache=True)
def _pairwise(values: Floats) -> float:
    """The sum of 8 n + 1 values in the order of NumPy's pairwise summation: eight at a time, then the last."""
    flat = values.reshape(-1)
    parts = flat[:8].copy()
    for k in range(8, flat.size - 1):
        parts[k % 8] += flat[k]
    total = ((parts[0] + parts[1]) + (parts[2] + parts[3])) + ((parts[4] + parts[5]) + (parts[6] + parts[7]))
    return np.float64(total + flat[-1])
