"""Where the wheels say the robot is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pftrack_sim.scene.robot import TRACK_M, WHEEL_RADIUS_M


@dataclass(frozen=True)
class Calibration:
    """What the odometry takes the wheels and the track for. By default it is the truth.

    Unequal wheels and an uncertain track are the two systematic errors of a differential drive's odometry (Borenstein
    and Feng 1996, "Measurement and correction of systematic odometry errors in mobile robots", IEEE Transactions on
    Robotics and Automation 12(6)). Slip, the unsystematic one, comes from the physics.

    Attributes:
        left_radius_m: Of the left wheel.
        right_radius_m: Of the right wheel.
        track_m: Distance between the tyres' contact points.
    """

    left_radius_m: float = WHEEL_RADIUS_M
    right_radius_m: float = WHEEL_RADIUS_M
    track_m: float = TRACK_M

    @classmethod
    def drawn(cls, error_percent: float, rng: np.random.Generator) -> Calibration:
        """One robot's: each number off by an error of its own, of this standard deviation."""
        left, right, track = 1.0 + 0.01 * error_percent * rng.standard_normal(3)
        return cls(float(left) * WHEEL_RADIUS_M, float(right) * WHEEL_RADIUS_M, float(track) * TRACK_M)


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

    def at(self, left_rad: float, right_rad: float, calibration: Calibration) -> Odometry:
        """The odometry once the wheels have turned on to these angles.

        Second-order Runge-Kutta: the way is laid along the mean heading (Siciliano et al. 2009, "Robotics: modelling,
        planning and control", eq. 11.84).
        """
        left_m = calibration.left_radius_m * (left_rad - self.left_rad)
        right_m = calibration.right_radius_m * (right_rad - self.right_rad)
        way, turn = 0.5 * (left_m + right_m), (right_m - left_m) / calibration.track_m
        mean = self.heading_rad + 0.5 * turn
        return Odometry(
            self.x_m + way * math.cos(mean),
            self.y_m + way * math.sin(mean),
            math.remainder(self.heading_rad + turn, 2.0 * math.pi),
            left_rad,
            right_rad,
        )
