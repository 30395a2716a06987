"""A base that is steered as a car is: it turns as it drives, on a circle about a point on its rear axle's line.

The bicycle model (Siciliano et al. 2009, "Robotics: modelling, planning and control", section 11.2.2): with a wheelbase
L and a front wheel steered by the angle d, a speed v of the middle of the rear axle turns the base at v tan(d) / L.
"""

from __future__ import annotations

import math

from pftrack_sim.scenario.robot import Robot


class Steering:
    """Steering angle of a robot's base, counter-clockwise [rad]; at first straight ahead."""

    def __init__(self, robot: Robot, wheelbase_m: float) -> None:
        self._wheelbase_m = wheelbase_m
        self._most_rad, self._rate_rad_s = math.radians(robot.max_steer_deg), math.radians(robot.max_steer_deg_s)
        self.angle_rad = 0.0

    @classmethod
    def of(cls, robot: Robot) -> Steering | None:
        """That of a scenario's robot; None where it turns without steering."""
        return cls(robot, robot.wheelbase_m) if robot.drive == "ackermann" and robot.wheelbase_m else None

    def turn_rad_s(self, speed_m_s: float, wanted_rad_s: float, duration_s: float) -> float:
        """Steer for some time towards a wanted turn rate at a speed, and return the turn rate that results.

        Backwards the same turn rate takes the opposite angle. At a standstill it steers ahead of the start.
        """
        wanted = math.atan2(self._wheelbase_m * wanted_rad_s, abs(speed_m_s)) * (-1.0 if speed_m_s < 0.0 else 1.0)
        wanted = min(max(wanted, -self._most_rad), self._most_rad)
        most = self._rate_rad_s * duration_s
        self.angle_rad += min(max(wanted - self.angle_rad, -most), most)
        return speed_m_s * math.tan(self.angle_rad) / self._wheelbase_m
