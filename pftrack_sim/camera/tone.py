"""Exposure and colours of a camera: the level aimed at, a curve as film's, vignette, bloom, a drifting white balance.

The exposure is metered in the first frame and held, so that changes of the light stay visible. Of display-coded values
x in [0, 1] the curve makes y / (1 - y) = gain * x / (1 - x): it has a shoulder, and only white becomes white.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.compiled import kernel
from pftrack_sim.core.photometry import LUMINANCE, gain
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario import model

_RINGS = 32  # Steps of the vignette from the middle of the image to its corners
_CELLS = 60  # Height of the image that bloom is computed on
_BLOOM = (5, 5)  # Width and height of the box that light is spread over twice [cells]
_HIGHLIGHT = 190.0  # Level above which light blooms
_CODES = np.linspace(1e-6, 1.0 - 1e-6, 256)  # Black and white themselves have no odds
_ODDS_OF_DARK = (1.0 - _CODES) / _CODES
_DRIFT_HZ = np.array([0.05, 0.11, 0.23])  # Rates at which the white balance drifts


class Tone:
    """Tone of one episode's frames."""

    def __init__(self, settings: model.Sensor, rng: np.random.Generator) -> None:
        self._settings = settings
        self._phases = rng.uniform(0.0, 2.0 * np.pi, (2, len(_DRIFT_HZ)))  # Of red and blue
        self._first = np.sin(self._phases)
        self._drift_ev = settings.white_balance_ev * np.sqrt(2.0 / len(_DRIFT_HZ))
        self._falloff = 255.0 * (1.0 - settings.vignette * np.linspace(0.0, 1.0, _RINGS))
        self._ev: float | None = None
        self._rings = np.zeros((0, 0), dtype=np.uint8)
        self._bloom = np.rint(settings.bloom * np.maximum(np.arange(256) - _HIGHLIGHT, 0.0)).astype(np.uint8)

    @property
    def metered(self) -> bool:
        """Whether the exposure has been chosen."""
        return self._ev is not None

    def meter(self, image: Image) -> None:
        """Choose the exposure by the first frame, `(H, W, 3)` uint8."""
        settings = self._settings
        luminance = (image[1::4, 1::4] @ LUMINANCE).astype(np.intp)
        shares = np.bincount(luminance.ravel(), minlength=256) / luminance.size
        low, high = 0.0, settings.exposure_limit_ev
        for _ in range(20):
            middle = 0.5 * (low + high)
            level = 255.0 * (shares @ _curves(np.array([middle]))[0])
            low, high = (middle, high) if level < settings.level else (low, middle)
        self._ev = low
        y, x = (np.linspace(-1.0, 1.0, side) ** 2 for side in image.shape[:2])
        width, height = image.shape[1] ** 2, image.shape[0] ** 2
        radius = (height * y[:, None] + width * x) / (height + width)
        self._rings = np.rint((_RINGS - 1) * radius).astype(np.uint8)

    def develop(self, image: Image, time_s: float) -> Image:
        """A new `(H, W, 3)` image with the curve, the vignette and the bloom of the metered exposure.

        The white balance is that of a time since the first frame.
        """
        assert self._ev is not None
        levels = _curves(self._ev + self._drift(time_s))
        curves = (self._falloff[:, None] * levels[:, None] + 0.5).astype(np.uint8)
        toned = _toned(np.ascontiguousarray(image), self._rings, curves)
        return self._bloomed(toned) if self._settings.bloom > 0.0 else toned

    def _drift(self, time_s: float) -> FloatArray:
        """`(3,)` stops by which red, green and blue are brighter than in the first frame: sums of sines."""
        turns = np.sin(2.0 * np.pi * _DRIFT_HZ * time_s + self._phases) - self._first
        red, blue = (self._drift_ev * turns.sum(axis=1)).tolist()
        return np.array([red, 0.0, blue])

    def _bloomed(self, image: Image) -> Image:
        """Scatter the light of what is bright around it."""
        height, width = image.shape[:2]
        cells = (max(1, round(_CELLS * width / height)), _CELLS)
        rows = image[:: max(1, height // (4 * _CELLS))]  # Four to a cell are enough
        small = cv2.resize(rows, cells, interpolation=cv2.INTER_AREA)
        bright = cv2.LUT(small, self._bloom)
        if not bright.any():
            return image
        scattered = cv2.resize(cv2.blur(cv2.blur(bright, _BLOOM), _BLOOM), (width, height))
        return np.asarray(cv2.add(image, scattered, dst=image), dtype=np.uint8)


def _curves(evs: FloatArray) -> FloatArray:
    """`(N, 256)` what the codes become, in [0, 1], where dark ones are brightened by `(N,)` stops."""
    return 1.0 / (1.0 + _ODDS_OF_DARK / np.array([gain(ev) for ev in evs.tolist()])[:, None])


@kernel
def _toned(image: Image, rings: NDArray[np.uint8], curves: NDArray[np.uint8]) -> Image:
    out = np.empty_like(image)
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            ring = rings[row, column]
            out[row, column, 0] = curves[0, ring, image[row, column, 0]]
            out[row, column, 1] = curves[1, ring, image[row, column, 1]]
            out[row, column, 2] = curves[2, ring, image[row, column, 2]]
    return out
