"""Where the wheels say the robot is."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pftrack_sim.world.robot.dimensions import TRACK_M, WHEEL_RADIUS_M


@dataclass(frozen=True)
class Odometry:
    """A pose in the frame of the start, and the wheel angles it was worked out at.

    Attributes:
        x_m: Forward from the start.
        y_m: To the left of the start.
        heading_rad: In [-pi, pi], counter-clockwise.
        left_rad: Angle of the left wheel.
        right_rad: Angle of the right wheel.
    """

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0
    left_rad: float = 0.0
    right_rad: float = 0.0

    def at(self, left_rad: float, right_rad: float) -> Odometry:
        """The odometry once the wheels have turned on to these angles.

        Second-order Runge-Kutta: the way is laid along the mean heading (Siciliano et al. 2009, "Robotics: modelling,
        planning and control", eq. 11.84).
        """
        left_m, right_m = WHEEL_RADIUS_M * (left_rad - self.left_rad), WHEEL_RADIUS_M * (right_rad - self.right_rad)
        way, turn = 0.5 * (left_m + right_m), (right_m - left_m) / TRACK_M
        mean = self.heading_rad + 0.5 * turn
        return Odometry(
            self.x_m + way * math.cos(mean),
            self.y_m + way * math.sin(mean),
            math.remainder(self.heading_rad + turn, 2.0 * math.pi),
            left_rad,
            right_rad,
        )
