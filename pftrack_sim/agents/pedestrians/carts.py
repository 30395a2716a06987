"""Carts that drive between the camera and the target at planned times."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum, auto

from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap, Xy, limited_step, outside_circle
from pftrack_sim.agents.pedestrians.occlusion_trajectory import Crossing, OcclusionTrajectory

MAX_SPEED_M_S = 3.2
BRAKE_M_S2 = 1.2
WALL_DISTANCE_M = 0.5
"""Distance of a cart's centre from walls and obstacles while it does not cover the target."""

_YAW_TIME_CONSTANT_S = 0.25
_TARGET_DISTANCE_M = 0.85
_ROBOT_DISTANCE_M = 0.9


class _Phase(Enum):
    WAITING = auto()
    CROSSING = auto()
    STOPPING = auto()


class Cart:
    """One omnidirectional cart that keeps its broad side towards the camera.

    Args:
        crossing: Time and place of its crossing.
        obstacles: Obstacle map of the place.

    Attributes:
        position_m: x, y [m], world frame.
        velocity_m_s: x, y [m/s].
        yaw_rad: Direction of the line of sight that its broad side faces.
    """

    def __init__(self, crossing: Crossing, obstacles: ObstacleMap) -> None:
        self._crossing = crossing
        self._obstacles = obstacles
        self.reset()

    def reset(self) -> None:
        """Move back to the waiting place."""
        self._trajectory = OcclusionTrajectory(self._crossing)
        self._phase = _Phase.WAITING
        self._first_update = True
        self.position_m: Xy = self._crossing.waiting_m
        self.velocity_m_s: Xy = (0.0, 0.0)
        self.yaw_rad = 0.0

    def update(self, dt_s: float, time_s: float, camera_m: Xy, target_m: Xy, robot_m: Sequence[float]) -> None:
        """Drive for one tick of `dt_s` that ends at `time_s`; the positions `(2,)` are those at its end."""
        crossing, trajectory, here = self._crossing, self._trajectory, self.position_m
        trajectory.update(dt_s, time_s, camera_m, target_m)
        sight_rad = math.atan2(target_m[1] - camera_m[1], target_m[0] - camera_m[0])
        if self._phase is _Phase.WAITING and time_s >= crossing.at_s - crossing.lead_s:
            trajectory.begin(dt_s, time_s, here, None if self._first_update else self.velocity_m_s)
            self._phase = _Phase.CROSSING
        if self._first_update:
            self.yaw_rad = sight_rad
            self._first_update = False
        if self._phase is _Phase.WAITING:
            return
        there = self._braked(dt_s) if self._phase is _Phase.STOPPING else trajectory.position(time_s)
        if not crossing.at_s <= time_s <= crossing.until_s:
            there = outside_circle(there, target_m, _TARGET_DISTANCE_M)
            there = outside_circle(there, robot_m, _ROBOT_DISTANCE_M)
            there = self._obstacles.pushed_out(there, WALL_DISTANCE_M)
        there = limited_step(here, there, MAX_SPEED_M_S * dt_s)
        if self._phase is _Phase.CROSSING:
            error = math.remainder(sight_rad - self.yaw_rad, 2.0 * math.pi)
            self.yaw_rad += min(dt_s / _YAW_TIME_CONSTANT_S, 1.0) * error
            if trajectory.finished(time_s):
                self._phase = _Phase.STOPPING
        self.position_m = there
        self.velocity_m_s = ((there[0] - here[0]) / dt_s, (there[1] - here[1]) / dt_s)

    def _braked(self, dt_s: float) -> Xy:
        """Next position when braking to a stop."""
        (x, y), (vx, vy) = self.position_m, self.velocity_m_s
        speed = math.hypot(vx, vy)
        share = max(speed - BRAKE_M_S2 * dt_s, 0.0) / speed if speed > 0.0 else 0.0
        return x + share * vx * dt_s, y + share * vy * dt_s
