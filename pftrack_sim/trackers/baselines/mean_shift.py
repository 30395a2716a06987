"""Mean shift and CamShift on a back-projected hue: OpenCV's functions, the classic way to use them.

The hue histogram of the first box says how much of the target each hue is; every pixel of a later frame is given that
number, and the box climbs to where most of it lies (Bradski 1998). `opencv-meanshift` keeps the size of the box,
`opencv-camshift` follows it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.params import Between, settle

HUE_COUNT = 180  # OpenCV's 8-bit hue is in steps of two degrees


@dataclass(frozen=True)
class Params:
    """The numbers of both.

    Attributes:
        hue_bins: Bins of the hue's histogram.
        min_saturation: Pixels less saturated (0..255) are left out: their hue is noise.
        min_value: Pixels darker (0..255) are left out for the same reason.
        iteration_count: Steps of mean shift per frame, at most.
    """

    hue_bins: Annotated[int, Between(1, HUE_COUNT)] = 30
    min_saturation: Annotated[int, Between(0, 255)] = 40
    min_value: Annotated[int, Between(0, 255)] = 32
    iteration_count: Annotated[int, Between(1, 1000)] = 10


PRESETS = {"paper": Params(), "default": Params()}


class Shift(BaseTracker):
    """Either of the two.

    Confidence is the mean of the back-projection in the box, where 1 is the target's commonest hue everywhere. Where
    the first box holds no colour at all (a grey video), or nothing of it is left near the box, the last box is
    repeated; in the latter case confidence is 0.

    Args:
        params: The numbers.
        resizes: Whether the box follows the target's size (CamShift).
    """

    def __init__(self, params: Params, *, resizes: bool) -> None:
        super().__init__()
        self.params = params
        self._resizes = resizes
        self._table = np.zeros(HUE_COUNT)
        self._box = np.zeros(4)

    def _start(self, image: Image, box: Box) -> None:
        height, width = image.shape[:2]
        self._box = box
        x, y, w, h = _window(box, width, height)
        hue, kept = self._hue(image[y : y + h, x : x + w])
        counts = np.bincount(hue[kept] * self.params.hue_bins // HUE_COUNT, minlength=self.params.hue_bins)
        shares = counts / counts.max() if counts.any() else counts.astype(np.float64)
        self._table = shares[np.arange(HUE_COUNT) * self.params.hue_bins // HUE_COUNT]

    def _follow(self, image: Image) -> Estimate:
        height, width = image.shape[:2]
        hue, kept = self._hue(image)
        likely = np.where(kept, 255.0 * self._table[hue], 0.0).round().astype(np.uint8)
        start = _window(self._box, width, height)
        stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, self.params.iteration_count, 1.0)
        if _total(likely, start) == 0:
            return Estimate(self._box, 0.0)
        end: Any
        if self._resizes:
            _, end = cv2.CamShift(likely, start, stop)
        else:
            _, end = cv2.meanShift(likely, start, stop)
        x, y, w, h = (int(one) for one in end)
        if w >= 1 and h >= 1:
            if self._resizes:
                self._box = np.array([x, y, w, h], dtype=np.float64)
            else:  # moved by what the window moved, so that fractions of a pixel are not lost
                self._box = self._box + np.array([x - start[0], y - start[1], 0.0, 0.0])
        window = _window(self._box, width, height)
        return Estimate(self._box, min(_total(likely, window) / (255.0 * window[2] * window[3]), 1.0))

    def _hue(self, image: NDArray[np.uint8]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """`(H, W)` hue, and where it can be trusted."""
        hsv = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2HSV))
        kept = (hsv[..., 1] >= self.params.min_saturation) & (hsv[..., 2] >= self.params.min_value)
        return hsv[..., 0].astype(np.intp), kept


def make_meanshift(*, seed: int, preset: str, **params: Any) -> Shift:
    """Factory of `opencv-meanshift`; `params` are those of `Params`, and nothing in it is random."""
    return Shift(settle("opencv-meanshift", PRESETS, preset, params), resizes=False)


def make_camshift(*, seed: int, preset: str, **params: Any) -> Shift:
    """Factory of `opencv-camshift`; `params` are those of `Params`, and nothing in it is random."""
    return Shift(settle("opencv-camshift", PRESETS, preset, params), resizes=True)


def _window(box: Box, width: int, height: int) -> tuple[int, int, int, int]:
    """The whole pixels of a box that lie in the image, at least one."""
    inside = boxes.clip(box, width, height)
    x, y = min(int(inside[0]), width - 1), min(int(inside[1]), height - 1)
    right, bottom = (int(np.ceil(inside[k] + inside[k + 2])) for k in (0, 1))
    return x, y, max(right - x, 1), max(bottom - y, 1)


def _total(values: NDArray[np.uint8], window: tuple[int, int, int, int]) -> float:
    x, y, w, h = window
    return float(values[y : y + h, x : x + w].sum(dtype=np.int64))
