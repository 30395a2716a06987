"""Pedestrians and carts that follow a script for a part of the episode.

They read and write `(4,)` columns x, y [m], vx, vy [m/s] of the crowd's state. In all phases except `SCRIPTED`,
pedestrians are moved as reactive ones.
"""

from __future__ import annotations

import math
from enum import Enum, auto
from typing import NamedTuple

import numpy as np

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians import oncoming
from pftrack_sim.agents.pedestrians.avoidance import BARRIER_RATE_S, WALL_DISTANCE_M
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap, Xy, limited_step, outside_circle
from pftrack_sim.agents.pedestrians.occlusion_trajectory import Crossing, OcclusionTrajectory
from pftrack_sim.core.types import FloatArray

# Crossing pedestrians and carts; the distances hold before and after the cover.
_CROSSING_SPEED_LIMIT_M_S = 2.8
_CROSSING_TARGET_DISTANCE_M = 0.55
_CROSSING_ROBOT_DISTANCE_M = 0.7
_CART_SPEED_LIMIT_M_S = 3.2
_CART_BRAKING_M_S2 = 1.2
_CART_WALL_DISTANCE_M = 0.5
_CART_TARGET_DISTANCE_M = 0.85
_CART_ROBOT_DISTANCE_M = 0.9
_CART_YAW_TIME_CONSTANT_S = 0.25

# Oncoming pedestrians.
_ONCOMING_SPEED_LIMIT_M_S = 2.4
_ONCOMING_ROBOT_DISTANCE_M = 0.75
_ROBOT_LANE_M = 1.0  # Least offset from the target's path after the pass, where a robot may follow.
_START_S = 1.0  # Time of taking up the walking speed.
_DETOUR = 1.3  # Assumed length of a route relative to the straight line.


class Phase(Enum):
    """Phases in their order: at the waiting position, on the way to the script (oncoming only), in it, after it."""

    WAITING = auto()
    APPROACHING = auto()
    SCRIPTED = auto()
    RELEASED = auto()


class Surroundings(NamedTuple):
    """Positions x, y [m] on the ground at the end of a tick."""

    camera_m: Xy
    target_m: Xy
    robot_m: Xy


class _Crosser:
    """What covers the line of sight from the camera to the target once."""

    phase: Phase
    state: FloatArray

    def __init__(self, crossing: Crossing, obstacles: ObstacleMap) -> None:
        self.crossing, self._obstacles = crossing, obstacles

    def reset(self, state: FloatArray) -> None:
        """Wait at the position in `state`, which later updates read and write."""
        self.state, self.phase = state, Phase.WAITING
        self._trajectory, self._updates = OcclusionTrajectory(self.crossing), 0


class CrossingPedestrian(_Crosser):
    """A pedestrian that crosses; it is released as soon as the target is uncovered and anything is in its way."""

    def update(self, dt_s: float, time_s: float, around: Surroundings) -> None:
        """Advance phase and state by one tick that ends at `time_s`."""
        if self.phase is Phase.RELEASED:
            return
        self._updates += 1
        crossing, trajectory = self.crossing, self._trajectory
        if self.phase is Phase.WAITING and time_s + 2.0 * dt_s < crossing.start_s:
            return  # The start needs the trajectory of the last two ticks.
        x, y, vx, vy = self.state.tolist()
        trajectory.update(dt_s, time_s, around.camera_m, around.target_m)
        if self.phase is Phase.WAITING:
            if time_s < crossing.start_s:
                return
            # A pedestrian that starts with the episode is already walking.
            trajectory.begin(dt_s, time_s, (x, y), None if self._updates <= 2 else (vx, vy))
            self.phase = Phase.SCRIPTED
        desired = trajectory.position(time_s)
        if not crossing.at_s <= time_s <= crossing.until_s:
            detour = outside_circle(desired, around.target_m, _CROSSING_TARGET_DISTANCE_M)
            detour = outside_circle(detour, around.robot_m, _CROSSING_ROBOT_DISTANCE_M)
            # After the cover, timing does not matter: the pedestrian is released as soon as anything is in its way.
            if trajectory.finished(time_s) or (time_s > crossing.until_s and self._blocked(dt_s, desired, detour)):
                self.phase = Phase.RELEASED
                return
            desired = self._obstacles.pushed_out(detour, WALL_DISTANCE_M)
        _move(self.state, dt_s, desired, _CROSSING_SPEED_LIMIT_M_S)

    def _blocked(self, dt_s: float, desired: Xy, detour: Xy) -> bool:
        """Whether the target, the robot or an obstacle is in the way to the desired position."""
        if detour != desired:
            return True
        position = self.state[:2, None]
        vx, vy = (np.array(desired)[:, None] - position) / dt_s
        distance, (away_x, away_y) = self._obstacles.distances(position), self._obstacles.directions(position)
        opening = away_x * vx + away_y * vy
        return bool((opening < -BARRIER_RATE_S * (distance - WALL_DISTANCE_M)).any())


class Cart(_Crosser):
    """An omnidirectional cart that covers the line of sight once, keeps its broad side towards the camera, and stops.

    Attributes:
        yaw_rad: Direction of the line of sight on which it faces the camera.
    """

    yaw_rad: float

    def reset(self, state: FloatArray) -> None:
        """Move to the waiting position; later updates read and write `state`."""
        super().reset(state)
        self.yaw_rad = 0.0
        state[:] = (*self.crossing.waiting_m, 0.0, 0.0)

    @property
    def position_m(self) -> Xy:
        """x, y [m], world frame."""
        return float(self.state[0]), float(self.state[1])

    def update(self, dt_s: float, time_s: float, around: Surroundings) -> None:
        """Advance phase and state by one tick that ends at `time_s`."""
        crossing, trajectory = self.crossing, self._trajectory
        x, y, vx, vy = self.state.tolist()
        trajectory.update(dt_s, time_s, around.camera_m, around.target_m)
        if self.phase is Phase.WAITING and time_s >= crossing.start_s:
            trajectory.begin(dt_s, time_s, (x, y), None if self._updates == 0 else (vx, vy))
            self.phase = Phase.SCRIPTED
        (camera_x, camera_y), (target_x, target_y) = around.camera_m, around.target_m
        sight_rad = math.atan2(target_y - camera_y, target_x - camera_x)
        if self._updates == 0:
            self.yaw_rad = sight_rad
        self._updates += 1
        if self.phase is Phase.WAITING:
            return
        if self.phase is Phase.SCRIPTED:
            desired = trajectory.position(time_s)
            turn_rad = math.remainder(sight_rad - self.yaw_rad, 2.0 * math.pi)
            self.yaw_rad += min(dt_s / _CART_YAW_TIME_CONSTANT_S, 1.0) * turn_rad
        else:
            speed = math.hypot(vx, vy)
            share = max(speed - _CART_BRAKING_M_S2 * dt_s, 0.0) / speed if speed > 0.0 else 0.0
            desired = x + share * vx * dt_s, y + share * vy * dt_s
        if not crossing.at_s <= time_s <= crossing.until_s:
            desired = outside_circle(desired, around.target_m, _CART_TARGET_DISTANCE_M)
            desired = outside_circle(desired, around.robot_m, _CART_ROBOT_DISTANCE_M)
            desired = self._obstacles.pushed_out(desired, _CART_WALL_DISTANCE_M)
        _move(self.state, dt_s, desired, _CART_SPEED_LIMIT_M_S)
        if trajectory.finished(time_s):
            self.phase = Phase.RELEASED


class OncomingPedestrian:
    """A pedestrian that passes the target once, on the target's path.

    Attributes:
        joining_m: x, y of the point at which it joins the path after waiting [m].
    """

    phase: Phase
    state: FloatArray

    def __init__(self, plan: oncoming.OncomingPass, path: Path, obstacles: ObstacleMap) -> None:
        self._plan, self._path, self._obstacles = plan, path, obstacles
        self.speed_m_s = plan.speed_m_s
        self.joining_m = path.beside(plan.meeting_s_m + oncoming.JOINING_M, plan.left_m)
        self._leaving_s = self._joining_s = -math.inf
        if plan.waiting_m is not None:
            (x, y), (waiting_x, waiting_y) = self.joining_m, plan.waiting_m
            self._joining_s = plan.at_s - oncoming.JOINING_M / plan.speed_m_s
            route_m = _DETOUR * math.hypot(x - waiting_x, y - waiting_y)
            self._leaving_s = self._joining_s - route_m / plan.speed_m_s - _START_S

    def reset(self, state: FloatArray) -> float:
        """Move to the start and return the initial heading [rad]; later updates read and write `state`."""
        self.state = state
        if self._plan.waiting_m is not None:
            self.phase = Phase.WAITING
            x, y = self._plan.waiting_m
            state[:] = (x, y, 0.0, 0.0)
            return math.atan2(self.joining_m[1] - y, self.joining_m[0] - x)
        self.phase = Phase.SCRIPTED
        s = self._s_m(0.0)
        heading = self._path.pose(s)[2] + math.pi
        speed = (s - self._s_m(1e-3)) / 1e-3
        position = self._obstacles.pushed_out(self._lane(s), oncoming.WALL_DISTANCE_M)
        state[:] = (*position, speed * math.cos(heading), speed * math.sin(heading))
        return heading

    def update(self, dt_s: float, time_s: float, around: Surroundings) -> None:
        """Advance phase and state by one tick that ends at `time_s`."""
        if self.phase is Phase.RELEASED:
            return
        if time_s < self._joining_s:
            if time_s >= self._leaving_s:
                self.phase = Phase.APPROACHING
            return
        self.phase = Phase.SCRIPTED
        s, meeting = self._s_m(time_s), self._plan.meeting_s_m
        if s < meeting - 6.0 or s < -2.0:
            self.phase = Phase.RELEASED
            return
        desired = self._lane(s)
        if abs(s - meeting) > oncoming.EXACT_LANE_M:
            desired = self._obstacles.pushed_out(desired, oncoming.WALL_DISTANCE_M)
            desired = outside_circle(desired, around.target_m, abs(self._plan.left_m))
        desired = outside_circle(desired, around.robot_m, _ONCOMING_ROBOT_DISTANCE_M)
        _move(self.state, dt_s, desired, _ONCOMING_SPEED_LIMIT_M_S)

    def _s_m(self, time_s: float) -> float:
        """Arc length on the target's path [m], falling with time."""
        plan, speed = self._plan, self._plan.speed_m_s
        begin_s = plan.at_s - ((self._path.length_m - plan.meeting_s_m) / speed + 0.5 * _START_S)
        if begin_s <= 0.0 or plan.waiting_m is not None:
            return plan.meeting_s_m + speed * (plan.at_s - time_s)
        # The path is too short to walk from the start of the episode: stand at its end, then take up speed.
        since_s = max(time_s - begin_s, 0.0)
        walked_s = since_s - 0.5 * _START_S if since_s > _START_S else 0.5 * since_s * since_s / _START_S
        return self._path.length_m - speed * walked_s

    def _lane(self, s_m: float) -> Xy:
        left_m = self._plan.left_m
        after = min(max((self._plan.meeting_s_m - s_m - 0.5) / (oncoming.EXACT_LANE_M - 0.5), 0.0), 1.0)
        extra_m = max(_ROBOT_LANE_M - abs(left_m), 0.0) * after * after * (3.0 - 2.0 * after)
        return self._path.beside(s_m, math.copysign(abs(left_m) + extra_m, left_m))


def _move(state: FloatArray, dt_s: float, desired: Xy, speed_limit_m_s: float) -> None:
    """Step towards a position, within a speed limit."""
    x, y = state[:2].tolist()
    desired = limited_step((x, y), desired, speed_limit_m_s * dt_s)
    state[:] = (*desired, (desired[0] - x) / dt_s, (desired[1] - y) / dt_s)
