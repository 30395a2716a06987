"""Where the members of groups are: they stand in a ring, sit side by side, walk abreast, or walk with the target."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

from pftrack_sim.agents.gait.posture import PLAIN, Posture
from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.outline import Outline
from pftrack_sim.agents.pedestrians.target import Walk, hands_on_thighs
from pftrack_sim.scenario.people import Companions, Group, Seated, Standing, Walking

_RING_M = (0.45, 0.5, 0.62, 0.75)  # Radius of a ring by the number of people in it
_ABREAST_M, _LAG_M = 0.66, 0.15  # Between two who walk side by side
_SEAT_SHARE_M = 0.62  # Between two on one bench
_STOPPING_M_S2 = 0.8
_TURN_RAD_S = 2.2
_SOON_S = 0.01  # After the start, for the velocity there
_STANDS_M_S = 0.12  # A companion slower than this looks at the target


class Stance(NamedTuple):
    """Position x, y [m], and heading [rad] and posture, where they do not follow from the motion."""

    x_m: float
    y_m: float
    heading_rad: float | None = None
    posture: Posture = PLAIN


Place: TypeAlias = Callable[[float, float], Stance]
"""Stance at a time [s] and at an arc length of the target [m], on which only that of companions depends."""


class GroupMember:
    """One member of a group. It does not avoid other people; they avoid it.

    Args:
        place: Where it is.
        target: Whom it walks with, or looks at.

    Attributes:
        state: x, y [m] and vx, vy [m/s].
        heading_rad: Heading of the body.
        posture: Posture of the body.
    """

    outline = Outline()

    def __init__(self, place: Place, target: Walk) -> None:
        self._place, self._target = place, target
        stance, soon = place(0.0, target.s_m), place(_SOON_S, target.s_m)
        self._stand(stance, (soon.x_m - stance.x_m) / _SOON_S, (soon.y_m - stance.y_m) / _SOON_S)
        self.heading_rad = self._wanted_rad(stance)

    def update(self, dt_s: float, time_s: float) -> None:
        """Move on by a tick that ends at `time_s`, after the target."""
        x, y, *_ = self.state
        stance = self._place(time_s, self._target.s_m)
        self._stand(stance, (stance.x_m - x) / dt_s, (stance.y_m - y) / dt_s)
        turn = math.remainder(self._wanted_rad(stance) - self.heading_rad, 2.0 * math.pi)
        self.heading_rad += min(max(turn, -_TURN_RAD_S * dt_s), _TURN_RAD_S * dt_s)

    def _stand(self, stance: Stance, vx: float, vy: float) -> None:
        self.state, self.posture = (stance.x_m, stance.y_m, vx, vy), stance.posture

    def _wanted_rad(self, stance: Stance) -> float:
        """The heading of a stance, that of the motion, or to the target."""
        if stance.heading_rad is not None:
            return stance.heading_rad
        x, y, vx, vy = self.state
        if math.hypot(vx, vy) > _STANDS_M_S:
            return math.atan2(vy, vx)
        target_x, target_y = self._target.state[:2]
        return math.atan2(target_y - y, target_x - x)


def group_places(groups: Sequence[Group], target_path: Path) -> list[Place]:
    """Where the members of all groups are, in their order."""
    return [_place(group, index, target_path) for group in groups for index in range(group.count)]


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
