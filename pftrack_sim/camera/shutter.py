"""Shutter: exposure, readout and the times of the image rows.

A frame with time stamp t is exposed and read out before t, as by a causal camera. The row at height y of H is exposed
from t - exposure - readout (1 - y / H) for the duration of the exposure; the exposure of the bottom row ends at t.
All times here are relative to the time stamp, hence <= 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.types import FloatArray


@dataclass(frozen=True)
class Shutter:
    """Timing of one camera.

    Attributes:
        exposure_s: Exposure of each row.
        readout_s: Delay between the top and the bottom of the image.
        rows: Height of the image [px].
    """

    exposure_s: float
    readout_s: float
    rows: int

    @property
    def instant(self) -> bool:
        """Whether the whole frame is taken at its time stamp."""
        return self.exposure_s == 0.0 and self.readout_s == 0.0

    @property
    def window_s(self) -> float:
        """Duration from the first exposure of the top row to the time stamp."""
        return self.exposure_s + self.readout_s

    def row_s(self, y_px: ArrayLike) -> FloatArray:
        """Mid-exposure of the rows at heights `y_px` [px], extrapolated beyond the image."""
        share = np.asarray(y_px, dtype=np.float64) / self.rows
        return -0.5 * self.exposure_s - self.readout_s * (1.0 - share)

    @property
    def middle_s(self) -> float:
        """Mid-exposure of the middle row."""
        return -0.5 * self.window_s
