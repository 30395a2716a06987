"""Passing people: direction and speed that keep clear of what moves, by where it will be."""

from __future__ import annotations

import numpy as np

from pftrack_sim.controllers.visual_servo import TURN_S
from pftrack_sim.core.types import BoolArray, FloatArray

KEEP_M, KEEP_S = 0.45, 0.15
"""Clearance from a mover: that from static obstacles, plus what is driven in this time: 0.7 m at 1.6 m/s."""
TURN_COST_M_S = 0.1  # Speed that is given up for a direction a radian nearer to the present heading

_SPEED_SHARES = np.linspace(1.0, 0.2, 5)
_STEP_S = 0.2
_TIMES_S = _STEP_S * np.arange(1, 11)


def pass_movers(
    goal_rad: float, speed_m_s: float, directions_rad: FloatArray, places_m: FloatArray, velocities_m_s: FloatArray
) -> tuple[float, float]:
    """Direction [rad] and speed [m/s] that make the most progress towards the goal and keep clear of what moves.

    Every direction is tried at five speeds: the base is simulated for 2 s, turning towards the direction as it does
    under `ObstacleAvoidance`, and what moves is assumed to keep its velocity (velocity obstacles: Fiorini and Shiller
    1998, "Motion planning in dynamic environments using velocity obstacles", IJRR; simulated arcs: Fox, Burgard and
    Thrun 1997, "The dynamic window approach to collision avoidance", IEEE Robotics and Automation Magazine). Where a
    mover is nearer than the distance to keep, the way must not bring it nearer.

    Args:
        goal_rad: Direction of the goal in the frame of the chassis; returned with speed 0 where there is no way.
        speed_m_s: Greatest speed.
        directions_rad: `(D,)` directions that nothing else blocks.
        places_m: `(K, 2)` places of what moves, in the frame of the chassis.
        velocities_m_s: `(K, 2)` its velocities over the ground, in the same frame.
    """
    directions = np.append(directions_rad, goal_rad)
    speeds = speed_m_s * _SPEED_SHARES
    path = _paths(directions)[:, None] * speeds[:, None, None]  # (D, S, T, 2)
    allowed: BoolArray = np.ones((len(directions), len(speeds)), dtype=np.bool_)
    for place, velocity in zip(places_m, velocities_m_s, strict=True):
        later = place + velocity * _TIMES_S[:, None]
        least_m = np.hypot(*np.moveaxis(path - later, -1, 0)).min(axis=-1)
        allowed &= least_m > np.minimum(KEEP_M + KEEP_S * speeds, np.hypot(*place) - 0.02)
    if not allowed.any():
        return goal_rad, 0.0
    way = speeds * np.cos(directions - goal_rad)[:, None] - TURN_COST_M_S * np.abs(directions)[:, None]
    direction, speed = np.unravel_index(int(np.argmax(np.where(allowed, way, -np.inf))), way.shape)
    return float(directions[direction]), float(speeds[speed])


def _paths(directions_rad: FloatArray) -> FloatArray:
    """`(D, T, 2)` places of a base that drives 1 m/s and turns towards each direction."""
    heading = directions_rad[:, None] * (1.0 - np.exp(-_TIMES_S / TURN_S))
    pace = np.maximum(np.cos(directions_rad[:, None] - heading), 0.0) * _STEP_S
    return np.cumsum(np.stack([pace * np.cos(heading), pace * np.sin(heading)], axis=-1), axis=1)
