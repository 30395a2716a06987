"""Obstacle avoidance by the range finder."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.controllers.base import RobotParameters, stopping_speed
from pftrack_sim.controllers.moving_obstacles import MovingObstacles
from pftrack_sim.controllers.passing import pass_movers
from pftrack_sim.controllers.target_search import TargetSearch
from pftrack_sim.controllers.visual_servo import DISTANCE_S, TURN_S
from pftrack_sim.core.proprioception import RANGE_ANGLES_RAD, RANGES, beam_angles_rad
from pftrack_sim.core.records import Estimate
from pftrack_sim.core.types import BoolArray, FloatArray

HULL_M = 0.245  # Radius of the robot seen from above
MARGIN_M = 0.2  # Desired clearance beside the hull; a gap is open if it is wider than the hull with this on both sides
MIN_CLEARANCE_M = 0.06  # Clearance below which the robot does not drive on
PERSON_M, AHEAD_RAD = 0.7, math.radians(75.0)
"""Distance at which the robot stops before a mover, and angle off straight ahead from which on it ignores it."""
HORIZON_M = 2.2  # Obstacles farther than this are ignored: at 1.25 m/s they are almost two seconds ahead
TARGET_CLEAR_M = 0.7  # An obstacle this close in front of the target is the target
BRAKE_M_S2 = 0.8  # Deceleration for which the speed is chosen: two thirds of the base's greatest
REACTION_S = 0.15  # Delay of the brakes
HYSTERESIS_RAD = math.radians(25.0)  # A chosen side is kept unless the other is better by this
MEMORY_M = 12.0  # Scans are kept until the robot has driven this far: odometry drifts with distance, not with time

_TRAIL_STEP_M = 0.25
_PASSED_M = 0.4

_SCAN_M = 0.15  # A scan is kept whenever the robot has moved, or
_SCAN_RAD = math.radians(15.0)  # turned, this far since the last

_DIRECTIONS_RAD = np.deg2rad(np.linspace(-100.0, 100.0, 81))


class ObstacleAvoidance:
    """Changes forward speed and turn rate of another controller around obstacles; pan and tilt stay.

    A vector field histogram over the beams (Ulrich and Borenstein 1998, "VFH+: reliable obstacle avoidance for fast
    mobile robots", ICRA): a beam that ends at range d blocks the directions within asin((hull + margin) / d) of it. The
    open direction nearest to the pan angle is taken. The speed is such that the robot could stop before whatever its
    hull would hit straight ahead: v <= sqrt(2 a gap + (a t)^2) - a t, with deceleration a and reaction time t.

    Where the way to the target is blocked, the robot drives along the target's own trail, which is stored in the
    odometry frame: towards the latest point of it that the beams leave open (only if there is none, the open direction
    nearest to the target). It goes on until the direct way is open.

    What moves (`MovingObstacles`) blocks no direction: it is passed by where it will be (`pass_movers`). Where there is
    no way past, and while the target is lost, the robot stops `PERSON_M` before it and backs off from who is nearer.

    The range finder does not cover the back: backwards the same holds for the scans of the last `MEMORY_M`, stored in
    the odometry frame.
    """

    def __init__(self, inner: TargetSearch) -> None:
        self._inner = inner
        self.reset(RobotParameters())

    def reset(self, robot: RobotParameters) -> None:
        """See `Controller.reset`."""
        self._inner.reset(robot)
        self._robot, self._limits = robot, robot.limits
        self._beams: FloatArray = RANGE_ANGLES_RAD
        self._moving = MovingObstacles()
        self._detour_rad: float | None = None
        self._scans: deque[_Scan] = deque()
        self._trail: list[FloatArray] = []
        self._on_trail = False
        self._driven_m = 0.0
        self._last_m: FloatArray | None = None

    def act(self, estimate: Estimate, proprio: NDArray[Any]) -> FloatArray:
        """See `Controller.act`."""
        command = self._inner.act(estimate, proprio)
        forward, turn = float(command[0] * self._limits[0]), float(command[1] * self._limits[1])
        ranges = np.asarray(proprio[RANGES], dtype=np.float64)
        self._beams = beam_angles_rad(self._robot.beam_field_deg, len(ranges))
        pan = math.remainder(self._robot.gaze_rad(proprio)[0], 2.0 * math.pi)
        target = self._inner.distance_m
        reach = HORIZON_M if target is None else min(HORIZON_M, max(target - TARGET_CLEAR_M, HULL_M + MARGIN_M))
        goal = pan
        if self._inner.goal_m is not None:
            goal, goal_m = _polar(self._inner.goal_m, proprio)
            reach = min(HORIZON_M, max(goal_m, HULL_M + MARGIN_M))
        self._mark_trail(proprio, pan, target)
        if self._on_trail:
            forward = max(forward, self._inner.wanted_m_s)
        moving = self._moving.see(proprio, self._beams, self._robot.frame_s) & (np.abs(self._beams) < AHEAD_RAD)
        if target is not None:
            moving &= self._apart(ranges, target, pan) > TARGET_CLEAR_M
        if forward > 0.02:
            direction, forward = self._choose_way(goal, forward, np.where(moving, np.inf, ranges), reach, proprio)
            if direction is None:
                turn = math.copysign(0.5, turn if self._detour_rad is None else self._detour_rad)
            elif abs(math.remainder(direction - goal, 2.0 * math.pi)) > 1e-9:
                turn = direction / TURN_S
                forward = max(math.cos(direction), 0.0) * forward
            ahead, aside = ranges * np.cos(self._beams), np.abs(ranges * np.sin(self._beams))
            forward = min(forward, _safe_speed(ahead, aside))
        else:
            self._detour_rad, self._on_trail = None, False
        # While the target is lost it may be the one who comes.
        if moving.any() and (target is None or forward <= 0.02):
            room_m = float(ranges[moving].min()) - PERSON_M
            if target is None or room_m < 0.0:
                forward = min(forward, room_m / DISTANCE_S)
        self._remember(proprio, ranges, pan)
        if forward < 0.0:
            forward = max(forward, -_safe_speed(*self._behind(proprio)))
        changed = np.clip(np.array([forward, turn]) / self._limits[:2], -1.0, 1.0)
        return np.concatenate([changed, command[2:]])

    def _choose_way(
        self, goal_rad: float, speed_m_s: float, ranges: FloatArray, reach_m: float, proprio: NDArray[Any]
    ) -> tuple[float | None, float]:
        """Direction [rad], None if all are blocked, and speed [m/s]; `ranges` are those to what stands."""
        direction = self._choose_direction(goal_rad, ranges, reach_m, proprio)
        if direction is None:
            return None, 0.0
        places, velocities = self._moving.relative(proprio)
        if (target_m := self._inner.distance_m) is not None:
            pan, _ = self._robot.gaze_rad(proprio)
            aim = target_m * np.array([math.cos(pan), math.sin(pan)])
            others = np.hypot(*(places - aim).T) > TARGET_CLEAR_M
            places, velocities = places[others], velocities[others]
        if not len(places):
            return direction, speed_m_s
        open_rad = _DIRECTIONS_RAD[_open(_DIRECTIONS_RAD, self._beams, ranges, reach_m)]
        return pass_movers(direction, speed_m_s, open_rad, places, velocities)

    def _choose_direction(
        self, goal_rad: float, ranges: FloatArray, reach_m: float, proprio: NDArray[Any]
    ) -> float | None:
        """The goal [rad] if it is open, else the latest open point of the trail, else the open direction nearest to it.

        None if all are blocked.
        """
        unseen = self._on_trail and abs(goal_rad) > self._beams[-1]
        if not unseen and _open(np.array([goal_rad]), self._beams, ranges, reach_m)[0]:
            self._detour_rad, self._on_trail = None, False
            return goal_rad
        for direction, distance in (_polar(point, proprio) for point in reversed(self._trail)):
            # Behind the robot there are no beams: it turns round before it knows.
            if _open(np.array([direction]), self._beams, ranges, min(reach_m, distance + HULL_M))[0]:
                self._detour_rad, self._on_trail = direction, True
                return direction
        self._on_trail = False
        candidates = _DIRECTIONS_RAD[_open(_DIRECTIONS_RAD, self._beams, ranges, reach_m)]
        if not candidates.size:
            return None
        cost = np.abs(candidates - goal_rad)
        if self._detour_rad is not None:
            cost = cost + HYSTERESIS_RAD * (np.sign(candidates - goal_rad) != np.sign(self._detour_rad - goal_rad))
        self._detour_rad = float(candidates[np.argmin(cost)])
        return self._detour_rad

    def _mark_trail(self, proprio: NDArray[Any], pan_rad: float, target_m: float | None) -> None:
        """Add the target's position to its trail, and drop the part that the robot has passed."""
        x, y, heading = (float(value) for value in proprio[:3])
        if target_m is not None:
            angle = heading + pan_rad
            point = np.array([x + target_m * math.cos(angle), y + target_m * math.sin(angle)])
            if not self._trail or np.hypot(*(point - self._trail[-1])) > _TRAIL_STEP_M:
                self._trail.append(point)
        if self._trail:
            away = np.hypot(*(np.array(self._trail) - (x, y)).T)
            nearest = int(np.argmin(away))
            # A point is passed when the robot has been near it, or nearer to a later one.
            self._trail = self._trail[nearest + int(away[nearest] < _PASSED_M) :]

    def _remember(self, proprio: NDArray[Any], ranges: FloatArray, pan_rad: float) -> None:
        """Store the end points of the beams in the odometry frame, without the target: it walks on."""
        x, y, heading = (float(value) for value in proprio[:3])
        position = np.array([x, y])
        self._driven_m += 0.0 if self._last_m is None else float(np.hypot(*(position - self._last_m)))
        self._last_m = position
        hits = ranges < self._robot.range_m
        target_m = self._inner.distance_m
        if target_m is not None:
            hits &= self._apart(ranges, target_m, pan_rad) > TARGET_CLEAR_M
        angles = heading + self._beams[hits]
        points = np.stack([x + ranges[hits] * np.cos(angles), y + ranges[hits] * np.sin(angles)])
        # While the robot hardly moves, the newest scan replaces the last one, as people move on.
        if len(self._scans) > 1 and self._scans[-1].is_near(self._scans[-2]):
            self._scans.pop()
        self._scans.append(_Scan(self._driven_m, heading, points))
        while self._scans[0].driven_m < self._driven_m - MEMORY_M:
            self._scans.popleft()

    def _apart(self, ranges: FloatArray, distance_m: float, bearing_rad: float) -> FloatArray:
        """`(B,)` distances of the ends of the beams from a point [m]."""
        ahead = ranges * np.cos(self._beams) - distance_m * math.cos(bearing_rad)
        return np.hypot(ahead, ranges * np.sin(self._beams) - distance_m * math.sin(bearing_rad))

    def _behind(self, proprio: NDArray[Any]) -> tuple[FloatArray, FloatArray]:
        """`(N,)` distances behind the axle and `(N,)` lateral distances of the stored points there [m]."""
        x, y, heading = (float(value) for value in proprio[:3])
        dx, dy = np.concatenate([scan.points_m for scan in self._scans], axis=1) - np.array([[x], [y]])
        behind = -(dx * math.cos(heading) + dy * math.sin(heading))
        aside = np.abs(dy * math.cos(heading) - dx * math.sin(heading))
        return behind[behind > 0.0], aside[behind > 0.0]


@dataclass(frozen=True)
class _Scan:
    driven_m: float
    heading_rad: float
    points_m: FloatArray  # (2, N) in the odometry frame

    def is_near(self, other: _Scan) -> bool:
        """Whether the robot has hardly moved between the two."""
        turned = math.remainder(self.heading_rad - other.heading_rad, 2.0 * math.pi)
        return abs(self.driven_m - other.driven_m) < _SCAN_M and abs(turned) < _SCAN_RAD


def _polar(point_m: FloatArray, proprio: NDArray[Any]) -> tuple[float, float]:
    """Direction [rad] in the frame of the chassis, and distance [m], of a point of the odometry frame."""
    x, y, heading = (float(value) for value in proprio[:3])
    dx, dy = float(point_m[0]) - x, float(point_m[1]) - y
    return math.remainder(math.atan2(dy, dx) - heading, 2.0 * math.pi), math.hypot(dx, dy)


def _open(directions_rad: FloatArray, beams: FloatArray, ranges: FloatArray, reach_m: float) -> BoolArray:
    """Which of the `(N,)` directions no beam within reach blocks."""
    near = ranges < reach_m
    blocked_rad = np.arcsin(np.minimum((HULL_M + MARGIN_M) / np.maximum(ranges[near], 1e-3), 1.0))
    blocked = np.abs(beams[near] - directions_rad[:, None]) < blocked_rad
    return ~np.any(blocked, axis=1)


def _safe_speed(ahead: FloatArray, aside: FloatArray) -> float:
    """Greatest speed [m/s] from which the robot stops before its hull hits a point.

    `(N,)` points are given by their distance from the axle along the direction of travel and beside it [m].
    """
    radius = HULL_M + MIN_CLEARANCE_M
    hit = aside < radius
    if not hit.any():
        return math.inf
    # The round hull touches a point off its middle line later.
    gap = float((ahead[hit] - np.sqrt(radius**2 - aside[hit] ** 2)).min())
    return stopping_speed(gap, BRAKE_M_S2, REACTION_S)
