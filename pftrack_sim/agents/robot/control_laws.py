"""Control laws of the scripted robot: path following of the base, gaze control of the head."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.obstacle_map import Xy
from pftrack_sim.core.types import FloatArray

BRAKE_M_S2 = 0.8  # Deceleration before a bend and at the end of a route
_CONVERGENCE_M = 0.5  # Distance driven in which a lateral error falls to 1/e (critically damped)
_LATERAL_ACCELERATION_M_S2 = 0.9  # Limit of the lateral acceleration in bends
_BEND_PREVIEW_M = 0.3  # Bends are looked for this much farther than the robot needs to stop
_PREVIEW_S = 0.2  # Curvature is taken this far ahead, to compensate the delay of motors and acceleration limit
_MAX_HEADING_ERROR_RAD = 1.2  # With a larger error of heading the robot turns on the spot

GAZE_DEAD_ZONE_RAD = math.radians(6.0)
"""The head does not react to smaller errors of direction: the target stays in view, but is rarely centred."""
_GAZE_TIME_CONSTANT_S = 0.6
_GAZE_URGENCY_RAD = math.radians(8.0)  # An error beyond the dead zone by this much doubles the gain
_GAZE_HEIGHT_M = 1.1  # Height of the point of the target that the camera is turned to
_MIN_DISTANCE_M = 0.3


@dataclass(frozen=True)
class DriveLimits:
    """Highest forward speed and turn rate of the drive."""

    speed_m_s: float
    turn_rad_s: float


def follow_path(
    path: Path, s_m: float, pose: tuple[float, float, float], speed_m_s: float, limits: DriveLimits
) -> tuple[float, float]:
    """Speed and turn rate that keep a differential drive on a path.

    The turn rate is the tracking law of Kanayama et al. 1990 ("A stable tracking control method for an autonomous
    mobile robot", ICRA, eq. 8), with the reference abreast of the robot, so that there is no error along the path:

        w = v (kappa + K_y y + K_theta sin e)

    with the path's curvature kappa, lateral error y and heading error e. For small errors y obeys, per metre driven,
    y'' + K_theta y' + K_y y = 0: critically damped with the length L when K_y = 1 / L^2 and K_theta = 2 / L.

    `s_m` is the arc length of the point nearest to the robot, `pose` its x, y [m] and heading [rad]. A negative wanted
    speed counts as 0.

    Returns:
        Forward speed [m/s] and turn rate [rad/s].
    """
    x, y, heading = path.pose(s_m)
    error = math.remainder(heading - pose[2], 2.0 * math.pi)
    # Positive when the path is to the left of the robot.
    lateral = -math.sin(heading) * (x - pose[0]) + math.cos(heading) * (y - pose[1])
    speed = min(max(speed_m_s, 0.0), _bend_speed(path, s_m, limits))
    if abs(error) > _MAX_HEADING_ERROR_RAD:
        return 0.0, math.copysign(0.6 * limits.turn_rad_s, error)
    speed *= math.cos(error)
    curvature = path.curvature(s_m + _PREVIEW_S * speed)
    pull = max(-1.0, min(1.0, lateral / _CONVERGENCE_M)) / _CONVERGENCE_M
    turn = speed * (curvature + pull + 2.0 * math.sin(error) / _CONVERGENCE_M)
    return speed, max(-limits.turn_rad_s, min(limits.turn_rad_s, turn))


def _bend_speed(path: Path, s_m: float, limits: DriveLimits) -> float:
    """Highest speed [m/s] from which every bend ahead can be reached at its own speed."""
    slowest = limits.speed_m_s
    # A fifth of the turn rate is kept for corrections.
    turn_rad_s = 0.8 * limits.turn_rad_s
    gentle = min(_LATERAL_ACCELERATION_M_S2 / slowest**2, turn_rad_s / slowest)
    for first_m, curvature in path.bends(s_m, 0.5 * slowest**2 / BRAKE_M_S2 + _BEND_PREVIEW_M):
        bend = abs(curvature)
        if bend > gentle:
            speed = min(math.sqrt(_LATERAL_ACCELERATION_M_S2 / bend), turn_rad_s / bend)
            slowest = min(slowest, math.sqrt(speed * speed + 2.0 * BRAKE_M_S2 * max(first_m - s_m, 0.0)))
    return slowest


def bearing(T_world_camera: FloatArray, target_m: Xy) -> tuple[float, float]:
    """Direction of a target at x, y from the optical axis, to the left and up [rad]."""
    # Numbers one by one: arrays of three cost ten times as much.
    (x_x, y_x, z_x, at_x), (x_y, y_y, z_y, at_y), (x_z, y_z, z_z, at_z), _ = T_world_camera.tolist()
    to_x, to_y, to_z = target_m[0] - at_x, target_m[1] - at_y, _GAZE_HEIGHT_M - at_z
    x = x_x * to_x + x_y * to_y + x_z * to_z
    y = y_x * to_x + y_y * to_y + y_z * to_z
    z = z_x * to_x + z_y * to_y + z_z * to_z
    return math.atan2(-x, z), math.atan2(-y, max(math.hypot(x, z), _MIN_DISTANCE_M))


def gaze_rate(error_rad: float, tick_s: float, dead_zone_rad: float = GAZE_DEAD_ZONE_RAD) -> float:
    """Rate [rad/s] about one axis that brings an error of direction back into the dead zone, without overshoot.

    A slow human operator behaves alike.
    """
    beyond = max(abs(error_rad) - dead_zone_rad, 0.0)
    gain = 1.0 + beyond / _GAZE_URGENCY_RAD
    return math.copysign(min(beyond * gain / _GAZE_TIME_CONSTANT_S, beyond / tick_s), error_rad)
