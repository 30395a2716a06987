"""Pedestrians with a scripted part: they cross the line of sight or pass the target, and are reactive before and after.

The script is followed in phase `SCRIPTED` only; in the other phases the pedestrian is one of the reactive ones.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum, auto

import numpy as np

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians import avoidance, oncoming
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap, Xy, limited_step, outside_circle
from pftrack_sim.agents.pedestrians.occlusion_trajectory import Crossing, OcclusionTrajectory
from pftrack_sim.core.types import FloatArray

CROSSING_SPEED_LIMIT_M_S = 2.8
"""A crossing pedestrian that would have to be faster is late."""

_CROSSING_TARGET_DISTANCE_M = 0.55
_CROSSING_ROBOT_DISTANCE_M = 0.7
"""Least distances on the way to and from the crossing."""

_ONCOMING_SPEED_LIMIT_M_S = 2.4
_ONCOMING_ROBOT_DISTANCE_M = 0.75
_ROBOT_LANE_M = 1.0
"""Least offset from the target's path after the pass, where a robot may follow."""

_START_S = 1.0
"""Time in which an oncoming pedestrian takes up its speed."""

_DETOUR = 1.3
"""Assumed length of a route relative to the straight line."""


class Phase(Enum):
    """Phases of a scripted pedestrian, in their order."""

    WAITING = auto()
    """Stays at its waiting place."""
    APPROACHING = auto()
    """Walks a route to where its script begins."""
    SCRIPTED = auto()
    """Follows its script."""
    RELEASED = auto()
    """Walks to goals of its own."""


class CrossingPedestrian:
    """A pedestrian that covers the line of sight from the camera to the target once.

    Args:
        crossing: Time and place of the crossing.
        obstacles: Obstacle map of the place.

    Attributes:
        phase: `WAITING`, `SCRIPTED` or `RELEASED`.
    """

    def __init__(self, crossing: Crossing, obstacles: ObstacleMap) -> None:
        self.crossing = crossing
        self._obstacles = obstacles
        self.reset()

    def reset(self) -> None:
        """Return to the waiting phase."""
        self.phase = Phase.WAITING
        self._trajectory = OcclusionTrajectory(self.crossing)
        self._updates = 0

    def update(
        self, dt_s: float, time_s: float, state: FloatArray, camera_m: Xy, target_m: Xy, robot_m: Sequence[float]
    ) -> None:
        """Advance the phase and, where scripted, the state by one tick.

        Args:
            dt_s: Length of the tick.
            time_s: Time at its end.
            state: `(4,)` x, y [m], vx, vy [m/s] of the pedestrian.
            camera_m: Camera on the ground at the end of the tick.
            target_m: Target then.
            robot_m: Robot then.
        """
        if self.phase is Phase.RELEASED:
            return
        self._updates += 1
        crossing, trajectory = self.crossing, self._trajectory
        x, y, vx, vy = state.tolist()
        trajectory.update(dt_s, time_s, camera_m, target_m)
        if self.phase is Phase.WAITING:
            if time_s < crossing.at_s - crossing.lead_s:
                return
            # A pedestrian that starts with the episode is already walking.
            trajectory.begin(dt_s, time_s, (x, y), None if self._updates <= 2 else (vx, vy))
            self.phase = Phase.SCRIPTED
        there = trajectory.position(time_s)
        if not crossing.at_s <= time_s <= crossing.until_s:
            around = outside_circle(there, target_m, _CROSSING_TARGET_DISTANCE_M)
            around = outside_circle(around, robot_m, _CROSSING_ROBOT_DISTANCE_M)
            if time_s > crossing.until_s and dt_s > 0.0:
                # After the cover its timing does not matter: it is released as soon as anything is in its way.
                distances = self._obstacles.distances(state[:2, None])
                velocity = np.array([[(there[0] - x) / dt_s], [(there[1] - y) / dt_s]])
                if around != there or avoidance.wall_barrier_active(*distances, velocity):
                    self.phase = Phase.RELEASED
                    return
            there = self._obstacles.pushed_out(around, avoidance.WALL_DISTANCE_M)
            if trajectory.finished(time_s):
                self.phase = Phase.RELEASED
                return
        _move(state, dt_s, there, CROSSING_SPEED_LIMIT_M_S)


class OncomingPedestrian:
    """A pedestrian that passes the target once.

    Args:
        oncoming_pass: Time and place of the pass.
        path: Path of the target.
        obstacles: Obstacle map of the place.

    Attributes:
        phase: `WAITING` and `APPROACHING` only with a waiting place; then `SCRIPTED`, `RELEASED`.
        joining_m: `(2,)` position at which it joins the path after waiting.
    """

    def __init__(self, oncoming_pass: oncoming.OncomingPass, path: Path, obstacles: ObstacleMap) -> None:
        self._pass, self._path, self._obstacles = oncoming_pass, path, obstacles
        speed, waiting_m = oncoming_pass.speed_m_s, oncoming_pass.waiting_m
        self.speed_m_s = speed
        joining = oncoming.lane_position(path, oncoming_pass.meeting_s_m + oncoming.JOINING_M, oncoming_pass.left_m)
        self.joining_m = np.array(joining)
        self._joining_s = self._leaving_s = -math.inf
        if waiting_m is not None:
            self._joining_s = oncoming_pass.at_s - oncoming.JOINING_M / speed
            route_m = _DETOUR * math.hypot(joining[0] - waiting_m[0], joining[1] - waiting_m[1])
            self._leaving_s = self._joining_s - route_m / speed - _START_S
        self.phase = Phase.SCRIPTED

    def reset(self) -> tuple[tuple[float, float, float, float], float]:
        """Return to the start; gives x, y [m], vx, vy [m/s] and the heading [rad] there."""
        if self._pass.waiting_m is not None:
            self.phase = Phase.WAITING
            x, y = self._pass.waiting_m
            return (x, y, 0.0, 0.0), math.atan2(self.joining_m[1] - y, self.joining_m[0] - x)
        self.phase = Phase.SCRIPTED
        s = self._s_m(0.0)
        heading = float(self._path.at(s)[2]) + math.pi
        x, y = self._obstacles.pushed_out(self._lane(s), oncoming.WALL_DISTANCE_M)
        speed = (s - self._s_m(1e-3)) / 1e-3
        return (x, y, speed * math.cos(heading), speed * math.sin(heading)), heading

    def update(self, dt_s: float, time_s: float, state: FloatArray, target_m: Xy, robot_m: Sequence[float]) -> None:
        """Advance the phase and, where scripted, the state by one tick; arguments as in `CrossingPedestrian`."""
        if self.phase is Phase.RELEASED:
            return
        if time_s < self._joining_s:
            if self.phase is Phase.WAITING and time_s >= self._leaving_s:
                self.phase = Phase.APPROACHING
            return
        self.phase = Phase.SCRIPTED
        s, meeting = self._s_m(time_s), self._pass.meeting_s_m
        if s < meeting - 6.0 or s < -2.0:
            self.phase = Phase.RELEASED
            return
        there = self._lane(s)
        if abs(s - meeting) > oncoming.EXACT_LANE_M:
            there = self._obstacles.pushed_out(there, oncoming.WALL_DISTANCE_M)
            there = outside_circle(there, target_m, abs(self._pass.left_m))
        there = outside_circle(there, robot_m, _ONCOMING_ROBOT_DISTANCE_M)
        _move(state, dt_s, there, _ONCOMING_SPEED_LIMIT_M_S)

    def _s_m(self, time_s: float) -> float:
        """Arc length on the target's path [m], falling with time."""
        speed, at_s, meeting = self._pass.speed_m_s, self._pass.at_s, self._pass.meeting_s_m
        begin_s = at_s - ((self._path.length_m - meeting) / speed + 0.5 * _START_S)
        if begin_s <= 0.0 or self._pass.waiting_m is not None:
            return meeting + speed * (at_s - time_s)
        # The path is too short to walk from the start of the episode: stand at its end, then take up speed.
        since_s = max(time_s - begin_s, 0.0)
        walked_s = since_s - 0.5 * _START_S if since_s > _START_S else 0.5 * since_s * since_s / _START_S
        return self._path.length_m - speed * walked_s

    def _lane(self, s_m: float) -> Xy:
        left_m = self._pass.left_m
        after = (self._pass.meeting_s_m - s_m - 0.5) / (oncoming.EXACT_LANE_M - 0.5)
        after = min(max(after, 0.0), 1.0)
        extra_m = max(_ROBOT_LANE_M - abs(left_m), 0.0) * after * after * (3.0 - 2.0 * after)
        return oncoming.lane_position(self._path, s_m, math.copysign(abs(left_m) + extra_m, left_m))


def _move(state: FloatArray, dt_s: float, there: Xy, speed_limit_m_s: float) -> None:
    """Step from the `(4,)` state towards a position, within a speed limit."""
    x, y = state[:2].tolist()
    there = limited_step((x, y), there, speed_limit_m_s * dt_s)
    if dt_s > 0.0:
        state[2:] = ((there[0] - x) / dt_s, (there[1] - y) / dt_s)
    state[:2] = there
