"""What to do when the target is gone: look where it went, then look around."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.controllers.base import RobotParameters, is_lost
from pftrack_sim.controllers.servo import GAZE_S, TURN_S, Servo, direction
from pftrack_sim.core.proprioception import PROPRIO_INDEX
from pftrack_sim.core.records import Estimate

PATIENCE_S = 0.5
"""So long the last motion fades: most losses are a pillar's width."""

BEYOND_RAD = math.radians(35.0)
"""How far past the last direction one looks first, to the side where the target left: half a usual field of view."""

LOOK_S = 1.5
"""Time to look there before sweeping."""

SWEEP_S = 6.0
"""Period of the sweep: at 60 degrees to each side the view moves at most 63 degrees/s."""

SWEEP_GROWTH_RAD_S = math.radians(10.0)
WIDEST_RAD = math.pi
"""The sweep widens until it goes all the way round."""


class Searching:
    """Follows while there is something to follow; on loss turns to where the target left, then sweeps.

    Where the target was is remembered as a direction in the frame of the odometry, with the side to which it was
    moving. For `PATIENCE_S` the last motion dies away; then the head looks `BEYOND_RAD` past that direction, the base
    turning after it; after `LOOK_S` the look swings about that direction, wider and wider, until it is seen again.

    Args:
        inner: Follows; says how far the target is, and when it counts as lost.
    """

    def __init__(self, inner: Servo) -> None:
        self._inner = inner
        self.reset(RobotParameters())

    @property
    def distance_m(self) -> float | None:
        """To the target as the last box has it; None while it is lost."""
        return self._inner.distance_m

    def reset(self, rig: RobotParameters) -> None:
        """Forget where the target was; see `Controller.reset`."""
        self._inner.reset(rig)
        self._rig = rig
        self._lost_s = 0.0
        self._at_rad: float | None = None
        self._side = 1.0

    def act(self, estimate: Estimate, proprio: NDArray[Any]) -> NDArray[np.float64]:
        """Follow, or search; see `Controller.act`."""
        command = self._inner.act(estimate, proprio)
        heading = float(proprio[PROPRIO_INDEX["odometry_heading_rad"]])
        pan = float(proprio[PROPRIO_INDEX["pan_rad"]])
        if not is_lost(estimate, self._inner.least_confidence):
            self._remember(heading + pan + direction(estimate, self._rig)[0], heading + pan)
            self._lost_s = 0.0
            return command
        self._lost_s += self._rig.frame_s
        if self._lost_s <= PATIENCE_S:
            return command
        if self._at_rad is None:
            self._at_rad = heading + pan
        look = self._at_rad + self._side * self.swing_rad(self._lost_s - PATIENCE_S)
        # The way the head can go, not the shortest: a look behind the back does not jump from side to side.
        error = math.remainder(look - heading - pan, 2.0 * math.pi)
        spin = float(proprio[PROPRIO_INDEX["gyro_z_rad_s"]])
        tilt = float(proprio[PROPRIO_INDEX["tilt_rad"]])
        wanted = np.array([0.0, pan / TURN_S, error / GAZE_S - spin, -tilt / (4.0 * GAZE_S)])
        return np.clip(wanted / self._rig.limits, -1.0, 1.0)

    @staticmethod
    def swing_rad(searching_s: float) -> float:
        """How far past the last direction to look, to the side where the target left, this long into the search."""
        if searching_s < LOOK_S:
            return BEYOND_RAD
        sweeping_s = searching_s - LOOK_S
        width = min(BEYOND_RAD + SWEEP_GROWTH_RAD_S * sweeping_s, WIDEST_RAD)
        return width * math.cos(2.0 * math.pi * sweeping_s / SWEEP_S)

    def _remember(self, at_rad: float, axis_rad: float) -> None:
        """Where the target is, and to which side of the view it is going."""
        moved = 0.0 if self._at_rad is None else math.remainder(at_rad - self._at_rad, 2.0 * math.pi)
        aside = math.remainder(at_rad - axis_rad, 2.0 * math.pi)
        # Its motion over half a second says more than where in the image it is.
        going = aside + 0.5 * moved * self._rig.rate_hz
        if abs(going) > math.radians(1.0):
            self._side = math.copysign(1.0, going)
        self._at_rad = at_rad
