"""Wheel odometry and range finder of the robot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from pftrack_sim.core.proprioception import BEAM_HEIGHT_M, RANGE_ANGLES_RAD, RANGE_M
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.layout import HIDDEN_GROUP
from pftrack_sim.scene.robot import BASE, TRACK_M, WHEEL_RADIUS_M


@dataclass(frozen=True)
class OdometryCalibration:
    """Wheel radii and track (distance between the tyres' contacts) that the odometry assumes; by default the true ones.

    Unequal wheels and an uncertain track are the two systematic errors of differential-drive odometry (Borenstein and
    Feng 1996, "Measurement and correction of systematic odometry errors in mobile robots", IEEE Transactions on
    Robotics and Automation 12(6)). Slip, the unsystematic error, comes from the physics.
    """

    left_radius_m: float = WHEEL_RADIUS_M
    right_radius_m: float = WHEEL_RADIUS_M
    track_m: float = TRACK_M

    @classmethod
    def sampled(cls, error_percent: float, rng: np.random.Generator) -> OdometryCalibration:
        """A calibration with independent normal errors of the given standard deviation."""
        left, right, track = 1.0 + 0.01 * error_percent * rng.standard_normal(3)
        return cls(float(left) * WHEEL_RADIUS_M, float(right) * WHEEL_RADIUS_M, float(track) * TRACK_M)


class Odometry(NamedTuple):
    """Pose in the frame of the start, heading in [-pi, pi], and the wheel angles that it belongs to."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0
    left_rad: float = 0.0
    right_rad: float = 0.0

    def updated(self, left_rad: float, right_rad: float, calibration: OdometryCalibration) -> Odometry:
        """The odometry after the wheels have turned to these angles.

        Second-order Runge-Kutta: the path is laid along the mean heading (Siciliano et al. 2009, "Robotics: modelling,
        planning and control", eq. 11.84).
        """
        left_m = calibration.left_radius_m * (left_rad - self.left_rad)
        right_m = calibration.right_radius_m * (right_rad - self.right_rad)
        distance, turn = 0.5 * (left_m + right_m), (right_m - left_m) / calibration.track_m
        mean = self.heading_rad + 0.5 * turn
        return Odometry(
            self.x_m + distance * math.cos(mean),
            self.y_m + distance * math.sin(mean),
            math.remainder(self.heading_rad + turn, 2.0 * math.pi),
            left_rad,
            right_rad,
        )


class RangeFinder:
    """A fan of beams from the middle of the axle, fixed to the chassis.

    The beams meet hidden collision geoms, not what is drawn; they pass through the robot itself. On a robot that
    pitches they may meet the ground.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._base = model.body(BASE).id
        forward, left = np.cos(RANGE_ANGLES_RAD), np.sin(RANGE_ANGLES_RAD)
        self._beams = np.stack([forward, left, np.zeros_like(left)], axis=1)
        self._groups = np.zeros(6, dtype=np.uint8)
        self._groups[HIDDEN_GROUP] = 1
        self._geoms = np.empty(len(self._beams), dtype=np.int32)

    def cast(self, data: mujoco.MjData) -> FloatArray:
        """`(37,)` ranges [m] along `proprioception.RANGE_ANGLES_RAD`; -1 without a hit within about `RANGE_M`.

        Poses of geoms in `data` must be up to date.
        """
        rotation = data.xmat[self._base].reshape(3, 3)
        origin, directions = data.xpos[self._base] + BEAM_HEIGHT_M * rotation[:, 2], (self._beams @ rotation.T).ravel()
        ranges = np.empty(len(self._beams))
        ends = self._geoms, ranges, None, len(ranges), RANGE_M
        mujoco.mj_multiRay(self._model, data, origin, directions, self._groups, True, self._base, *ends)
        return ranges
