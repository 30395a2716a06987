"""Keeps a differential drive on a path.

The turn rate is the tracking law of Kanayama et al. 1990 ("A stable tracking control method for an autonomous mobile
robot", ICRA, eq. 8), with the reference taken abreast of the robot, so that it has no error along the path:

    w = v (kappa + K_y y + K_theta sin e)

with the path's curvature kappa, sideways error y and error of heading e. For small errors y obeys, per metre driven,
y'' + K_theta y' + K_y y = 0: critically damped with the length L when K_y = 1 / L^2 and K_theta = 2 / L.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pftrack_sim.agents.path import Path

SETTLE_M = 0.5
"""Driving distance in which an error of the path falls to 1/e (critically damped)."""

SIDEWAYS_M_S2 = 0.9
"""The robot slows down for bends so that nothing is pushed outwards harder than this."""

PREVIEW_S = 0.2
"""The bend is looked up this far ahead: what the motors and the acceleration limit need to get there."""

BRAKE_M_S2 = 0.8
"""Deceleration before a bend."""

FARTHEST_RAD = 1.2
"""With a larger error of heading the robot turns on the spot first."""


@dataclass(frozen=True)
class Limits:
    """Of the drive.

    Attributes:
        speed_m_s: Fastest forward.
        turn_rad_s: Fastest turn.
    """

    speed_m_s: float
    turn_rad_s: float


def follow(
    path: Path, s_m: float, pose: tuple[float, float, float], speed_m_s: float, limits: Limits
) -> tuple[float, float]:
    """Speed and turn rate that keep the robot on the path.

    Args:
        path: Where to drive.
        s_m: Arc length of the robot's nearest point.
        pose: x, y [m] and heading [rad] of the robot.
        speed_m_s: Wanted speed; negative is held at 0, the robot never reverses.
        limits: Of the drive.

    Returns:
        Forward speed [m/s] and turn rate [rad/s].
    """
    x, y, heading = (float(v) for v in path.at(s_m))
    error = math.remainder(heading - pose[2], 2.0 * math.pi)
    # Sideways error in the frame of the path: positive when the path is to the left of the robot.
    aside = -math.sin(heading) * (x - pose[0]) + math.cos(heading) * (y - pose[1])
    speed = min(max(speed_m_s, 0.0), limits.speed_m_s, _bend_speed(path, s_m, limits))
    if abs(error) > FARTHEST_RAD:
        return 0.0, math.copysign(0.6 * limits.turn_rad_s, error)
    speed *= math.cos(error)
    bend = float(path.curvature(s_m + PREVIEW_S * speed))
    pull = max(-1.0, min(1.0, aside / SETTLE_M)) / SETTLE_M
    turn = speed * (bend + pull + 2.0 * math.sin(error) / SETTLE_M)
    return speed, max(-limits.turn_rad_s, min(limits.turn_rad_s, turn))


def _bend_speed(path: Path, s_m: float, limits: Limits) -> float:
    """The fastest now from which every bend of the next metres can be met at its own speed."""
    ahead = np.linspace(0.0, 0.5 * limits.speed_m_s**2 / BRAKE_M_S2 + 0.3, 24)
    bends = np.maximum(np.abs(path.curvature(s_m + ahead)), 1e-6)
    # A fifth of the turn rate is kept for corrections.
    there = np.minimum(np.sqrt(SIDEWAYS_M_S2 / bends), 0.8 * limits.turn_rad_s / bends)
    return float(np.sqrt(there**2 + 2.0 * BRAKE_M_S2 * ahead).min())
