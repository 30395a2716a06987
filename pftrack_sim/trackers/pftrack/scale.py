"""Scale filter: a correlation filter over the logarithm of the size (Danelljan et al. 2014, section 3.2).

Patches of the target at a geometric series of sizes are the samples of a one-dimensional signal, whose shift against
the learned one is the change of scale.
"""

from __future__ import annotations

import math

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.camera_motion import hann
from pftrack_sim.trackers.pftrack.correlation import vertex
from pftrack_sim.trackers.pftrack.hog_map import CELL_PX, CHANNELS, hog_map
from pftrack_sim.trackers.recognition.pyramid import ImagePyramid

FULL_ASPECT = 0.8
"""Ratio of the shorter to the longer side from which on a box is taken whole."""
PASSES = 3


def core(size: FloatArray, least: float) -> FloatArray:
    """The `(2,)` part of a box whose content changes its size with the target.

    People and other elongated targets do not fill their boxes. What is behind them at both sides keeps its size while
    they approach or walk off, and holds the estimate back. The more elongated the box, the smaller is the share of its
    shorter side that remains, down to `least`; the longer side remains whole.
    """
    return size * np.clip(size / size[::-1] / FULL_ASPECT, least, 1.0)


class ScaleFilter:
    """Finds by which factor the target's size changed.

    Args:
        size: `(2,)` width and height of the target at scale 1 [px].
        count: Number of sizes compared, odd.
        step: Ratio of successive sizes, above 1.
        cells: Approximate number of cells of a patch.
    """

    def __init__(self, size: FloatArray, count: int, step: float, cells: int) -> None:
        self._size, self._step = size, step
        zoom = math.sqrt(cells / float(size[0] * size[1]))
        # Long thin targets keep two cells across, and no side is longer than the number of cells asked for.
        self._columns, self._rows = (min(max(round(float(side) * zoom), 2), cells) for side in size)
        places = np.arange(count) - count // 2
        self._factors = step**places
        self._flat = np.ones((self._rows, self._columns), np.float32)
        self._window = hann(count)
        label = np.exp(-0.5 * np.square(places / (0.25 * math.sqrt(count)))).astype(np.float32)
        self._label: NDArray[np.complex64] = scipy.fft.fft(label)
        self._numerator: NDArray[np.complex64] | None = None
        self._denominator = np.zeros(count, np.float32)

    def learn(self, pyramid: ImagePyramid, centre: FloatArray, scale: float, rate: float) -> None:
        """Learn the target's size, `scale` times that at scale 1, with weight `rate` in [0, 1]."""
        spectrum = self._spectrum(pyramid, centre, scale)
        numerator = self._label[:, None] * spectrum.conj()
        denominator = (np.square(spectrum.real) + np.square(spectrum.imag)).sum(axis=1)
        if self._numerator is None:
            self._numerator, self._denominator = numerator, denominator
        else:
            weight = np.float32(rate)
            self._numerator += weight * (numerator - self._numerator)
            self._denominator += weight * (denominator - self._denominator)

    def factor(self, pyramid: ImagePyramid, centre: FloatArray, scale: float) -> float:
        """Factor by which the size changed against `scale`; `learn` must have been called.

        The window over the sizes pulls the response towards no change, so a change of more than half a step is measured
        again from the size found.
        """
        total = 1.0
        for _ in range(PASSES):
            change = self._change(pyramid, centre, scale * total)
            total *= change
            if abs(math.log(change)) < 0.5 * math.log(self._step):
                break
        return total

    def _change(self, pyramid: ImagePyramid, centre: FloatArray, scale: float) -> float:
        """The factor of one comparison."""
        assert self._numerator is not None
        spectrum = self._spectrum(pyramid, centre, scale)
        ridge = np.float32(0.01) * self._denominator.mean() + np.float32(1e-6)
        mixed = (spectrum * self._numerator).sum(axis=1) / (self._denominator + ridge)
        response = np.asarray(scipy.fft.ifft(mixed), dtype=np.complex64).real
        best, last = int(response.argmax()), len(response) - 1
        fine = vertex(*(float(v) for v in response[best - 1 : best + 2])) if 0 < best < last else 0.0
        return float(self._step ** (best + fine - len(response) // 2))

    def _spectrum(self, pyramid: ImagePyramid, centre: FloatArray, scale: float) -> NDArray[np.complex64]:
        """`(count, features)` spectrum over the sizes."""
        sizes = scale * self._factors[:, None] * self._size
        patches = pyramid.grey_patches(centre, sizes, (CELL_PX * self._rows, CELL_PX * self._columns))
        samples = np.empty((len(patches), CHANNELS, self._rows, self._columns), np.float32)
        for sample, patch, weight in zip(samples, patches, self._window, strict=True):
            hog_map(patch, self._flat * weight, sample)
        return scipy.fft.fft(samples.reshape(len(samples), -1), axis=0)
