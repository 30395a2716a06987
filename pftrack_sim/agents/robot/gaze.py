"""A lazy operator's hand on the camera: the target stays in view, but is rarely centred."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

TORSO_M = 1.1
"""Height of what the operator looks at."""

LAG_S = 0.6
"""Time constant of the operator."""

DEAD_ZONE_RAD = math.radians(6.0)
"""An error of direction that does not bother the operator."""

ALARM_RAD = math.radians(8.0)
"""Beyond the dead zone by this much, the operator is twice as quick; beyond by more, quicker still."""

_LEAST_M = 0.3


def rates(T_world_camera: NDArray[np.float64], target_m: NDArray[np.float64], tick_s: float) -> tuple[float, float]:
    """Pan and tilt rate [rad/s] from where the camera looks now.

    Args:
        T_world_camera: `(4, 4)` camera pose.
        target_m: `(2,)` x, y of the target, world frame.
        tick_s: Length of the tick; no step goes beyond the target.
    """
    x, y, z = T_world_camera[:3, :3].T @ (np.array([*target_m, TORSO_M]) - T_world_camera[:3, 3])
    pan = math.atan2(-x, z)
    tilt = math.atan2(-y, max(math.hypot(x, z), _LEAST_M))
    return _hand(pan, tick_s), _hand(tilt, tick_s)


def _hand(error_rad: float, tick_s: float) -> float:
    beyond = max(abs(error_rad) - DEAD_ZONE_RAD, 0.0)
    haste = 1.0 + beyond / ALARM_RAD
    return math.copysign(min(beyond * haste / LAG_S, beyond / tick_s), error_rad)
