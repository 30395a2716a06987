"""Correlation filter on gradients and grey values: where in a square window is the target?

A ridge regression onto a Gaussian around the target's centre, over all cyclic shifts of the window, solved for each
frequency; numerator and denominator are running means over frames (Bolme et al. 2010; Danelljan et al. 2014, eq. 3 to
6; with HOG: Henriques et al. 2015).
"""

from __future__ import annotations

from typing import TypeAlias

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from pftrack_sim.core.records import Image
from pftrack_sim.trackers.features.camera_motion import hann
from pftrack_sim.trackers.pftrack.hog_map import CHANNELS, hog_map

Spectrum: TypeAlias = NDArray[np.complex64]

FADE = 1.5
"""Distance at which the filter ends, as a multiple of the target's half width and half height."""


class CorrelationFilter:
    """A filter for patches of `hog_map.CELL_PX * cells` pixels in each direction.

    Args:
        cells: Cells of a patch in each direction, even.
        size: Width and height of the target [cells].
        sigma: Standard deviation of the label [cells].
        ridge: Regularisation, as a share of the mean spectral energy of the first patch.
        search_window: Power of the Hann window over patches that are searched; patches that are learnt have the window
            itself. Below 1 the response to a target far from the centre is weakened less: the filter ends near the
            target's box, so the window is needed only against the patch's border.
    """

    def __init__(
        self, cells: int, size: tuple[float, float], sigma: float, ridge: float, search_window: float = 1.0
    ) -> None:
        self._cells = cells
        self._ridge_share = ridge
        self._window = np.outer(hann(cells), hann(cells))
        self._search_window = self._window ** np.float32(search_window)
        self._support = np.outer(_support(cells, size[1]), _support(cells, size[0]))
        # The label's peak is at the corner for a centred target; responses are rolled so that it is in the middle.
        steps = np.minimum(np.arange(cells), cells - np.arange(cells))
        squares = np.square(steps)[:, None] + np.square(steps)[None, :]
        label = np.exp(-0.5 * squares / max(sigma, 1e-3) ** 2).astype(np.float32)
        self._label: Spectrum = scipy.fft.rfft2(label)
        self._numerator: Spectrum | None = None
        self._denominator = np.zeros(0, np.float32)
        self._ridge = np.float32(0)
        self._filter: Spectrum = self._label

    def spectrum(self, patch: Image, *, searched: bool = False) -> Spectrum:
        """`(CHANNELS + 1, cells, cells // 2 + 1)` spectrum of the features of an RGB patch, to learn or to search."""
        window = self._search_window if searched else self._window
        grey = np.asarray(cv2.cvtColor(patch, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        features = np.empty((CHANNELS + 1, self._cells, self._cells), np.float32)
        hog_map(grey, window, features[:CHANNELS])
        means = cv2.resize(grey, (self._cells, self._cells), interpolation=cv2.INTER_AREA)
        brightness = np.asarray(means, dtype=np.float32) * np.float32(1 / 255)
        features[CHANNELS] = (brightness - brightness.mean()) * window
        return scipy.fft.rfft2(features, axes=(1, 2))

    def learn(self, spectrum: Spectrum, rate: float) -> None:
        """Add a patch that is centred on the target, with weight `rate` in [0, 1] (the first one with 1)."""
        numerator = self._label * spectrum.conj()
        denominator = (np.square(spectrum.real) + np.square(spectrum.imag)).sum(axis=0)
        if self._numerator is None:
            self._numerator, self._denominator = numerator, denominator
            self._ridge = np.float32(max(self._ridge_share * float(denominator.mean()), 1e-6))
        else:
            weight = np.float32(rate)
            self._numerator += weight * (numerator - self._numerator)
            self._denominator += weight * (denominator - self._denominator)
        quotient = np.asarray(self._numerator / (self._denominator + self._ridge), dtype=np.complex64)
        whole: NDArray[np.float32] = scipy.fft.irfft2(quotient, (self._cells, self._cells))
        inner = np.asarray(whole * self._support, dtype=np.float32)
        self._filter = scipy.fft.rfft2(inner)

    def respond(self, spectrum: Spectrum) -> NDArray[np.float32]:
        """`(cells, cells)` response, greatest at the target's centre; row and column `cells // 2` are the window's."""
        mixed = np.asarray((spectrum * self._filter).sum(axis=0), dtype=np.complex64)
        response: NDArray[np.float32] = scipy.fft.irfft2(mixed, (self._cells, self._cells))
        return np.fft.fftshift(response)


def _support(cells: int, length: float) -> NDArray[np.float32]:
    """`(cells,)` weights along an axis: 1 in the target, falling to 0 at `FADE` of its half length from the centre.

    A filter that is convolved has its origin in the middle of the window and is mirrored; so is an even window.
    """
    half = 0.5 * length
    distances = np.abs(np.arange(cells) - cells // 2)
    beyond = np.clip((distances - half) / max(half * (FADE - 1.0), 1.0), 0.0, 1.0)
    return (0.5 + 0.5 * np.cos(np.pi * beyond)).astype(np.float32)


def vertex(before: float, peak: float, after: float) -> float:
    """Offset in [-0.5, 0.5] of the vertex of the parabola through three samples, from the one in the middle."""
    curvature = before - 2.0 * peak + after
    if curvature >= -1e-12:
        return 0.0
    return min(max(0.5 * (before - after) / curvature, -0.5), 0.5)
