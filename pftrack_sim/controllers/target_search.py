"""Search for a lost target: look to the side where it left, then sweep."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.controllers.base import RobotParameters, is_lost
from pftrack_sim.controllers.visual_servo import GAZE_S, TURN_S, VisualServo, box_direction
from pftrack_sim.core.proprioception import PROPRIO_INDEX
from pftrack_sim.core.records import Estimate
from pftrack_sim.core.types import FloatArray

PATIENCE_S = 0.5  # Time during which the last motion decays before the search: most occlusions are short

OVERSHOOT_RAD = math.radians(35.0)
"""First angle past the last direction, to the side where the target left: half a usual field of view."""

LOOK_S = 1.5  # Time at that angle before the sweep
SWEEP_S = 6.0  # Period of the sweep: at an amplitude of 60 degrees the view moves at most 63 degrees/s

SWEEP_GROWTH_RAD_S = math.radians(10.0)
MAX_AMPLITUDE_RAD = math.pi


class TargetSearch:
    """Follows by visual servoing; while the target is lost, turns to where it left, then sweeps.

    The target's last direction is stored in the odometry frame, with the side to which it was moving. For `PATIENCE_S`
    the last motion decays; then the head looks `OVERSHOOT_RAD` past that direction, the base turning after it; after
    `LOOK_S` the view sweeps about that direction with growing amplitude, until the target is visible again. The inner
    controller estimates the distance and defines when the target is lost.
    """

    def __init__(self, inner: VisualServo) -> None:
        self._inner = inner
        self.reset(RobotParameters())

    @property
    def distance_m(self) -> float | None:
        """Distance by the last box; None while the target is lost."""
        return self._inner.distance_m

    @property
    def wanted_m_s(self) -> float:
        """Forward speed for a target straight ahead; 0 while the target is lost."""
        return self._inner.wanted_m_s

    def reset(self, robot: RobotParameters) -> None:
        """See `Controller.reset`."""
        self._inner.reset(robot)
        self._robot = robot
        self._lost_s = 0.0
        self._direction_rad: float | None = None
        self._side = 1.0

    def act(self, estimate: Estimate, proprio: NDArray[Any]) -> FloatArray:
        """See `Controller.act`."""
        command = self._inner.act(estimate, proprio)
        heading = float(proprio[PROPRIO_INDEX["odometry_heading_rad"]])
        pan = float(proprio[PROPRIO_INDEX["pan_rad"]])
        if not is_lost(estimate, self._inner.least_confidence):
            self._remember(heading + pan + box_direction(estimate, self._robot)[0], heading + pan)
            self._lost_s = 0.0
            return command
        self._lost_s += self._robot.frame_s
        if self._lost_s <= PATIENCE_S:
            return command
        if self._direction_rad is None:
            self._direction_rad = heading + pan
        look = self._direction_rad + self._side * self.sweep_rad(self._lost_s - PATIENCE_S)
        # In the direction of the sweep, not by the shorter turn: a look backwards does not jump from side to side.
        error = math.remainder(look - heading - pan, 2.0 * math.pi)
        yaw_rate = float(proprio[PROPRIO_INDEX["gyro_z_rad_s"]])
        tilt = float(proprio[PROPRIO_INDEX["tilt_rad"]])
        rates = np.array([0.0, pan / TURN_S, error / GAZE_S - yaw_rate, -tilt / (4.0 * GAZE_S)])
        return np.clip(rates / self._robot.limits, -1.0, 1.0)

    @staticmethod
    def sweep_rad(searching_s: float) -> float:
        """Angle past the last direction, to the side where the target left, after this time of the search."""
        if searching_s < LOOK_S:
            return OVERSHOOT_RAD
        sweeping_s = searching_s - LOOK_S
        amplitude = min(OVERSHOOT_RAD + SWEEP_GROWTH_RAD_S * sweeping_s, MAX_AMPLITUDE_RAD)
        return amplitude * math.cos(2.0 * math.pi * sweeping_s / SWEEP_S)

    def _remember(self, direction_rad: float, axis_rad: float) -> None:
        """Store the target's direction, and the side of the view to which it is moving."""
        last = self._direction_rad
        moved = 0.0 if last is None else math.remainder(direction_rad - last, 2.0 * math.pi)
        offset = math.remainder(direction_rad - axis_rad, 2.0 * math.pi)
        # The position extrapolated by half a second.
        predicted = offset + 0.5 * moved * self._robot.rate_hz
        if abs(predicted) > math.radians(1.0):
            self._side = math.copysign(1.0, predicted)
        self._direction_rad = direction_rad
