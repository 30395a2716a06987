"""Baselines that use the image: template matching and mean shift."""

from __future__ import annotations

import math
from typing import Annotated, Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.parameters import Parameters, RecognitionParameters

HUE_COUNT = 180  # OpenCV's 8-bit hue has steps of two degrees
Byte: TypeAlias = Annotated[int, Field(ge=0, le=255)]


class NccParameters(RecognitionParameters):
    """Parameters of `ncc`: search distance in each direction, as a multiple of the square root of the box's area."""

    search: Annotated[float, Field(ge=0.0, le=100.0)] = 0.5


class Ncc(BaseTracker):
    """Normalised cross-correlation with the grey patch of the first frame.

    `cv2.matchTemplate` (zero mean) in a window around the last box; the size of the box is kept. The simplest tracker
    that uses the image (the VOT challenges have a similar baseline). Confidence is the correlation, 0 where it is
    negative or undefined (uniform patches).
    """

    def __init__(self, params: NccParameters) -> None:
        super().__init__(params.recognition)
        self.params = params

    def _start(self, image: Image, box: Box) -> None:
        x, y, w, h = _window(box, image.shape[1], image.shape[0])
        self._patch = _grey(image)[y : y + h, x : x + w]
        self._corner, self._offset, self._size = (x, y), box[:2] - (x, y), box[2:]

    def _follow(self, image: Image) -> Estimate:
        height, width = image.shape[:2]
        rows, columns = self._patch.shape
        reach = math.ceil(self.params.search * math.sqrt(float(self._size[0] * self._size[1])))
        x, y = self._corner
        left, top = max(x - reach, 0), max(y - reach, 0)
        right, bottom = min(x + columns + reach, width), min(y + rows + reach, height)
        window = _grey(np.ascontiguousarray(image[top:bottom, left:right]))
        match = np.asarray(cv2.matchTemplate(window, self._patch, cv2.TM_CCOEFF_NORMED), dtype=np.float64)
        # The correlation with a uniform patch is undefined; OpenCV may return 1 or infinity there.
        match[~np.isfinite(match) | (_sum_of_squares(window, rows, columns) == 0.0)] = -1.0
        peak = int(match.argmax())
        best = float(match.flat[peak])
        if self._patch.min() < self._patch.max() and best > -1.0:
            row, column = divmod(peak, match.shape[1])
            self._corner = (left + column, top + row)
        else:
            best = 0.0
        box = np.concatenate([np.array(self._corner) + self._offset, self._size])
        return Estimate(box, min(max(best, 0.0), 1.0))


def _grey(image: Image) -> NDArray[np.uint8]:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)


def _sum_of_squares(grey: NDArray[np.uint8], rows: int, columns: int) -> FloatArray:
    """Sum of squared deviations from the mean of every rows x columns patch; exactly 0 for uniform patches."""
    sums, squares = cv2.integral2(grey, sdepth=cv2.CV_64F, sqdepth=cv2.CV_64F)

    def patch_sums(integral: Any) -> FloatArray:
        full = np.asarray(integral, dtype=np.float64)
        return full[rows:, columns:] - full[:-rows, columns:] - full[rows:, :-columns] + full[:-rows, :-columns]

    return patch_sums(squares) * float(rows * columns) - np.square(patch_sums(sums))


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
    """Mean shift, or CamShift where it adapts its size, on the back-projected hue, by OpenCV (Bradski 1998).

    The hue histogram of the first box is back-projected onto each frame, and the box climbs to the mode of the
    back-projection. Confidence is the mean of the back-projection in the box; it is 1 if every pixel has the target's
    most frequent hue. The last box is repeated where the first box has no colour (a grey video), and, with confidence
    0, where the back-projection is 0 in the last box.
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


def _window(box: Box, width: int, height: int) -> tuple[int, int, int, int]:
    """The whole pixels of a box that lie in the image, at least one."""
    inside = boxes.clip(box, width, height)
    x, y = min(int(inside[0]), width - 1), min(int(inside[1]), height - 1)
    right, bottom = (int(np.ceil(inside[k] + inside[k + 2])) for k in (0, 1))
    return x, y, max(right - x, 1), max(bottom - y, 1)


def _total(values: NDArray[np.uint8], window: tuple[int, int, int, int]) -> float:
    x, y, w, h = window
    return float(values[y : y + h, x : x + w].sum(dtype=np.int64))


def make(name: str, *, seed: int, preset: str, **params: Any) -> Ncc | MeanShift:
    """Make `ncc`, `opencv-meanshift` or `opencv-camshift`, which use no random numbers."""
    if name == "ncc":
        return Ncc(NccParameters.from_preset(name, preset, params))
    settings = MeanShiftParameters.from_preset(name, preset, params)
    return MeanShift(settings, adapts_size=name == "opencv-camshift")
