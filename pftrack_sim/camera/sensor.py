"""Image formation after the lens: blur, exposure, noise, tone, luma and JPEG compression."""

from __future__ import annotations

import math

import cv2
import numpy as np

from pftrack_sim.camera.auto_exposure import AutoExposure
from pftrack_sim.camera.tone import Tone
from pftrack_sim.core.errors import RenderError
from pftrack_sim.core.random_streams import stream
from pftrack_sim.core.records import Image
from pftrack_sim.scenario import model
from pftrack_sim.scenario.axes import Axes, NoiseAxis

_NARROW_PX = 0.5
"""Up to this sigma OpenCV, which rounds the weights of bytes to 256ths, gives none to pixels two columns away."""


class Sensor:
    """Sensor and transmission of one episode's frames.

    Of the stress axes, `light`, `noise` and the compression of `stream` act here; multisampling is the renderer's. A
    grey sensor has the luma (ITU-R BT.601) in all three channels.
    """

    def __init__(self, settings: model.Sensor, axes: Axes, seed: int, *, grey: bool = False) -> None:
        self._grey = grey
        self._exposure = AutoExposure(axes.light) if axes.light.on else None
        self._tone = Tone(settings, stream(seed, "sensor", "tone")) if settings.level > 0.0 else None
        self._time_s = 0.0
        self.retune(axes, seed)
        narrow = settings.psf_sigma_px <= _NARROW_PX
        self._radius_px = 1 if narrow else math.ceil(4.0 * settings.psf_sigma_px)
        self._sigma_px = sampled_sigma(settings.psf_sigma_px, self._radius_px) if settings.psf_sigma_px > 0.0 else 0.0

    def retune(self, axes: Axes, seed: int) -> None:
        """Set noise and compression; the exposure goes on."""
        self._quality = axes.stream.quality if axes.stream.on else None
        self._noise = None
        if axes.noise.on or axes.light.noisy:
            from pftrack_sim.camera.noise import Noise  # numba: imported when it is used

            self._noise = Noise(axes.noise if axes.noise.on else NoiseAxis(severity=1.0, gain=1.0), seed)

    def settle(self, time_s: float) -> float:
        """Exposure of the frame at a time since the start of the episode, relative to the first [EV]."""
        return 0.0 if self._exposure is None else self._exposure.settle(time_s)

    @property
    def metering(self) -> bool:
        """Whether later frames depend on the pixels of the next one (exposure, auto white balance)."""
        if self._tone is not None and not self._tone.metered:
            return True
        return self._exposure is not None and self._exposure.metering

    def expose(self, image: Image, time_s: float) -> Image:
        """Apply the lens blur, the colour of the light and the white balance to a rendered image, and meter the result.

        With `metering`, every frame that the camera takes must pass through here in order of time, whether it is
        delivered or not. Images are `(H, W, 3)` uint8 RGB; the argument itself is returned where nothing changes.
        """
        self._time_s = time_s
        if self._sigma_px > 0.0:
            # On display-coded values, as the renderer's light.
            size = 2 * self._radius_px + 1
            blurred = cv2.GaussianBlur(image, (size, size), self._sigma_px, borderType=cv2.BORDER_REPLICATE)
            image = np.asarray(blurred, dtype=np.uint8)
        image = image if self._exposure is None else self._exposure.balance(image, time_s)
        if self._tone is not None and not self._tone.metered:
            self._tone.meter(image)
        return image

    def read(self, image: Image, index: int) -> Image:
        """Read out and transmit the frame exposed last: noise, tone, luma, JPEG.

        `index` is that of the frame among those taken in the episode; it selects the noise. The argument itself is
        returned where nothing changes.
        """
        if self._noise is not None:
            gains = (1.0, 1.0, 1.0) if self._exposure is None else self._exposure.gains
            image = self._noise.read(image, index, gains)
        if self._tone is not None:
            image = self._tone.develop(image, self._time_s)
        if self._grey:
            luma = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
            image = np.asarray(cv2.cvtColor(luma, cv2.COLOR_GRAY2RGB), dtype=np.uint8)
        return image if self._quality is None else compress(image, self._quality)


def compress(image: Image, quality: int) -> Image:
    """Compress and decompress `(H, W, 3)` uint8 RGB by JPEG, with chroma at half the resolution.

    Raises:
        RenderError: OpenCV was built without JPEG.
    """
    done, coded = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise RenderError("OpenCV cannot write JPEG: reinstall opencv-python-headless")
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR_RGB), dtype=np.uint8)


def sampled_sigma(sigma_px: float, radius_px: int) -> float:
    """Parameter at which a Gaussian sampled at whole pixels -radius to radius has the standard deviation `sigma_px`.

    Below about a pixel the sampled kernel is narrower than the curve: at sigma = 0.5 its standard deviation is 0.46.
    """
    squares = np.arange(-radius_px, radius_px + 1, dtype=np.float64) ** 2
    low, high = 0.05, 2.0 * sigma_px + 0.5
    for _ in range(60):
        middle = 0.5 * (low + high)
        weights = np.exp(-0.5 * squares / middle**2)
        low, high = (middle, high) if (weights @ squares) / weights.sum() < sigma_px**2 else (low, middle)
    return 0.5 * (low + high)
