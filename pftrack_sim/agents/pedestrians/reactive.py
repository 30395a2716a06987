"""One tick of those who yield: towards their next point, and out of everyone's way."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.agents.pedestrians import avoidance
from pftrack_sim.agents.pedestrians.goal_manager import GoalManager
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap

Array = NDArray[np.float64]

NOWHERE_M = 1e6
"""Where a robot is that is not there, and how far people are from themselves."""

RELAX_S = 0.5
"""Time in which people take up the velocity they want (Helbing and Molnar 1995)."""

MAX_ACCELERATION_M_S2 = 2.6
MAX_TURN_RAD_S = math.radians(120.0)
MAX_SPEED_M_S = 2.0

_LEAN_RAD = 1.1
"""How far off the way one faces one sets out: the rest is turned on the way."""

_FACE_S = 0.2
"""Time in which a body turns towards where it goes."""

_BACK_M_S = 0.15
"""Speed at which people step back of their own accord."""

_WAITING_SHYNESS = 0.2

_HARD_PERSON_M = 0.47
_HARD_WALL_M = 0.27
"""What the last resort restores, should the barrier ever have been asked for the impossible."""


class ReactivePedestrians:
    """Those who yield, among those who do not.

    Args:
        ground: What stands where.
        who: Persons who yield, rising.
        waiting: Which of them wait at their place.
        firm: Persons who do not.
        machines: Columns of the state that are the robot's and other machines', the rising rest.
    """

    def __init__(
        self,
        ground: ObstacleMap,
        who: Sequence[int],
        waiting: Sequence[bool],
        firm: Sequence[int],
        machines: Sequence[int],
    ) -> None:
        self._ground = ground
        self.who = np.array(who, dtype=np.intp)
        self._count = len(who)
        self._order = np.array([*who, *firm, *machines], dtype=np.intp)
        self._extra_m = np.where(self._order >= machines[0], avoidance.ROBOT_EXTRA_M, 0.0)
        is_firm = np.arange(len(self._order)) >= self._count
        self._weight = np.where(is_firm, avoidance.YIELD, 1.0)
        self._share = np.where(is_firm, 1.0, 0.5)
        self._self_m = np.eye(self._count, len(self._order)) * NOWHERE_M
        # Those who wait were given a place out of the way: they stay unless someone really comes close.
        self._waiting = np.array(waiting, dtype=bool)
        self._shyness = np.where(self._waiting, _WAITING_SHYNESS, 1.0)

    def move(self, dt_s: float, state: Array, heading_rad: Array, errands: GoalManager) -> None:
        """Write the next places and velocities of those who yield.

        Args:
            dt_s: Length of the tick.
            state: `(4, P + 1)` x, y [m], vx, vy [m/s] of everyone, the robot last; those of who yield are changed.
            heading_rad: `(P,)` where people face.
            errands: Where they want to go.
        """
        who, count = self.who, self._count
        others = avoidance.Others(state[:, self._order], self._extra_m, self._weight, self._share, self._self_m)
        x, y, vx, vy = others.state[:, :count]
        heading = heading_rad[who]
        facing_x, facing_y = np.cos(heading), np.sin(heading)
        wish_x, wish_y = self._wish(x, y, heading, errands)
        distance, away_x, away_y = self._ground.distances(x, y)
        force_x, force_y = avoidance.social_force(others, facing_x, facing_y)
        wall_x, wall_y = avoidance.wall_force(distance, away_x, away_y)
        ax = (wish_x - vx) / RELAX_S + (force_x + wall_x) * self._shyness
        ay = (wish_y - vy) / RELAX_S + (force_y + wall_y) * self._shyness
        scale = np.minimum(1.0, MAX_ACCELERATION_M_S2 / np.sqrt(ax * ax + ay * ay + 1e-9)) * dt_s
        wx, wy = vx + ax * scale, vy + ay * scale
        slower = np.minimum(1.0, MAX_SPEED_M_S / np.sqrt(wx * wx + wy * wy + 1e-9))
        back = np.maximum(-_BACK_M_S - (wx * facing_x + wy * facing_y), 0.0)
        wx, wy = wx * slower + back * facing_x, wy * slower + back * facing_y
        wx, wy = avoidance.barrier_people(others, wx, wy)
        wx, wy = avoidance.barrier_walls(distance, away_x, away_y, wx, wy)
        state[0, who], state[1, who], state[2, who], state[3, who] = x + wx * dt_s, y + wy * dt_s, wx, wy
        self._separate(dt_s, state, x, y, near_wall=bool(distance.min() < _HARD_WALL_M + MAX_SPEED_M_S * dt_s))

    def _wish(self, x: Array, y: Array, heading: Array, errands: GoalManager) -> tuple[Array, Array]:
        """Velocity towards the next point of each one's route, along an arc that a walking body can turn."""
        to_x, to_y = errands.way_m[0, self.who] - x, errands.way_m[1, self.who] - y
        error = wrap(np.arctan2(to_y, to_x) - heading)
        pace = errands.pace_m_s[self.who] * np.maximum(np.cos(error), 0.4)
        if self._waiting.any():
            # Those who wait come to rest at their place, and return to it when someone has made them step aside.
            gap = np.sqrt(to_x * to_x + to_y * to_y)
            nearing = np.minimum(np.maximum((gap - 0.15) / 0.8, 0.0), 1.0)
            pace = np.where(self._waiting, pace * nearing, pace)
        towards = heading + np.minimum(np.maximum(error, -_LEAN_RAD), _LEAN_RAD)
        return pace * np.cos(towards), pace * np.sin(towards)

    def _separate(self, dt_s: float, state: Array, old_x: Array, old_y: Array, *, near_wall: bool) -> None:
        """The last resort: move people out of walls and of each other where the barrier could not."""
        who, count = self.who, self._count
        moved = False
        for _ in range(6):
            x, y = state[:2, self._order]
            dx, dy = x[:count, None] - x + self._self_m, y[:count, None] - y
            distance = np.sqrt(dx * dx + dy * dy)
            lack = _HARD_PERSON_M + self._extra_m - distance
            crowded = lack.max() > 1e-6
            if not crowded and not near_wall:
                break
            new_x, new_y = x[:count], y[:count]
            if crowded:
                push = np.maximum(lack, 0.0) * self._share / np.maximum(distance, 1e-6)
                new_x, new_y = new_x + (push * dx).sum(axis=1), new_y + (push * dy).sum(axis=1)
            away, nx, ny = self._ground.distances(new_x, new_y)
            deep = np.maximum(_HARD_WALL_M - away, 0.0)
            if not crowded and deep.max() <= 1e-6:
                break
            state[0, who] = new_x + (deep * nx).sum(axis=1)
            state[1, who] = new_y + (deep * ny).sum(axis=1)
            moved = near_wall = True
        if moved and dt_s > 0.0:
            state[2, who], state[3, who] = (state[0, who] - old_x) / dt_s, (state[1, who] - old_y) / dt_s


def turn(dt_s: float, vx: Array, vy: Array, heading_rad: Array) -> None:
    """Turn bodies `(N,)` towards where they go, in place, no faster than bodies turn."""
    error = wrap(np.arctan2(vy, vx) - heading_rad)
    sure = np.minimum(np.sqrt(vx * vx + vy * vy) / 0.4, 1.0)
    heading_rad += np.minimum(np.maximum(sure * error / _FACE_S, -MAX_TURN_RAD_S), MAX_TURN_RAD_S) * dt_s


def wrap(angle_rad: Array) -> Array:
    """Angles in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi
