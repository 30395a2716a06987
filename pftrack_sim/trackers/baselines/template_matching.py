"""Template matching (`ncc`): normalised cross-correlation with the grey patch of the first frame.

`cv2.matchTemplate` (zero mean) in a window around the last box; the size of the box is kept. The simplest tracker that
uses the image (the VOT challenges have a similar baseline).
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.parameters import Parameters


class NccParameters(Parameters):
    """Parameters of `ncc`: search distance in each direction, as a multiple of the square root of the box's area."""

    search: Annotated[float, Field(ge=0.0, le=100.0)] = 0.5


class Ncc(BaseTracker):
    """Template matching. Confidence is the correlation, 0 where it is negative or undefined (uniform patches)."""

    def __init__(self, params: NccParameters) -> None:
        super().__init__()
        self.params = params

    def _start(self, image: Image, box: Box) -> None:
        height, width = image.shape[:2]
        inside = boxes.clip(box, width, height)
        x, y = min(int(inside[0]), width - 1), min(int(inside[1]), height - 1)
        right, bottom = (max(math.ceil(inside[k] + inside[k + 2]), at + 1) for k, at in ((0, x), (1, y)))
        self._patch = _grey(image)[y:bottom, x:right]
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


def make(name: str, *, seed: int, preset: str, **params: Any) -> Ncc:
    """Make `ncc`, which uses no random numbers."""
    return Ncc(NccParameters.from_preset(name, preset, params))


def _grey(image: Image) -> NDArray[np.uint8]:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)


def _sum_of_squares(grey: NDArray[np.uint8], rows: int, columns: int) -> FloatArray:
    """Sum of squared deviations from the mean of every rows x columns patch; exactly 0 for uniform patches."""
    sums, squares = cv2.integral2(grey, sdepth=cv2.CV_64F, sqdepth=cv2.CV_64F)

    def patch_sums(integral: Any) -> FloatArray:
        full = np.asarray(integral, dtype=np.float64)
        return full[rows:, columns:] - full[:-rows, columns:] - full[rows:, :-columns] + full[:-rows, :-columns]

    return patch_sums(squares) * float(rows * columns) - np.square(patch_sums(sums))
