"""Search for a lost target: drive to where it was last seen, look to the side where it left, then sweep."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.controllers.base import RobotParameters, is_lost
from pftrack_sim.controllers.visual_servo import DISTANCE_S, GAZE_S, TURN_S, VisualServo, box_direction
from pftrack_sim.core.proprioception import PROPRIO_INDEX, RANGES, beam_angles_rad
from pftrack_sim.core.records import Estimate
from pftrack_sim.core.types import FloatArray

PATIENCE_S = 0.5  # Time during which the last motion decays before the search: most occlusions are short

OVERSHOOT_RAD = math.radians(35.0)
"""First angle past the last direction, to the side where the target left: half a usual field of view."""

MOTION_S = 1.0  # Time over which the target's motion on the ground is measured
LEAD_S = 1.2  # The target is assumed to have walked on for this time: past the edge that hid it
WALKS_S = 3.0  # It is looked for where it would be by now if it walked on, for as long as this
ARRIVED_M = 0.5  # The place is reached this far before it ...
BODY_M = 0.5  # ... unless beams end within this of it and none in a ring of twice this around it: a person stands there
STUCK_S, STUCK_M_S = 1.5, 0.15
"""The search goes on from where the robot stands after it has been slower than this for this time, facing its way."""
FACES_RAD = math.radians(45.0)

LOOK_S = 1.5  # Time at that angle before the sweep
LOOKS_S, WIDE_RAD = 2.0, math.radians(60.0)
"""A robot that drives to the last place sweeps on its way from this time after the loss, first by this angle: who has
turned round a corner is beside the way."""
SWEEP_S = 6.0  # Period of the sweep: at an amplitude of 60 degrees the view moves at most 63 degrees/s

SWEEP_GROWTH_RAD_S = math.radians(10.0)
MAX_AMPLITUDE_RAD = math.pi


class TargetSearch:
    """Follows by visual servoing; while the target is lost, drives to where it was last seen, then looks around.

    The target's last places are stored in the odometry frame. For `PATIENCE_S` the last motion decays. A robot that
    `drives` then goes to the last place and `LEAD_S` of the target's motion beyond until it has arrived or cannot
    get nearer, and looks where the target would be by now. To somebody who stands there, or whom the tracker sees
    without being sure, it keeps the distance of following: nearer, the camera would see a part of the body alone.
    From `LOOKS_S` on the view sweeps about that direction with growing amplitude, after the drive with the base
    turning after the head, until the target is visible again. Without `drives` the head first looks `OVERSHOOT_RAD`
    past the target's last direction for `LOOK_S`, to the side to which it was moving, and sweeps about that direction.
    The inner controller estimates the distance and defines when the target is lost.

    Args:
        inner: Follows the target while it is visible.
        drives: Whether the robot drives while it searches: only under a controller that avoids obstacles.
    """

    def __init__(self, inner: VisualServo, *, drives: bool = False) -> None:
        self._inner = inner
        self._drives = drives
        self.reset(RobotParameters())

    @property
    def distance_m(self) -> float | None:
        """Distance by the last box; None while the target is lost."""
        return self._inner.distance_m

    def reset(self, robot: RobotParameters) -> None:
        """See `Controller.reset`."""
        self._inner.reset(robot)
        self._robot = robot
        self._lost_s = self._searching_s = self._stuck_s = 0.0
        self._direction_rad: float | None = None
        self._side = 1.0
        self._places: deque[FloatArray] = deque(maxlen=1 + round(MOTION_S * robot.rate_hz))
        self._last_m, self._motion_m = np.zeros(2), np.zeros(2)
        self.goal_m: FloatArray | None = None
        """`(2,)` where the robot drives to while it searches, in the odometry frame."""
        self.wanted_m_s = 0.0
        """Forward speed for a target, or a place where it may be, straight ahead."""

    def act(self, estimate: Estimate, proprio: NDArray[Any]) -> FloatArray:
        """See `Controller.act`."""
        command = self._inner.act(estimate, proprio)
        self.wanted_m_s = self._inner.wanted_m_s
        position = np.array(proprio[:2], dtype=np.float64)
        heading = float(proprio[PROPRIO_INDEX["odometry_heading_rad"]])
        pan, tilt = self._robot.gaze_rad(proprio)
        if not is_lost(estimate, self._inner.least_confidence):
            direction = heading + pan + box_direction(estimate, self._robot)[0]
            self._remember(direction, heading + pan)
            if self.distance_m is not None:
                self._places.append(position + self.distance_m * np.array([math.cos(direction), math.sin(direction)]))
            self._lost_s = self._searching_s = self._stuck_s = 0.0
            self.goal_m = None
            return command
        self._lost_s += self._robot.frame_s
        if self._lost_s <= PATIENCE_S:
            return command
        if self._direction_rad is None:
            self._direction_rad = heading + pan
        way = self._way(proprio, position, seen=not estimate.occluded)
        # In the direction of the sweep, not by the shorter turn: a look backwards does not jump from side to side.
        forward, turn, swing = 0.0, pan / TURN_S, 0.0
        if way is not None:
            ahead_m, direction = way
            bearing = math.remainder(direction - heading, 2.0 * math.pi)
            self.wanted_m_s = min(max(ahead_m / DISTANCE_S, STUCK_M_S), float(self._robot.limits[0]))
            forward, turn = self.wanted_m_s * max(math.cos(bearing), 0.0), bearing / TURN_S
        if not self._drives or self._lost_s > LOOKS_S:
            since = self._searching_s
            swing = self.sweep_rad(LOOK_S + since, WIDE_RAD) if self._drives else self.sweep_rad(since)
            self._searching_s += self._robot.frame_s
        error = math.remainder(self._direction_rad + self._side * swing - heading - pan, 2.0 * math.pi)
        yaw_rate = float(proprio[PROPRIO_INDEX["gyro_z_rad_s"]])
        rates = np.array([forward, turn, error / GAZE_S - yaw_rate, -tilt / (4.0 * GAZE_S)])
        return np.clip(rates / self._robot.limits, -1.0, 1.0)

    def _way(self, proprio: NDArray[Any], position_m: FloatArray, *, seen: bool) -> tuple[float, float] | None:
        """Distance [m] and direction [rad] of the way to the target's last place; None once there, or stuck.

        Where the tracker sees somebody of whom it is not sure (`seen`), the way ends at the distance of following.
        """
        if self._drives and self._places:
            self._last_m, self._motion_m = self._places[-1], self._places[-1] - self._places[0]
            self.goal_m = self._last_m + LEAD_S / MOTION_S * self._motion_m
            self._places.clear()
        if self.goal_m is None:
            return None
        walked_s = min(self._lost_s, WALKS_S)
        self._direction_rad = _direction(self._last_m + walked_s / MOTION_S * self._motion_m - position_m)
        heading = float(proprio[PROPRIO_INDEX["odometry_heading_rad"]])
        taken = seen or self._is_taken(proprio, self.goal_m - position_m, heading)
        short_m = self._robot.distance_m if taken else ARRIVED_M
        ahead_m, direction = math.dist(self.goal_m, position_m) - short_m, _direction(self.goal_m - position_m)
        wheels = proprio[PROPRIO_INDEX["wheel_left_m_s"]], proprio[PROPRIO_INDEX["wheel_right_m_s"]]
        if abs(0.5 * float(sum(wheels))) >= STUCK_M_S:
            self._stuck_s = 0.0
        elif abs(math.remainder(direction - heading, 2.0 * math.pi)) < FACES_RAD:  # else it turns round
            self._stuck_s += self._robot.frame_s
        if ahead_m <= 0.0 or self._stuck_s > STUCK_S:
            self.goal_m = None
            return None
        return ahead_m, direction

    def _is_taken(self, proprio: NDArray[Any], way_m: FloatArray, heading_rad: float) -> bool:
        """Whether the scan shows somebody, or something as narrow, at the end of a `(2,)` way."""
        ranges = np.asarray(proprio[RANGES], dtype=np.float64)
        angles = heading_rad + beam_angles_rad(self._robot.beam_field_deg, len(ranges))
        away: FloatArray = np.hypot(ranges * np.cos(angles) - way_m[0], ranges * np.sin(angles) - way_m[1])
        return bool((away < BODY_M).any() and not ((away >= BODY_M) & (away < 2.0 * BODY_M)).any())

    @staticmethod
    def sweep_rad(searching_s: float, first_rad: float = OVERSHOOT_RAD) -> float:
        """Angle past the last direction, to the side where the target left, after this time of the search."""
        if searching_s < LOOK_S:
            return first_rad
        sweeping_s = searching_s - LOOK_S
        amplitude = min(first_rad + SWEEP_GROWTH_RAD_S * sweeping_s, MAX_AMPLITUDE_RAD)
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


def _direction(offset_m: FloatArray) -> float:
    return math.atan2(offset_m[1], offset_m[0])
