"""The colour of the light, and the camera's automatics: exposure and white balance, each with a lag.

Both hold what they saw in the first frame: its mean luminance, and the shares of red, green and blue in its mean. Each
is a first-order loop in stops: of an error that stays, 63% is made up for within the lag.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.photometry import DISPLAY_GAMMA, LUMINANCE, tint
from pftrack_sim.core.records import Image
from pftrack_sim.scenario.axes import LightAxis
from pftrack_sim.scenario.axes.scene import WHITE_K

Numbers = NDArray[np.float64]

_DARK = 1e-5
"""Mean linear light below which there is nothing to go by."""

_CODES = np.arange(256)
_LINEAR = (_CODES / 255.0) ** DISPLAY_GAMMA


class Exposure:
    """Colour, exposure and white balance through one episode.

    The exposure of a frame is known before it is drawn, and the drawing applies it: nothing is clipped that the
    exposure would have kept. Colours are applied to the drawn frame (`balance`), which is then metered for the next.

    Args:
        axis: What the light does, and which automatics are on.
    """

    def __init__(self, axis: LightAxis) -> None:
        self._axis = axis
        self._held: Numbers | None = None
        self._metered_s = 0.0
        self._ev, self._error_ev = 0.0, 0.0
        self._balance_ev, self._balance_error_ev = np.zeros(3), np.zeros(3)

    def settle(self, time_s: float) -> float:
        """Make up for a part of the errors metered last: the larger, the longer ago that was.

        Args:
            time_s: When the next frame is taken, since the start of the episode.

        Returns:
            Stops by which it is exposed longer than the first.
        """
        since_s, axis = time_s - self._metered_s, self._axis
        limit = axis.exposure_range_ev
        self._ev = min(limit, max(-limit, self._ev + _share(since_s, axis.exposure_lag_s) * self._error_ev))
        self._balance_ev = self._balance_ev + _share(since_s, axis.white_balance_lag_s) * self._balance_error_ev
        self._metered_s = time_s
        return self._ev

    @property
    def metering(self) -> bool:
        """Whether the mean colour of each frame controls the next."""
        return self._axis.auto_exposure or self._axis.auto_white_balance

    @property
    def gains(self) -> tuple[float, float, float]:
        """How much the camera amplifies linear red, green and blue of the frame that it settled for."""
        red, green, blue = np.exp2(self._ev + self._balance_ev)
        return float(red), float(green), float(blue)

    def balance(self, image: Image, time_s: float) -> Image:
        """The frame in the colour of the light, balanced; and metered.

        Args:
            image: `(H, W, 3)` uint8, drawn as bright as `settle` said, in white light.
            time_s: Since the start of the episode.

        Returns:
            `(H, W, 3)` uint8; the argument itself when the colours stay.
        """
        kelvin = self._axis.light_k(time_s)
        factors = np.exp2(self._balance_ev)
        if kelvin != WHITE_K:
            factors = factors * tint(kelvin, WHITE_K)
        coloured = image if (factors == 1.0).all() else _scaled(image, factors)
        if self.metering:
            self._meter(coloured)
        return coloured

    def _meter(self, image: Image) -> None:
        """How far a frame is off what is held."""
        mean = np.array([_LINEAR[image[2::4, 2::4, channel]].mean() for channel in range(3)])
        if self._held is None:
            self._held = mean
            return
        self._error_ev, self._balance_error_ev = 0.0, np.zeros(3)
        if min(mean.min(), self._held.min()) < _DARK:
            return
        if self._axis.auto_exposure:
            self._error_ev = math.log2((LUMINANCE @ self._held) / (LUMINANCE @ mean))
        if self._axis.auto_white_balance:
            # Ratios to green: balancing moves colours and leaves the brightness to the exposure.
            self._balance_error_ev = np.log2(self._held / self._held[1]) - np.log2(mean / mean[1])


def _share(since_s: float, lag_s: float) -> float:
    """Share of an error that is made up for in a time."""
    return 1.0 if lag_s == 0.0 else -math.expm1(-since_s / lag_s)


def _scaled(image: Image, factors: Numbers) -> Image:
    """The image with linear red, green and blue multiplied."""
    levels = np.clip(np.round(_CODES[:, None] * factors ** (1.0 / DISPLAY_GAMMA)), 0.0, 255.0).astype(np.uint8)
    return np.asarray(cv2.LUT(image, levels[None]), dtype=np.uint8)
