"""`ncc`: where near the last box is the patch that correlates best with that of the first frame?

Normalised cross-correlation (`cv2.matchTemplate`, zero mean) of the grey image in a local window; the size of the box
is kept. The simplest tracker that looks: the floor that a method must rise above (the VOT challenges ship one like it).
"""

from __future__ import annotations

import math
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


@dataclass(frozen=True)
class Params:
    """Its one number.

    Attributes:
        search: How far the patch is looked for in each direction, as a multiple of the square root of the box's area.
    """

    search: Annotated[float, Between(0.0, 100.0)] = 0.5


PRESETS = {"paper": Params(), "default": Params()}


class Ncc(BaseTracker):
    """The tracker. Confidence is the correlation, 0 when it is negative; a patch of one colour correlates with nothing.

    Args:
        params: The number.
    """

    def __init__(self, params: Params) -> None:
        super().__init__()
        self.params = params
        self._patch = np.zeros((1, 1), np.uint8)
        self._corner = (0, 0)
        self._offset = np.zeros(2)
        self._size = np.zeros(2)

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
        # Where patch or image are of one colour the correlation is undefined, and OpenCV may say 1 or infinity.
        flat = ~np.isfinite(match) | (_spread(window, rows, columns) == 0.0)
        match[flat] = -1.0
        peak = int(match.argmax())
        best = float(match.flat[peak])
        if self._patch.min() < self._patch.max() and best > -1.0:
            row, column = divmod(peak, match.shape[1])
            self._corner = (left + column, top + row)
        else:
            best = 0.0
        box = np.concatenate([np.array(self._corner) + self._offset, self._size])
        return Estimate(box, min(max(best, 0.0), 1.0))


def make_ncc(*, seed: int, preset: str, **params: Any) -> Ncc:
    """Factory of `ncc`; `params` are those of `Params`, and nothing in it is random."""
    return Ncc(settle("ncc", PRESETS, preset, params))


def _grey(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)


def _spread(grey: NDArray[np.uint8], rows: int, columns: int) -> NDArray[np.float64]:
    """Variance of every rows x columns patch times its number of pixels, exact for whole numbers up to rounding."""
    sums, squares = cv2.integral2(grey, sdepth=cv2.CV_64F, sqdepth=cv2.CV_64F)

    def over(table: Any) -> NDArray[np.float64]:
        full = np.asarray(table, dtype=np.float64)
        return full[rows:, columns:] - full[:-rows, columns:] - full[rows:, :-columns] + full[:-rows, :-columns]

    count = float(rows * columns)
    return over(squares) * count - np.square(over(sums))
