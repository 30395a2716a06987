"""Level of the rolling_shutter axis: time from the top row to the bottom row, by what a shaking camera shears.

Over a step between frames the bottom row turns by the readout times the change of the turn rate more than the top row.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pftrack_sim.core.types import FloatArray
from pftrack_sim.measuring.jitter import Untold, stretches, turn_rates
from pftrack_sim.measuring.measured import Quantity
from pftrack_sim.measuring.motion import Step

_SHARES = (0.8, 1.3)  # Depth beside the drive, encoders, and long readouts: what intervals hold besides chance
_MORE_S = 1e-3
_LEAST_RAD = 1e-5  # No better does a series of steps tell a shear, about 0.003 px
_MOST_ERROR_S = 5e-3


def measure_readout(steps: Sequence[Step], times_s: FloatArray) -> list[Quantity]:
    """Readout of the image [ms].

    Raises:
        Untold: The camera shakes too little, or all rows are exposed at once as far as it can be told.
    """
    changes, sheared = [np.zeros((0, 2))], [np.zeros((0, 2))]
    for own in stretches(steps, times_s):
        known = np.array([np.isfinite(one.sheared).all() for one in steps[own]])
        rates, told = turn_rates(steps, times_s, own)
        known &= told
        changes.append(np.diff(rates, axis=0)[known])
        sheared.append(np.array([one.sheared for one in steps[own]])[known])
    change, shear = np.concatenate(changes), np.concatenate(sheared)
    if len(change) < 50:
        raise Untold("needs a background that is followed for 4 s")
    found, weights = np.array([_slope(x - x.mean(), y - y.mean()) for x, y in zip(change.T, shear.T, strict=True)]).T
    readout, error = float(np.average(found, weights=weights)), float(weights.sum() ** -0.5)
    error = max(error, _LEAST_RAD / max(float(change.std()), 1e-9))
    if error > _MOST_ERROR_S:
        raise Untold("the camera shakes too little to shear the image")
    low, high = (
        share * readout + sign * (2.0 * error + _MORE_S) for share, sign in zip(_SHARES, (-1.0, 1.0), strict=True)
    )
    if low <= 0.0:
        raise Untold(f"all rows are exposed at once, or within {1e3 * max(high, 2.0 * error + _MORE_S):.1f} ms")
    settings = {"axes.rolling_shutter.severity": 1.0, "axes.rolling_shutter.readout_ms": min(200.0, 1e3 * readout)}
    return [Quantity("readout", 1e3 * readout, 1e3 * low, 1e3 * high, "ms", len(change), "rolling_shutter", settings)]


def _slope(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Slope of y over x by Huber's weights, and the inverse of its squared error whatever the errors' sizes (White)."""
    weights = np.ones(len(x))
    slope, rest = 0.0, y
    for _ in range(6):
        power = max(float((weights * x * x).sum()), 1e-30)
        slope = float((weights * x * y).sum()) / power
        rest = y - slope * x
        usual = 1.5 * 1.483 * float(np.median(np.abs(rest)))
        weights = 1.0 / np.maximum(1.0, np.abs(rest) / max(usual, 1e-12))
    error = math.sqrt(float(((weights * x * rest) ** 2).sum())) / max(float((weights * x * x).sum()), 1e-30)
    return slope, 1.0 / max(error, 1e-9) ** 2
