"""Auto-exposure, auto white balance, and the colour of the light.

Both controllers hold what they measured in the first frame: its mean luminance, and the ratios of red and blue to green
in its mean. Each is a first-order loop in stops: 63 % of a constant error is corrected within the lag.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from pftrack_sim.core.photometry import DISPLAY_GAMMA, LUMINANCE, tint
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.axes import WHITE_K, LightAxis

_DARK = 1e-5  # Mean linear value of a channel below which nothing can be metered

_CODES = np.arange(256)
_LINEAR = (_CODES / 255.0) ** DISPLAY_GAMMA


class AutoExposure:
    """Exposure, white balance and light colour through one episode.

    The exposure of a frame is known before it is rendered, and the lights are scaled by it, so that highlights are
    clipped after the exposure. Colours are applied to the rendered frame, which is then metered for the next one.
    """

    def __init__(self, axis: LightAxis) -> None:
        self._axis = axis
        self._reference: FloatArray | None = None
        self._metered_s = 0.0
        self._ev, self._error_ev = 0.0, 0.0
        self._balance_ev, self._balance_error_ev = np.zeros(3), np.zeros(3)

    def settle(self, time_s: float) -> float:
        """Exposure of the next frame, at a time since the start of the episode, relative to the first [EV].

        The errors metered last are corrected by the share that belongs to the time since then.
        """
        since_s, axis = time_s - self._metered_s, self._axis
        limit = axis.exposure_range_ev
        self._ev = min(limit, max(-limit, self._ev + _correction(since_s, axis.exposure_lag_s) * self._error_ev))
        self._balance_ev = self._balance_ev + _correction(since_s, axis.white_balance_lag_s) * self._balance_error_ev
        self._metered_s = time_s
        return self._ev

    @property
    def metering(self) -> bool:
        """Whether the mean colour of each frame controls the next."""
        return self._axis.auto_exposure or self._axis.auto_white_balance

    @property
    def gains(self) -> tuple[float, float, float]:
        """Gains on linear red, green and blue of the current frame."""
        red, green, blue = np.exp2(self._ev + self._balance_ev)
        return float(red), float(green), float(blue)

    def balance(self, image: Image, time_s: float) -> Image:
        """Apply the colour of the light and the white balance to an image in white light, and meter the result.

        Images are `(H, W, 3)` uint8; the argument itself is returned where no colour changes.
        """
        kelvin = self._axis.light_k(time_s)
        factors = np.exp2(self._balance_ev)
        if kelvin != WHITE_K:
            factors = factors * tint(kelvin, WHITE_K)
        balanced = image if (factors == 1.0).all() else _scaled(image, factors)
        if self.metering:
            self._meter(balanced)
        return balanced

    def _meter(self, image: Image) -> None:
        """Measure the errors of a frame relative to the first one; a dark frame has none."""
        mean = np.array([_LINEAR[image[2::4, 2::4, channel]].mean() for channel in range(3)])
        if self._reference is None:
            self._reference = mean
            return
        self._error_ev, self._balance_error_ev = 0.0, np.zeros(3)
        if min(mean.min(), self._reference.min()) < _DARK:
            return
        if self._axis.auto_exposure:
            self._error_ev = math.log2((LUMINANCE @ self._reference) / (LUMINANCE @ mean))
        if self._axis.auto_white_balance:
            # Ratios to green: the white balance leaves the brightness to the exposure.
            self._balance_error_ev = np.log2(self._reference / self._reference[1]) - np.log2(mean / mean[1])


def _correction(since_s: float, lag_s: float) -> float:
    """Share of an error that a first-order loop corrects in a time."""
    return 1.0 if lag_s == 0.0 else -math.expm1(-since_s / lag_s)


def _scaled(image: Image, factors: FloatArray) -> Image:
    """Multiply linear red, green and blue of an image."""
    levels = np.clip(np.round(_CODES[:, None] * factors ** (1.0 / DISPLAY_GAMMA)), 0.0, 255.0).astype(np.uint8)
    return np.asarray(cv2.LUT(image, levels[None]), dtype=np.uint8)
