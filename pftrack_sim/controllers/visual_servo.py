"""Image-based visual servoing: follow a person by the box of a tracker."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.controllers.base import LEAST_CONFIDENCE, RobotParameters, is_lost, is_positive, stopping_speed
from pftrack_sim.controllers.target_distance import EDGE_PX, TargetDistance, View
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.proprioception import PROPRIO_INDEX, RANGES
from pftrack_sim.core.records import Estimate
from pftrack_sim.core.types import FloatArray

GAZE_S = 0.25  # Time constant of the head; the phase margin is 67 degrees with 0.1 s of delay in vision and motors
TURN_S = 0.8  # Time constant of the base under the head: three times the head's, which decouples the two loops
DISTANCE_S = 1.2  # Time constant of the distance: an error of 1 m commands 0.8 m/s, which the base reaches within 0.7 s

STOP_M = 0.75
"""Distance at which the robot has stopped at the latest: its hull, half a stride, and the error of the distance."""

BRAKE_M_S2 = 1.0  # Deceleration that the speed limit counts on; the base's greatest is 1.2
TARGET_BRAKE_M_S2 = 2.5  # Deceleration of a walker who stops
REACTION_S = 0.15  # Delay of vision and motors, without the tracker's
COAST_S = 0.6  # Time constant with which all motion decays while the target is lost
REVERSE_SHARE = 0.4  # Greatest backward speed, as a share of the greatest forward speed

ACCELERATION = np.array([1.2, 4.0, 12.0, 8.0])
"""Rate limit of the command: forward [m/s^2], turn, pan, tilt [rad/s^2], which the base can follow and which keeps the
mast upright."""
ACCELERATION.setflags(write=False)


class VisualServo:
    """Centres the box with pan and tilt, turns the base after the head, and drives to the desired distance.

    Every axis is a first-order servo, error over time constant (Chaumette and Hutchinson 2006, "Visual servo control,
    part I", IEEE Robotics and Automation Magazine; the features are the box's centre and height):

        pan rate  = bearing of the box's centre off the optical axis / GAZE_S - turn rate measured by the gyro
        tilt rate = elevation of the box's centre off the optical axis / GAZE_S
        turn rate = pan angle / TURN_S
        forward   = cos(pan) (target's speed away from the robot + (distance - desired distance) / DISTANCE_S)

    The gains follow from the robot. An error e with de/dt = -e / T and a delay d has the phase margin pi/2 - d / T:
    the head's delay of 0.1 s and T = 0.25 s give 67 degrees. The base turns under the head, which compensates its turn:
    T = 0.8 s keeps it a factor of three slower. A first-order servo would lag behind a walker of speed u by u T; the
    estimated speed of the target is fed forward instead.

    Distance and speed of the target are those of `TargetDistance`. The forward speed is limited to
    sqrt(2 a gap + (a t)^2) - a t, from which the robot stops `STOP_M` in front of a target that stops walking; gap is
    the distance beyond, with the target's own stopping distance. Where the image cuts the box above and below, its
    centre says nothing: the camera tilts to where the middle of the body is at the estimated distance. While the target
    is lost (`is_lost`) the last command decays.

    Args:
        distance_m: Desired distance; None takes that of the task.
        person_m: Assumed body height.
        least_confidence: Confidence below which the tracker counts as unsure, in [0, 1].

    Raises:
        ParameterError: A distance or height that is not positive and finite, or a confidence outside [0, 1].
    """

    def __init__(
        self, *, distance_m: float | None = None, person_m: float = 1.72, least_confidence: float = LEAST_CONFIDENCE
    ) -> None:
        for key, value in {"distance_m": distance_m, "person_m": person_m}.items():
            if not (is_positive(value) or (key == "distance_m" and value is None)):
                raise ParameterError(f"servo: {key} must be a positive number, got {value!r}")
        if least_confidence != 0.0 and not (is_positive(least_confidence) and least_confidence <= 1.0):
            raise ParameterError(f"servo: least_confidence must be in [0, 1], got {least_confidence!r}")
        self._own_distance_m = distance_m
        self._estimator = TargetDistance(float(person_m))
        self.least_confidence = float(least_confidence)
        self.reset(RobotParameters())

    def reset(self, robot: RobotParameters) -> None:
        """See `Controller.reset`."""
        self._robot = robot
        self._desired_m = robot.distance_m if self._own_distance_m is None else self._own_distance_m
        self._limits = robot.limits
        self._max_step = ACCELERATION * robot.frame_s / self._limits
        self._command = np.zeros(4)
        self.distance_m: float | None = None
        """Estimated distance; None while the target is lost."""
        self.wanted_m_s = 0.0
        """Forward speed for a target straight ahead; 0 while the target is lost."""
        self._estimator.reset(robot)

    def act(self, estimate: Estimate, proprio: NDArray[Any]) -> FloatArray:
        """See `Controller.act`."""
        pan, tilt = self._robot.gaze_rad(proprio)
        speed = 0.5 * float(proprio[PROPRIO_INDEX["wheel_left_m_s"]] + proprio[PROPRIO_INDEX["wheel_right_m_s"]])
        if is_lost(estimate, self.least_confidence):
            self.distance_m, self.wanted_m_s = None, 0.0
            self._estimator.predict(speed * math.cos(pan))
            self._command = self._command * math.exp(-self._robot.frame_s / COAST_S)
            return self._command.copy()
        bearing, elevation = box_direction(estimate, self._robot)
        yaw_rate = float(proprio[PROPRIO_INDEX["gyro_z_rad_s"]])
        x, y, width, height = estimate.box.tolist()
        self._estimator.predict(speed * math.cos(pan + bearing))
        self._estimator.update(View((x, y, width, height), pan, tilt, np.asarray(proprio[RANGES], dtype=np.float64)))
        distance = self._estimator.distance_m
        assert distance is not None
        self.distance_m = distance
        if y < EDGE_PX and y + height > self._robot.image_size[1] - EDGE_PX:
            elevation = self._estimator.body_elevation_rad() - tilt
        wanted_m_s = self._estimator.speed_m_s + (distance - self._desired_m) / DISTANCE_S
        wanted_m_s = min(wanted_m_s, self._safe_speed(distance), float(self._limits[0]))
        self.wanted_m_s = max(wanted_m_s, -REVERSE_SHARE * float(self._limits[0]))
        forward = max(0.0, math.cos(pan)) * self.wanted_m_s
        rates = np.array([forward, pan / TURN_S, bearing / GAZE_S - yaw_rate, elevation / GAZE_S])
        wanted = np.clip(rates / self._limits, -1.0, 1.0)
        self._command = self._command + np.clip(wanted - self._command, -self._max_step, self._max_step)
        return self._command.copy()

    def _safe_speed(self, distance_m: float) -> float:
        """Greatest speed from which the robot stops in front of the target if that stops walking now [m/s].

        The scan counts unfiltered: it shows at once that the target has stopped.
        """
        walks = max(self._estimator.speed_m_s, 0.0)
        near = min(distance_m, self._estimator.legs_m)
        gap = near - min(STOP_M, 0.5 * self._desired_m) + 0.5 * walks * walks / TARGET_BRAKE_M_S2
        return stopping_speed(gap, BRAKE_M_S2, REACTION_S + self._robot.frame_s)


def box_direction(estimate: Estimate, robot: RobotParameters) -> tuple[float, float]:
    """Bearing (left positive) and elevation (up positive) of a box's centre off the optical axis [rad]."""
    x, y, w, h = estimate.box.tolist()
    width_px, height_px = robot.image_size
    bearing = -math.atan2(x + 0.5 * w - 0.5 * width_px, robot.focal_px)
    return bearing, -math.atan2(y + 0.5 * h - 0.5 * height_px, robot.focal_px)
