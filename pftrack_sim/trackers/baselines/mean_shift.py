"""Mean shift and CamShift on the back-projected hue (Bradski 1998), by OpenCV's functions.

The hue histogram of the first box is back-projected onto each frame, and the box climbs to the mode of the
back-projection. `opencv-meanshift` keeps the size of the box, `opencv-camshift` adapts it.
"""

from __future__ import annotations

from typing import Annotated, Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.parameters import Parameters

HUE_COUNT = 180  # OpenCV's 8-bit hue has steps of two degrees
Byte: TypeAlias = Annotated[int, Field(ge=0, le=255)]


class MeanShiftParameters(Parameters):
    """Parameters of both trackers.

    Attributes:
        hue_bins: Bins of the hue histogram.
        min_saturation: Pixels of less saturation (0..255) are left out: their hue is noise.
        min_value: Darker pixels (0..255) are left out for the same reason.
        iteration_count: Greatest number of mean shift steps per frame.
    """

    hue_bins: Annotated[int, Field(ge=1, le=HUE_COUNT)] = 30
    min_saturation: Byte = 40
    min_value: Byte = 32
    iteration_count: Annotated[int, Field(ge=1, le=1000)] = 10


class MeanShift(BaseTracker):
    """Mean shift, or CamShift where it adapts its size.

    Confidence is the mean of the back-projection in the box; it is 1 if every pixel has the target's most frequent hue.
    The last box is repeated where the first box has no colour (a grey video), and, with confidence 0, where the
    back-projection is 0 in the last box.
    """

    def __init__(self, params: MeanShiftParameters, *, adapts_size: bool) -> None:
        super().__init__()
        self.params = params
        self._adapts_size = adapts_size

    def _start(self, image: Image, box: Box) -> None:
        height, width = image.shape[:2]
        self._box = box
        x, y, w, h = _window(box, width, height)
        hue, valid = self._hue(image[y : y + h, x : x + w])
        counts = np.bincount(hue[valid] * self.params.hue_bins // HUE_COUNT, minlength=self.params.hue_bins)
        shares = counts / counts.max() if counts.any() else counts.astype(np.float64)
        self._histogram = shares[np.arange(HUE_COUNT) * self.params.hue_bins // HUE_COUNT]

    def _follow(self, image: Image) -> Estimate:
        height, width = image.shape[:2]
        hue, valid = self._hue(image)
        back_projection = np.where(valid, 255.0 * self._histogram[hue], 0.0).round().astype(np.uint8)
        start = _window(self._box, width, height)
        stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, self.params.iteration_count, 1.0)
        if _total(back_projection, start) == 0:
            return Estimate(self._box, 0.0)
        end: Any
        if self._adapts_size:
            _, end = cv2.CamShift(back_projection, start, stop)
        else:
            _, end = cv2.meanShift(back_projection, start, stop)
        x, y, w, h = (int(value) for value in end)
        if w >= 1 and h >= 1:
            if self._adapts_size:
                self._box = np.array([x, y, w, h], dtype=np.float64)
            else:  # moved by the window's shift, so that fractions of a pixel are kept
                self._box = self._box + np.array([x - start[0], y - start[1], 0.0, 0.0])
        window = _window(self._box, width, height)
        return Estimate(self._box, min(_total(back_projection, window) / (255.0 * window[2] * window[3]), 1.0))

    def _hue(self, image: Image) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """`(H, W)` hue and `(H, W)` mask of pixels with a reliable hue."""
        hsv = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2HSV))
        valid = (hsv[..., 1] >= self.params.min_saturation) & (hsv[..., 2] >= self.params.min_value)
        return hsv[..., 0].astype(np.intp), valid


def make(name: str, *, seed: int, preset: str, **params: Any) -> MeanShift:
    """Make `opencv-meanshift` or `opencv-camshift`, which use no random numbers."""
    settings = MeanShiftParameters.from_preset(name, preset, params)
    return MeanShift(settings, adapts_size=name == "opencv-camshift")


def _window(box: Box, width: int, height: int) -> tuple[int, int, int, int]:
    """The whole pixels of a box that lie in the image, at least one."""
    inside = boxes.clip(box, width, height)
    x, y = min(int(inside[0]), width - 1), min(int(inside[1]), height - 1)
    right, bottom = (int(np.ceil(inside[k] + inside[k + 2])) for k in (0, 1))
    return x, y, max(right - x, 1), max(bottom - y, 1)


def _total(values: NDArray[np.uint8], window: tuple[int, int, int, int]) -> float:
    x, y, w, h = window
    return float(values[y : y + h, x : x + w].sum(dtype=np.int64))
