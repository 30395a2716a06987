"""How the target performs its actions: wanted speed, direction of the body and posture over time."""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

from pftrack_sim.agents.gait.posture import PLAIN, Arm, Posture
from pftrack_sim.scenario import people
from pftrack_sim.scenario.axes import TargetAxis
from pftrack_sim.scenario.people import Action, Item, Target, end_s, held_share

_PAUSE_S = 0.6  # Least time of walking before and after a manoeuvre of the axis, so that they can be told apart.
_STANDING_S, _TURN_S, _RISE_S = 0.8, 1.1, 0.7
_LOOK_RAD, _LOOK_S = 1.1, 2.4  # Amplitude and period of looking to the left and right
_WAVES_HZ = 1.6
_SIT_AFTER_S, _SIT_DOWN_S, _SIT_UP_S = 2.1, 1.4, 1.3  # Begins to sit down when it has turned
SITTING_FROM_S = _SIT_AFTER_S + _SIT_DOWN_S  # When a person who sits down is seated

_BOX_ARM = Arm(1.0, shoulder=0.30, elbow=1.35)
_HOLDING: dict[Item, tuple[Arm | None, Arm | None]] = {
    "bag": (Arm(0.75, shoulder=0.02, elbow=0.12, outward=0.12), None),
    "box": (_BOX_ARM, _BOX_ARM),
    "umbrella": (None, Arm(1.0, shoulder=0.45, elbow=1.75)),
}

SEAT_FACING_RAD = {"left": -0.5 * math.pi, "right": 0.5 * math.pi}
"""Heading, relative to the path, of a person on a seat on this side of it."""


class Command(NamedTuple):
    """Wanted speed along the path (negative: backwards), heading relative to it, and posture."""

    speed_m_s: float
    facing_rad: float = 0.0
    posture: Posture = PLAIN


def schedule(planned: tuple[Action, ...], axis: TargetAxis) -> Iterator[Action]:
    """The scenario's actions and the manoeuvres of the stress axis, by time; the latter wait for the former."""
    fixed = sorted(planned, key=lambda action: action.at_s)
    return heapq.merge(fixed, _manoeuvres(fixed, axis), key=lambda action: action.at_s)


def _manoeuvres(fixed: list[Action], axis: TargetAxis) -> Iterator[Action]:
    if not math.isfinite(axis.every_s):
        return
    begin_s = axis.at_s
    for kind in itertools.cycle(axis.manoeuvres):
        action = axis.action(kind, begin_s)
        for other in fixed:
            if begin_s < end_s(other) + _PAUSE_S and other.at_s < end_s(action) + _PAUSE_S:
                begin_s = end_s(other) + _PAUSE_S
                action = axis.action(kind, begin_s)
        yield action
        begin_s += max(axis.every_s, action.duration_s + _PAUSE_S)


def command(action: Action, since_s: float, facing_rad: float) -> Command:
    """What the target does `since_s` into an action; `facing_rad`, for a `Face`, is relative to the path."""
    left_s = action.duration_s - since_s
    match action:
        case people.Run():
            return Command(action.speed_m_s, posture=Posture(running=True))
        case people.Pace() | people.WalkOff():
            return Command(action.speed_m_s)
        case people.Stop():
            return Command(0.0)
        case people.Face():
            return Command(action.speed_m_s, facing_rad * _turned(since_s, left_s))
        case people.Turn() | people.Approach():
            speed = action.speed_m_s if isinstance(action, people.Approach) else people.BACKWARD_SPEED_M_S
            # Turned before it walks back, and standing again before it turns.
            walks = since_s >= _STANDING_S + _TURN_S and action.duration_s - 2.0 > since_s
            return Command(-speed if walks else 0.0, math.pi * _turned(since_s, left_s))
        case people.Lowering():
            share = _lowered(since_s, left_s)
            return Command(0.0, posture=Posture(crouch=share) if action.kind == "crouch" else Posture(bend=share))
        case people.Sit():
            share = _smoothstep((since_s - _SIT_AFTER_S) / _SIT_DOWN_S) - _smoothstep((3.0 - left_s) / _SIT_UP_S)
            posture = Posture(sit=share, arms=hands_on_thighs(share))
            return Command(0.0, SEAT_FACING_RAD[action.side] * _turned(since_s, left_s), posture)
        case people.Gesture():
            share = _lowered(since_s, left_s)
            if action.kind == "look_around":
                look = share * _LOOK_RAD * math.sin(2.0 * math.pi * (since_s - 1.0) / _LOOK_S)
                return Command(0.0, posture=Posture(look_rad=look))
            swing = math.sin(2.0 * math.pi * _WAVES_HZ * since_s)
            right = Arm(share, shoulder=2.6, elbow=0.5, outward=-0.35, forearm=0.4 * swing)
            return Command(0.0, posture=Posture(arms=(None, right)))


def hands_on_thighs(share: float) -> tuple[Arm, Arm]:
    """Arms of a person who sits."""
    arm = Arm(share, shoulder=0.32, elbow=0.85, outward=0.06)
    return arm, arm


def arms(target: Target, time_s: float, free: tuple[Arm | None, Arm | None]) -> tuple[Arm | None, Arm | None]:
    """Left and right arm with what the target carries at this time; arms that carry nothing do as in `free`."""
    left, right = free
    for one in target.carries:
        share = held_share(one, target.actions, time_s)
        if share > 0.0 and one.item in _HOLDING:
            hold_left, hold_right = _HOLDING[one.item]
            left = hold_left._replace(share=share * hold_left.share) if hold_left else left
            right = hold_right._replace(share=share * hold_right.share) if hold_right else right
    return left, right


def _turned(since_s: float, left_s: float) -> float:
    """Share of a turn that follows slowing down and is undone before the end."""
    return _smoothstep((since_s - _STANDING_S) / _TURN_S) - _smoothstep((1.3 - left_s) / _TURN_S)


def _lowered(since_s: float, left_s: float) -> float:
    """Share of a posture that is taken after slowing down and left before the end."""
    return _smoothstep((since_s - 1.0) / _RISE_S) - _smoothstep((1.1 - left_s) / _RISE_S)


def _smoothstep(share: float) -> float:
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)
