"""Where the members of groups are: they stand in a ring, sit side by side, walk abreast, or walk with the target."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from pftrack_sim.agents.gait.posture import PLAIN, Posture
from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.target import hands_on_thighs
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.people import Companions, Group, Seated, Standing, Walking

_RING_M = (0.45, 0.5, 0.62, 0.75)  # Radius of a ring by the number of people in it
_ABREAST_M, _LAG_M = 0.66, 0.15  # Between two who walk side by side
_SEAT_SHARE_M = 0.62  # Between two on one bench
_STOPPING_M_S2 = 0.8
_TURN_RAD_S = 2.2
_STANDS_M_S = 0.12  # A companion slower than this looks at the target


class Stance(NamedTuple):
    """Position x, y [m], and heading [rad] and posture, where they do not follow from the motion."""

    x_m: float
    y_m: float
    heading_rad: float | None = None
    posture: Posture = PLAIN


Place: TypeAlias = Callable[[float, float], Stance]
"""Stance at a time [s] and at an arc length of the target [m]."""


class GroupMember:
    """One member of a group. It does not avoid other people; they avoid it.

    Args:
        place: Where it is.
    """

    def __init__(self, place: Place) -> None:
        self._place = place
        self.posture = PLAIN

    def reset(self, state: FloatArray, target_s_m: float, target_m: FloatArray) -> float:
        """Move `(4,)` x, y [m], vx, vy [m/s] to the start, and return the heading [rad] there."""
        stance = self._place(0.0, target_s_m)
        soon = self._place(0.01, target_s_m)
        state[:] = stance.x_m, stance.y_m, (soon.x_m - stance.x_m) / 0.01, (soon.y_m - stance.y_m) / 0.01
        return self._heading(stance, state, target_m)

    def track(self, times_s: FloatArray) -> FloatArray:
        """`(T, 2)` positions [m] at `(T,)` times, of a member whose motion does not depend on the target."""
        return np.array([self._place(time_s, 0.0)[:2] for time_s in times_s.tolist()])

    def update(
        self, dt_s: float, time_s: float, target_s_m: float, target_m: FloatArray, state: FloatArray, heading: float
    ) -> float:
        """Advance the state by a tick that ends at `time_s`, and return the new heading."""
        x, y = state[:2].tolist()
        stance = self._place(time_s, target_s_m)
        state[:] = stance.x_m, stance.y_m, (stance.x_m - x) / dt_s, (stance.y_m - y) / dt_s
        turn = math.remainder(self._heading(stance, state, target_m) - heading, 2.0 * math.pi)
        return heading + min(max(turn, -_TURN_RAD_S * dt_s), _TURN_RAD_S * dt_s)

    def _heading(self, stance: Stance, state: FloatArray, target_m: FloatArray) -> float:
        """Take the posture of a stance, and return its heading: its own, that of the motion, or to the target."""
        self.posture = stance.posture
        if stance.heading_rad is not None:
            return stance.heading_rad
        x, y, vx, vy = state.tolist()
        if math.hypot(vx, vy) > _STANDS_M_S:
            return math.atan2(vy, vx)
        return math.atan2(target_m[1] - y, target_m[0] - x)


def group_members(groups: Sequence[Group], target_path: Path) -> list[GroupMember]:
    """The members of all groups, in their order."""
    return [GroupMember(_place(group, index, target_path)) for group in groups for index in range(group.count)]


def _place(group: Group, index: int, target_path: Path) -> Place:
    match group:
        case Standing(at_m=(x, y), count=count):
            angle = math.radians(group.heading_deg) + math.pi + 2.0 * math.pi * index / count
            radius = _RING_M[count - 1]
            ring = Stance(x + radius * math.cos(angle), y + radius * math.sin(angle), angle + math.pi)
            return lambda _time_s, _target_s_m: ring
        case Seated(at_m=(x, y), count=count):
            heading = math.radians(group.heading_deg)
            left = _SEAT_SHARE_M * (index - 0.5 * (count - 1))
            posture = Posture(sit=1.0, arms=hands_on_thighs(1.0))
            seated = Stance(x - left * math.sin(heading), y + left * math.cos(heading), heading, posture)
            return lambda _time_s, _target_s_m: seated
        case Walking(count=count):
            path, speed = Path(group.path_m), group.speed_m_s
            left, lag_m = _ABREAST_M * (index - 0.5 * (count - 1)), _LAG_M * index
            length_m = path.length_m - lag_m
            return lambda time_s, _: Stance(*path.beside(_walked_m(time_s, speed, length_m) - lag_m, left))
        case Companions(left_m=first_m):
            left = first_m + math.copysign(_ABREAST_M * index, first_m)
            return lambda _, target_s_m: Stance(*target_path.beside(target_s_m - _LAG_M, left))


def _walked_m(time_s: float, speed_m_s: float, length_m: float) -> float:
    """Way at a time, at constant speed and then slowing down to a stop at the end."""
    slowing_s = speed_m_s / _STOPPING_M_S2
    since_s = time_s - (length_m - 0.5 * speed_m_s * slowing_s) / speed_m_s
    if since_s <= 0.0:
        return speed_m_s * time_s
    return length_m - 0.5 * _STOPPING_M_S2 * max(slowing_s - since_s, 0.0) ** 2
