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


def solve_row_times(shutter: Shutter, times_s: FloatArray, pixels: FloatArray) -> FloatArray:
    """`(...,)` first instants at which moving points lie on the row at mid-exposure; NaN for points that are NaN.

    Args:
        shutter: Timing of the rows.
        times_s: `(N,)` instants, ascending, that enclose every row's mid-exposure.
        pixels: `(N, ..., 2)` image positions of the points at these [px].
    """
    if len(times_s) == 1:
        return np.broadcast_to(times_s[0], pixels.shape[1:-1])
    # Positive before the row's mid-exposure, negative after it; points beside the image belong to the nearest row.
    column = times_s.reshape(-1, *([1] * (pixels.ndim - 2)))
    remaining = shutter.row_s(np.clip(pixels[..., 1], 0.0, shutter.rows)) - column
    index = np.argmax(remaining[1:] <= 0.0, axis=0)
    before = np.take_along_axis(remaining, index[None], axis=0)[0]
    after = np.take_along_axis(remaining, index[None] + 1, axis=0)[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip(np.where(before > after, before / (before - after), 0.0), 0.0, 1.0)
    solved = times_s[index] + share * (times_s[index + 1] - times_s[index])
    return np.where(np.isfinite(before) & np.isfinite(after), solved, np.nan)


def interpolate_pixels(times_s: FloatArray, pixels: FloatArray, when_s: FloatArray) -> FloatArray:
    """`(..., 2)` image positions [px] of points, each at an instant of its own.

    Args:
        times_s: `(N,)` instants, ascending.
        pixels: `(N, ..., 2)` image positions at these [px].
        when_s: `(...,)` instants wanted, clipped to the range of `times_s`.
    """
    if len(times_s) == 1:
        return pixels[0]
    index = np.clip(np.searchsorted(times_s, when_s, side="right") - 1, 0, len(times_s) - 2)
    share = ((when_s - times_s[index]) / (times_s[index + 1] - times_s[index]))[..., None]
    before = np.take_along_axis(pixels, index[None, ..., None], axis=0)[0]
    after = np.take_along_axis(pixels, index[None, ..., None] + 1, axis=0)[0]
    return before + np.clip(share, 0.0, 1.0) * (after - before)
