"""Go around what stands in the way, by the range finder."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.controllers.base import RobotParameters
from pftrack_sim.controllers.servo import TURN_S
from pftrack_sim.core.proprioception import PROPRIO_INDEX, RANGE_ANGLES_RAD, RANGE_M, RANGES
from pftrack_sim.core.records import Estimate

HULL_M = 0.245
"""Radius of the robot seen from above."""

MARGIN_M = 0.2
"""Free space wanted beside the hull; a gap is a way through if it is wider than the hull with this on both sides."""

TIGHT_M = 0.06
"""Free space below which the robot does not drive on."""

HORIZON_M = 2.2
"""Things farther than this do not change the way: at 1.25 m/s they are almost two seconds ahead."""

TARGET_CLEAR_M = 0.7
"""What stands this close before the target is the target."""

BRAKE_M_S2 = 0.8
"""Deceleration the speed is chosen for: two thirds of what the base can."""

REACT_S = 0.15
"""Time until the brakes bite."""

COMMIT_RAD = math.radians(25.0)
"""A way once chosen is kept unless another is better by this: no dithering before a post."""

MEMORY_M = 12.0
"""What was seen is remembered until the robot has driven so far: odometry drifts with the way, not with time."""

_SCAN_M = 0.15
_SCAN_RAD = math.radians(15.0)
"""A scan is kept whenever the robot has moved or turned this far since the last."""

_DIRECTIONS_RAD = np.deg2rad(np.linspace(-100.0, 100.0, 81))


class Follower(Protocol):
    """A controller that says how far the target is."""

    @property
    def distance_m(self) -> float | None:
        """To the target; None while it is lost."""
        ...

    def reset(self, rig: RobotParameters) -> None:
        """See `Controller.reset`."""
        ...

    def act(self, estimate: Estimate, proprio: NDArray[Any]) -> NDArray[np.float64]:
        """See `Controller.act`."""
        ...


class Avoiding:
    """Bends the way of another controller around obstacles; head and gaze stay its own.

    A vector field histogram over the beams (Ulrich and Borenstein 1998, "VFH+: reliable obstacle avoidance for fast
    mobile robots", ICRA): every beam that meets something at range d bars the directions within
    asin((hull + margin) / d) of it. Of the open directions the one nearest to where the inner controller wants to go is
    taken, which is where the head looks. The speed is such that the robot could stop before whatever its hull would
    meet straight ahead: v <= sqrt(2 a gap + (a t)^2) - a t, with the braking a and the time t until it begins.

    There are no eyes at the back: going backwards, the same holds for what was seen over the last `MEMORY_M`,
    remembered in the frame of the odometry.

    Args:
        inner: Wants to go somewhere.
    """

    def __init__(self, inner: Follower) -> None:
        self._inner = inner
        self.reset(RobotParameters())

    def reset(self, rig: RobotParameters) -> None:
        """Forget the way chosen last; see `Controller.reset`."""
        self._inner.reset(rig)
        self._limits = rig.limits
        self._way_rad: float | None = None
        self._scans: deque[_Scan] = deque()
        self._driven_m = 0.0
        self._last_m: NDArray[np.float64] | None = None

    def act(self, estimate: Estimate, proprio: NDArray[Any]) -> NDArray[np.float64]:
        """The inner controller's command, its forward speed and turn rate bent; see `Controller.act`."""
        command = self._inner.act(estimate, proprio)
        forward = float(command[0] * self._limits[0])
        ranges = np.asarray(proprio[RANGES], dtype=np.float64)
        pan = math.remainder(float(proprio[PROPRIO_INDEX["pan_rad"]]), 2.0 * math.pi)
        target = self._inner.distance_m
        reach = HORIZON_M if target is None else min(HORIZON_M, max(target - TARGET_CLEAR_M, HULL_M + MARGIN_M))
        turn = float(command[1] * self._limits[1])
        if forward > 0.02:
            way = self._choose(pan, ranges, reach)
            if way is None:
                forward, turn = 0.0, math.copysign(0.5, turn if self._way_rad is None else self._way_rad)
            elif abs(math.remainder(way - pan, 2.0 * math.pi)) > 1e-9:
                turn = way / TURN_S
                bend = math.cos(way)
                forward = max(bend, 0.0) * forward
            forward = min(forward, _safe_speed(*_ahead(ranges)))
        else:
            self._way_rad = None
        self._remember(proprio, ranges)
        if forward < 0.0:
            forward = max(forward, -_safe_speed(*self._behind(proprio)))
        bent = np.clip(np.array([forward, turn]) / self._limits[:2], -1.0, 1.0)
        return np.concatenate([bent, command[2:]])

    def _choose(self, goal_rad: float, ranges: NDArray[np.float64], reach_m: float) -> float | None:
        """The open direction nearest to the goal [rad]; the goal itself when it is open; None when none is."""
        if _clear(np.array([goal_rad]), ranges, reach_m)[0]:
            self._way_rad = None
            return goal_rad
        ways = _DIRECTIONS_RAD[_clear(_DIRECTIONS_RAD, ranges, reach_m)]
        if not ways.size:
            return None
        cost = np.abs(ways - goal_rad)
        if self._way_rad is not None:
            cost = cost + COMMIT_RAD * (np.sign(ways - goal_rad) != np.sign(self._way_rad - goal_rad))
        self._way_rad = float(ways[np.argmin(cost)])
        return self._way_rad

    def _remember(self, proprio: NDArray[Any], ranges: NDArray[np.float64]) -> None:
        """Keep where the beams met something, in the frame of the odometry."""
        x, y, heading = (float(one) for one in proprio[:3])
        place = np.array([x, y])
        self._driven_m += 0.0 if self._last_m is None else float(np.hypot(*(place - self._last_m)))
        self._last_m = place
        met = ranges < RANGE_M
        at = heading + RANGE_ANGLES_RAD[met]
        points = np.stack([x + ranges[met] * np.cos(at), y + ranges[met] * np.sin(at)])
        # While the robot hardly moves, the newest scan takes the place of the one before: people walk on.
        if len(self._scans) > 1 and self._scans[-1].is_near(self._scans[-2]):
            self._scans.pop()
        self._scans.append(_Scan(self._driven_m, heading, points))
        while self._scans[0].driven_m < self._driven_m - MEMORY_M:
            self._scans.popleft()

    def _behind(self, proprio: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """How far behind the axle, and how far aside, what is remembered there lies [m]."""
        x, y, heading = (float(one) for one in proprio[:3])
        dx, dy = np.concatenate([scan.points_m for scan in self._scans], axis=1) - np.array([[x], [y]])
        back = -(dx * math.cos(heading) + dy * math.sin(heading))
        aside = np.abs(dy * math.cos(heading) - dx * math.sin(heading))
        return back[back > 0.0], aside[back > 0.0]


@dataclass(frozen=True)
class _Scan:
    driven_m: float
    heading_rad: float
    points_m: NDArray[np.float64]  # (2, N) in the frame of the odometry

    def is_near(self, other: _Scan) -> bool:
        """Whether the robot has hardly moved from one to the other."""
        turned = math.remainder(self.heading_rad - other.heading_rad, 2.0 * math.pi)
        return abs(self.driven_m - other.driven_m) < _SCAN_M and abs(turned) < _SCAN_RAD


def _ahead(ranges: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How far ahead of the axle, and how far aside, the beams end [m]."""
    return ranges * np.cos(RANGE_ANGLES_RAD), np.abs(ranges * np.sin(RANGE_ANGLES_RAD))


def _clear(ways_rad: NDArray[np.float64], ranges: NDArray[np.float64], reach_m: float) -> NDArray[np.bool_]:
    """Which of the directions `(N,)` are not barred by anything within reach."""
    near = ranges < reach_m
    bars = np.arcsin(np.minimum((HULL_M + MARGIN_M) / np.maximum(ranges[near], 1e-3), 1.0))
    barred = np.abs(RANGE_ANGLES_RAD[near] - ways_rad[:, None]) < bars
    return ~np.any(barred, axis=1)


def _safe_speed(ahead: NDArray[np.float64], aside: NDArray[np.float64]) -> float:
    """The fastest from which the robot stops before what its hull would meet [m/s].

    Args:
        ahead: `(N,)` along the way, from the axle [m].
        aside: `(N,)` off the way [m].
    """
    wide = HULL_M + TIGHT_M
    meets = aside < wide
    if not meets.any():
        return math.inf
    # Where the round hull touches a point that is off its middle line.
    gap = float((ahead[meets] - np.sqrt(wide**2 - aside[meets] ** 2)).min())
    late = BRAKE_M_S2 * REACT_S
    return math.sqrt(2.0 * BRAKE_M_S2 * max(gap, 0.0) + late * late) - late
