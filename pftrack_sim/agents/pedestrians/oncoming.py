"""People who come along the target's way and pass close by it at a given time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.crossing import Xy, outside, within
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.core.errors import ParameterError

Array = NDArray[np.float64]

NEAR_M = 2.0
"""This near to the passing, along the way, the passer keeps its lane to the centimetre."""

ROBOT_LANE_M = 1.0
"""Past the target it keeps at least this far from the target's line: a robot may come along it."""

FAR_M = 20.0
"""One whose way along the path would be longer than this waits aside first: on laps it would meet the target before."""

JOIN_M = 5.0
"""From there it comes onto the path this far ahead of the passing ..."""

ASIDE_M = 8.0
"""... and there it is this far from the path: seen from a robot beside the target, it is small."""

_LIMIT_M_S = 2.4
_START_S = 1.0
_WALL_GAP_M = 0.34
_GRID_M = 2.5
_DETOUR = 1.3
_LEAST_GAP_M = 0.22


@dataclass(frozen=True)
class OncomingPass:
    """What one passer does: it walks against the target's direction, beside the target's path.

    Attributes:
        at_s: When it is nearest to the target.
        meets_at_m: Where the target then is, along its path.
        left_m: Its place to the left of the path when it passes; negative is to the right.
        speed_m_s: How fast it walks.
        waiting_m: Where it waits until it is time, away from the path; None for one that comes all along the path.
    """

    at_s: float
    meets_at_m: float
    left_m: float
    speed_m_s: float
    waiting_m: Xy | None = None


def plan_oncoming_pass(
    at_s: float,
    distance_m: float,
    speed_m_s: float,
    path: Path,
    ground: ObstacleMap,
    target_s_at: Callable[[float], float],
    side: int,
    name: str,
    asides_m: ArrayLike = (),
) -> OncomingPass:
    """Choose the side on which there is room.

    Args:
        at_s: When it should be nearest to the target.
        distance_m: How near.
        speed_m_s: How fast it walks.
        path: The target's.
        ground: What stands where.
        target_s_at: How far along its path the target is at a time.
        side: Side that is preferred: 1 is left of the target's path, -1 right.
        name: What to call it in an error.
        asides_m: `(N, 2)` places away from the path where nobody waits yet.

    Raises:
        ParameterError: There is no room on either side.
    """
    meets = target_s_at(at_s)
    along = np.linspace(meets - NEAR_M, meets + NEAR_M, 21)
    x, y, heading = path.at(along)
    rooms: dict[int, float] = {}
    for one in (side, -side):
        left = one * distance_m
        lane = np.stack([x - left * np.sin(heading), y + left * np.cos(heading)], axis=1)
        rooms[one] = float(ground.clearance_m(lane)[5:16].min())
    best = max(rooms, key=lambda one: min(rooms[one], _WALL_GAP_M))
    if rooms[best] < _LEAST_GAP_M:
        raise ParameterError(
            f"{name}: nobody can pass the target {distance_m:g} m away at {at_s:g} s: something stands there on both "
            "sides; use another time or a smaller distance_m"
        )
    found = OncomingPass(at_s, meets, best * distance_m, speed_m_s)
    if min(path.length_m - meets, speed_m_s * at_s) <= FAR_M:
        return found
    join = np.array(lane_m(path, meets + JOIN_M, found.left_m))
    places = np.array(asides_m, dtype=np.float64).reshape(-1, 2)
    if not len(places):
        return found
    x, y = places[np.argmin(np.hypot(*(places - join).T))].tolist()
    return replace(found, waiting_m=(x, y))


def positions_away_from(path: Path, ground: ObstacleMap, bounds_m: tuple[float, float, float, float]) -> Array:
    """`(N, 2)` free places on a grid over the walkable area that are at least `ASIDE_M` from a path [m]."""
    x_min, y_min, x_max, y_max = bounds_m
    across, along = np.arange(x_min + 1.0, x_max, _GRID_M), np.arange(y_min + 1.0, y_max, _GRID_M)
    places = np.stack(np.meshgrid(across, along), axis=-1).reshape(-1, 2)
    x, y, _ = path.at(np.arange(0.0, path.length_m, 0.5))
    gap = np.hypot(places[:, :1] - x, places[:, 1:] - y).min(axis=1)
    return places[(gap >= ASIDE_M) & (ground.clearance_m(places) >= 2.0 * _WALL_GAP_M)]


def lane_m(path: Path, s_m: float, left_m: float) -> Xy:
    """The point to the left of a path."""
    x, y, heading = (float(v) for v in path.at(s_m))
    return x - left_m * math.sin(heading), y + left_m * math.cos(heading)


class OncomingPedestrians:
    """The passers of one episode.

    Args:
        passings: What each one does.
        path: The target's.
        ground: What stands where.

    Attributes:
        state: `(4, K)` x, y [m] and velocity [m/s].
        heading_rad: `(K,)` where they face.
    """

    def __init__(self, passings: Sequence[OncomingPass], path: Path, ground: ObstacleMap) -> None:
        self.passings = tuple(passings)
        self._path = path
        self._ground = ground
        self.reset()

    def reset(self) -> None:
        """Back to where they come from."""
        count = len(self.passings)
        self.state: Array = np.zeros((4, count))
        self.heading_rad: Array = np.zeros(count)
        for index, one in enumerate(self.passings):
            if one.waiting_m is not None:
                x, y = self._joins_m(one)
                self.heading_rad[index] = math.atan2(y - one.waiting_m[1], x - one.waiting_m[0])
                self.state[:2, index] = one.waiting_m
                continue
            s = self._s_m(one, 0.0)
            _, _, heading = self._path.at(s)
            x, y = self._ground.outside(self._lane(one, s), _WALL_GAP_M)
            walked = (self._s_m(one, 0.0) - self._s_m(one, 1e-3)) / 1e-3
            back = float(heading) + math.pi
            self.heading_rad[index] = back
            self.state[:, index] = (x, y, walked * math.cos(back), walked * math.sin(back))

    def waits(self, index: int, time_s: float) -> bool:
        """Whether a passer is still to come onto the path."""
        one = self.passings[index]
        return one.waiting_m is not None and time_s < self._joins_s(one)

    def comes_to_m(self, index: int, time_s: float) -> Array | None:
        """`(2,)` where one that waits comes onto the path, once it is time to set off for there."""
        one = self.passings[index]
        if one.waiting_m is None:
            return None
        x, y = self._joins_m(one)
        way_m = _DETOUR * math.hypot(x - one.waiting_m[0], y - one.waiting_m[1])
        return np.array([x, y]) if time_s >= self._joins_s(one) - way_m / one.speed_m_s - _START_S else None

    def advance(
        self, index: int, dt_s: float, time_s: float, here: Xy, target: Sequence[float], robot: Sequence[float]
    ) -> tuple[Xy, bool]:
        """Where a passer goes from `here` in one tick, and whether it is done with passing.

        Args:
            index: Which one.
            dt_s: Length of the tick.
            time_s: Time at its end.
            here: Where it is.
            target: x, y of the target.
            robot: x, y of the robot.
        """
        one = self.passings[index]
        s = self._s_m(one, time_s)
        there = self._lane(one, s)
        if abs(s - one.meets_at_m) > NEAR_M:
            there = self._ground.outside(there, _WALL_GAP_M)
            there = outside(there, target, abs(one.left_m))
        there = outside(there, robot, 0.75)
        done = s < one.meets_at_m - 6.0 or s < -2.0
        return within(here, there, _LIMIT_M_S * dt_s), done

    def _s_m(self, one: OncomingPass, time_s: float) -> float:
        """How far along the target's path, counted as the target does: it falls."""
        reach = self._path.length_m - one.meets_at_m
        whole_s = reach / one.speed_m_s + 0.5 * _START_S
        begin_s = one.at_s - whole_s
        if begin_s <= 0.0 or one.waiting_m is not None:
            return one.meets_at_m + one.speed_m_s * (one.at_s - time_s)
        # One whose way is longer than the path waits at the path's end, and sets off in a second.
        since = max(time_s - begin_s, 0.0)
        walked = since - 0.5 * _START_S if since > _START_S else 0.5 * since * since / _START_S
        return self._path.length_m - one.speed_m_s * walked

    def _joins_s(self, one: OncomingPass) -> float:
        return one.at_s - JOIN_M / one.speed_m_s

    def _joins_m(self, one: OncomingPass) -> Xy:
        return lane_m(self._path, one.meets_at_m + JOIN_M, one.left_m)

    def _lane(self, one: OncomingPass, s_m: float) -> Xy:
        past = min(max((one.meets_at_m - s_m - 0.5) / (NEAR_M - 0.5), 0.0), 1.0)
        room = max(ROBOT_LANE_M - abs(one.left_m), 0.0) * past * past * (3.0 - 2.0 * past)
        return lane_m(self._path, s_m, math.copysign(abs(one.left_m) + room, one.left_m))
