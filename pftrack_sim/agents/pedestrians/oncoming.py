"""Oncoming pedestrians: they walk against the target's direction and pass it at a given time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.crossing import Phase, Surroundings, outside_circle, step_towards
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap, Xy
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray

_EXACT_LANE_M = 2.0  # Within this distance along the path from the meeting point, the lane is kept exactly.
_WALL_DISTANCE_M = 0.34
_JOINING_M = 5.0  # Distance before the meeting point at which a waiting pedestrian joins the path.
_MAX_APPROACH_M = 20.0  # With a longer approach it waits aside first: on laps it would meet the target before.
_MIN_WALL_DISTANCE_M = 0.22
_ONCOMING_SPEED_LIMIT_M_S = 2.4
_ONCOMING_ROBOT_DISTANCE_M = 0.75
_ROBOT_LANE_M = 1.0  # Least offset from the target's path after the pass, where a robot may follow.
_START_S = 1.0  # Time of taking up the walking speed.
_DETOUR = 1.3  # Assumed length of a route relative to the straight line.


@dataclass(frozen=True)
class OncomingPass:
    """One pass of the target.

    Attributes:
        meeting_s_m: Arc length of the target on its path then.
        left_m: Offset of the pedestrian to the left of the path; negative is right.
        waiting_m: Waiting position away from the path; None for a pedestrian that is on the path from the start.
    """

    at_s: float
    meeting_s_m: float
    left_m: float
    speed_m_s: float
    waiting_m: Xy | None = None


def plan_oncoming_pass(
    at_s: float,
    meeting_s_m: float,
    distance_m: float,
    speed_m_s: float,
    path: Path,
    obstacles: ObstacleMap,
    side: int,
    name: str,
    waiting_positions_m: ArrayLike = (),
) -> OncomingPass:
    """Plan a pass at `distance_m` from the target, on the side with more room.

    At `at_s` the target is at the arc length `meeting_s_m` of its path. `side` is the preferred side: 1 is left of the
    path, -1 right. `waiting_positions_m` are `(N, 2)` free positions away from the path.

    Raises:
        ParameterError: There is no room on either side.
    """
    x, y, heading = path.at(np.linspace(meeting_s_m - _EXACT_LANE_M, meeting_s_m + _EXACT_LANE_M, 21))
    room: dict[int, float] = {}
    for sign in (side, -side):
        left = sign * distance_m
        lane = np.stack([x - left * np.sin(heading), y + left * np.cos(heading)], axis=1)
        room[sign] = float(obstacles.clearance_m(lane)[5:16].min())
    best = max(room, key=lambda sign: min(room[sign], _WALL_DISTANCE_M))
    if room[best] < _MIN_WALL_DISTANCE_M:
        raise ParameterError(
            f"{name}: no pedestrian can pass the target at {distance_m:g} m at {at_s:g} s, because of obstacles on "
            "both sides; use another time or a smaller distance_m"
        )
    left_m, waiting_m = best * distance_m, None
    positions = np.array(waiting_positions_m, dtype=np.float64).reshape(-1, 2)
    if min(path.length_m - meeting_s_m, speed_m_s * at_s) > _MAX_APPROACH_M and len(positions):
        joining = np.array(path.beside(meeting_s_m + _JOINING_M, left_m))
        waiting_x, waiting_y = positions[np.argmin(np.hypot(*(positions - joining).T))].tolist()
        waiting_m = (waiting_x, waiting_y)
    return OncomingPass(at_s, meeting_s_m, left_m, speed_m_s, waiting_m)


class OncomingPedestrian:
    """A pedestrian that passes the target once, on the target's path.

    Attributes:
        heading_rad: Heading at the start.
        joining_m: x, y of the point at which it joins the path after waiting [m].
    """

    def __init__(self, plan: OncomingPass, path: Path, obstacles: ObstacleMap, state: FloatArray) -> None:
        self.state = state
        self._plan, self._path, self._obstacles = plan, path, obstacles
        self.speed_m_s = plan.speed_m_s
        self.joining_m = path.beside(plan.meeting_s_m + _JOINING_M, plan.left_m)
        self._leaving_s = self._joining_s = -math.inf
        if plan.waiting_m is not None:
            (x, y), (waiting_x, waiting_y) = self.joining_m, plan.waiting_m
            self._joining_s = plan.at_s - _JOINING_M / plan.speed_m_s
            route_m = _DETOUR * math.hypot(x - waiting_x, y - waiting_y)
            self._leaving_s = self._joining_s - route_m / plan.speed_m_s - _START_S
            self.phase = Phase.WAITING
            self.heading_rad = math.atan2(y - waiting_y, x - waiting_x)
            state[:] = (waiting_x, waiting_y, 0.0, 0.0)
            return
        self.phase = Phase.SCRIPTED
        s = self._s_m(0.0)
        self.heading_rad = heading = path.pose(s)[2] + math.pi
        speed = (s - self._s_m(1e-3)) / 1e-3
        position = obstacles.pushed_out(self._lane(s), _WALL_DISTANCE_M)
        state[:] = (*position, speed * math.cos(heading), speed * math.sin(heading))

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
        if abs(s - meeting) > _EXACT_LANE_M:
            desired = self._obstacles.pushed_out(desired, _WALL_DISTANCE_M)
            desired = around.off_target(desired, abs(self._plan.left_m))
        desired = outside_circle(desired, around.robot_m, _ONCOMING_ROBOT_DISTANCE_M)
        step_towards(self.state, dt_s, desired, _ONCOMING_SPEED_LIMIT_M_S)

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
        after = min(max((self._plan.meeting_s_m - s_m - 0.5) / (_EXACT_LANE_M - 0.5), 0.0), 1.0)
        extra_m = max(_ROBOT_LANE_M - abs(left_m), 0.0) * after * after * (3.0 - 2.0 * after)
        return self._path.beside(s_m, math.copysign(abs(left_m) + extra_m, left_m))
