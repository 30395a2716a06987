"""From the light in the image plane to the numbers of the frame."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np

from pftrack_sim.camera.auto_exposure import Exposure
from pftrack_sim.camera.compression import compressed
from pftrack_sim.core.records import Image
from pftrack_sim.scenario import model
from pftrack_sim.scenario.axes import Axes

if TYPE_CHECKING:
    from pftrack_sim.camera.noise import Noise


class Sensor:
    """Lens and sensor of the camera, through one episode: lens, colour and automatics, noise, JPEG.

    Args:
        cfg: Standard deviation of the lens' point-spread function. (Multisampling happens while drawing.)
        axes: Of the scenario: the camera's side of `light`, `noise`, and the compression of `stream`.
        seed: Root seed of the episode.
        grey: Whether it gives luma (ITU-R BT.601) in all three channels.
    """

    def __init__(self, cfg: model.Sensor, axes: Axes, seed: int, *, grey: bool = False) -> None:
        self._grey = grey
        self._exposure = Exposure(axes.light) if axes.light.on else None
        self._quality = axes.stream.quality if axes.stream.on else None
        self._noise = _noise(axes, seed)
        self._radius_px = max(1, math.ceil(4.0 * cfg.psf_sigma_px))
        self._sigma_px = sampled_sigma(cfg.psf_sigma_px, self._radius_px) if cfg.psf_sigma_px > 0.0 else 0.0

    def settle(self, time_s: float) -> float:
        """Let the automatics settle until a frame is taken.

        Args:
            time_s: When that is, since the start of the episode.

        Returns:
            Stops by which it is exposed longer than the first frame; to be drawn that much brighter.
        """
        return 0.0 if self._exposure is None else self._exposure.settle(time_s)

    @property
    def metering(self) -> bool:
        """Whether later frames depend on the pixels of earlier ones (auto-exposure, auto white balance)."""
        return self._exposure is not None and self._exposure.metering

    def expose(self, image: Image, time_s: float) -> Image:
        """Apply the lens blur, the colour of the light and the white balance, and meter the result.

        With `metering`, every frame that the camera takes must pass through here in order of time, whether it is
        delivered or not.

        Args:
            image: `(H, W, 3)` uint8 RGB, rendered.
            time_s: Time of the frame since the start of the episode.

        Returns:
            `(H, W, 3)` uint8; the argument itself where nothing changes.
        """
        image = self._blur(image)
        return image if self._exposure is None else self._exposure.balance(image, time_s)

    def read(self, image: Image, index: int) -> Image:
        """Read out and transmit the frame exposed last: noise, luma, JPEG.

        Args:
            image: `(H, W, 3)` uint8, from `expose`.
            index: Index of the frame among those taken in the episode; it selects the noise.

        Returns:
            `(H, W, 3)` uint8; the argument itself where nothing changes.
        """
        if self._noise is not None:
            gains = (1.0, 1.0, 1.0) if self._exposure is None else self._exposure.gains
            image = self._noise.read(image, index, gains)
        if self._grey:
            image = _grey(image)
        return image if self._quality is None else compressed(image, self._quality)

    def _blur(self, image: Image) -> Image:
        """The image through the lens. The blur acts on display-coded values, as the drawing's light does."""
        if self._sigma_px == 0.0:
            return image
        size = 2 * self._radius_px + 1
        blurred = cv2.GaussianBlur(image, (size, size), self._sigma_px, borderType=cv2.BORDER_REPLICATE)
        return np.asarray(blurred, dtype=np.uint8)


def _grey(image: Image) -> Image:
    luma = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    return np.asarray(cv2.cvtColor(luma, cv2.COLOR_GRAY2RGB), dtype=np.uint8)


def _noise(axes: Axes, seed: int) -> Noise | None:
    if not axes.noise.on:
        return None
    from pftrack_sim.camera.noise import Noise  # numba: imported when it is used

    return Noise(axes.noise, seed)


def sampled_sigma(sigma_px: float, radius_px: int) -> float:
    """The parameter at which a Gaussian sampled at whole pixels has a standard deviation of `sigma_px`.

    Below about a pixel the samples of exp(-x^2 / 2 sigma^2) are narrower than the curve: at sigma = 0.5 the sampled
    kernel's standard deviation is 0.46.

    Args:
        sigma_px: Wanted standard deviation of the kernel.
        radius_px: Samples run from -radius to radius.
    """
    squares = np.arange(-radius_px, radius_px + 1, dtype=np.float64) ** 2
    low, high = 0.05, 2.0 * sigma_px + 0.5
    for _ in range(60):
        middle = 0.5 * (low + high)
        weights = np.exp(-0.5 * squares / middle**2)
        low, high = (middle, high) if (weights @ squares) / weights.sum() < sigma_px**2 else (low, middle)
    return 0.5 * (low + high)
