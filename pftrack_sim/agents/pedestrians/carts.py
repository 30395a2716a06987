"""Carts that drive themselves between the camera and the target, each at its time, and out of the way again."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.agents.pedestrians.crossing import Crossing, OcclusionTrajectory, Xy, outside, within
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap

Array = NDArray[np.float64]

LIMIT_M_S = 3.2
"""A cart goes no faster."""

BRAKE_M_S2 = 1.2
WALL_GAP_M = 0.5
"""Room that the centre of a cart keeps to walls and things while it does not cover the target."""

_FACE_S = 0.25
"""Time constant with which a cart turns its broad side to the camera."""

_CLEAR_OF_TARGET_M = 0.85
_CLEAR_OF_ROBOT_M = 0.9


class Carts:
    """The carts of one episode. On wheels that roll any way, they keep their broad side to the camera.

    Args:
        crossings: What each one is asked; their `stage_m`, `side` and `lead_s` are given.
        ground: What stands where.

    Attributes:
        state: `(4, K)` x, y [m] and velocity [m/s].
        yaw_rad: `(K,)` angle of each one's front, where it looks at the camera from, to the world's x.
    """

    def __init__(self, crossings: Sequence[Crossing], ground: ObstacleMap) -> None:
        self._crossings = tuple(crossings)
        self._ground = ground
        self.reset()

    def reset(self) -> None:
        """All of them to where they wait."""
        self._walks = [OcclusionTrajectory(one, _side(one)) for one in self._crossings]
        self._done = [False] * len(self._walks)
        self._fresh = True
        stages = [one.stage_m or (0.0, 0.0) for one in self._crossings]
        self.state: Array = np.vstack([np.array(stages).reshape(-1, 2).T, np.zeros((2, len(stages)))])
        self.yaw_rad: Array = np.zeros(len(stages))

    def advance(self, dt_s: float, time_s: float, camera: Xy, target: Xy, robot: Sequence[float]) -> None:
        """Drive one tick.

        Args:
            dt_s: Length of the tick.
            time_s: Time at its end.
            camera: Where the camera is then, on the ground.
            target: Where the target is then.
            robot: Where the robot is then.
        """
        for index, walk in enumerate(self._walks):
            x, y, vx, vy = self.state[:, index].tolist()
            walk.watch(dt_s, time_s, camera, target)
            if not walk.begun and time_s >= walk.crossing.at_s - (walk.crossing.lead_s or 0.0):
                walk.begin(dt_s, time_s, (x, y), None if self._fresh else (vx, vy))
            sight = math.atan2(target[1] - camera[1], target[0] - camera[0])
            if self._fresh:
                self.yaw_rad[index] = sight
            if not walk.begun:
                continue
            there = self._stop(dt_s, x, y, vx, vy) if self._done[index] else walk.position(time_s)
            if walk.crossing.at_s <= time_s <= walk.crossing.until_s:
                there = within((x, y), there, LIMIT_M_S * dt_s)
            else:
                there = outside(there, target, _CLEAR_OF_TARGET_M)
                there = outside(there, robot, _CLEAR_OF_ROBOT_M)
                there = within((x, y), self._ground.outside(there, WALL_GAP_M), LIMIT_M_S * dt_s)
            if not self._done[index]:
                turn = math.remainder(sight - self.yaw_rad[index], 2.0 * math.pi)
                self.yaw_rad[index] += min(dt_s / _FACE_S, 1.0) * turn
                self._done[index] = walk.finished(time_s)
            self.state[:, index] = (*there, (there[0] - x) / dt_s, (there[1] - y) / dt_s)
        self._fresh = False

    @staticmethod
    def _stop(dt_s: float, x: float, y: float, vx: float, vy: float) -> Xy:
        """Roll to a stop along the way it has."""
        speed = math.hypot(vx, vy)
        slower = max(speed - BRAKE_M_S2 * dt_s, 0.0) / speed if speed > 0.0 else 0.0
        return x + slower * vx * dt_s, y + slower * vy * dt_s


def _side(crossing: Crossing) -> Literal[-1, 1]:
    return 1 if crossing.side is None else crossing.side
