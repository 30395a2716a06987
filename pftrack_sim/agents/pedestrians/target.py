"""The target: its walk along its path, and what it does on the way."""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple, TypeAlias

from pftrack_sim.agents.gait.posture import PLAIN, Arm, Posture
from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.avoidance import FAR_M
from pftrack_sim.agents.pedestrians.obstacle_map import Xy
from pftrack_sim.agents.pedestrians.outline import Outline
from pftrack_sim.agents.pushed_thing import PushedWalk, PushedWay
from pftrack_sim.scenario import people
from pftrack_sim.scenario.axes import TargetAxis
from pftrack_sim.scenario.mobility import ABLE, TOP_SPEED_M_S
from pftrack_sim.scenario.people import Action, Item, Target, end_s, held_share

DECELERATION_M_S2 = 0.8  # To a stop at the end of the path; also the acceleration afterwards.
MAX_BRAKING_M_S2 = 2.5  # For a robot in the way.
ROBOT_DISTANCE_M = 0.75
ROBOT_LANE_M = 0.6  # A robot ahead is in the way within this distance from the target's line.
ACTION_ACCELERATION_M_S2 = 2.0
_MAX_WALKING_SPEED_M_S = 2.2
_TICK_S = 0.04
_LEAST_WAY_M = 1.0  # Way left for an action that consists in walking
_TOWARDS_RAD = {"away": 0.0, "left": 0.5 * math.pi, "right": -0.5 * math.pi, "camera": math.pi}

_PAUSE_S = 0.6  # Least time of walking before and after a manoeuvre of the axis, so that they can be told apart.
_STANDING_S, _TURN_S, _RISE_S = 0.8, 1.1, 0.7
_LOOK_RAD, _LOOK_S = 1.1, 2.4  # Amplitude and period of looking to the left and right
_WAVES_HZ = 1.6
_SIT_AFTER_S, _SIT_DOWN_S, _SIT_UP_S = 2.1, 1.4, 1.3  # Begins to sit down when it has turned
SITTING_FROM_S = _SIT_AFTER_S + _SIT_DOWN_S  # When a person who sits down is seated

_REACH_SHARE = 0.29  # How far before the body hands hold a thing, as a share of the person's height
_BOX_ARM = Arm(1.0, shoulder=0.30, elbow=1.35)
_HOLDING: dict[Item, tuple[Arm | None, Arm | None]] = {
    "bag": (Arm(0.75, shoulder=0.02, elbow=0.12, outward=0.12), None),
    "box": (_BOX_ARM, _BOX_ARM),
    "umbrella": (None, Arm(1.0, shoulder=0.45, elbow=1.75)),
}

SEAT_FACING_RAD = {"left": -0.5 * math.pi, "right": 0.5 * math.pi}
"""Heading, relative to the path, of a person on a seat on this side of it."""


class TargetWalk:
    """The target walks along its path, slows down to a stop at its end, and waits for a robot in its way.

    Attributes:
        s_m: Arc length on the path.
        state: x, y [m] and vx, vy [m/s].
        tracked_m: x, y of the target: of the thing that the person carries, where that is the target.
        outline: What others keep clear of.
        heading_rad: Heading of the body: the path's direction, except where it turns to something else.
        posture: Posture of the body.
    """

    def __init__(self, path: Path, target: Target, axis: TargetAxis) -> None:
        self._path, self._axis, self._target = path, axis, target
        self._reach_m = _REACH_SHARE * target.height_m if target.carried else 0.0
        self.outline = Outline.of(target)
        self._acts = axis.on or bool(target.actions)
        speed_m_s = target.speed_m_s
        faster_m_s = axis.severity * axis.faster_m_s if axis.on else 0.0
        most_m_s = TOP_SPEED_M_S.get(target.uses, _MAX_WALKING_SPEED_M_S)
        self._walking_speed_m_s = max(min(speed_m_s + faster_m_s, most_m_s), speed_m_s)
        self.s_m, self.posture, self._facing_rad, self._time_s = 0.0, PLAIN, 0.0, 0.0
        self._schedule = schedule(self._target.actions, self._axis)
        self._action, self._asked_rad = next(self._schedule, None), 0.0
        self._begun = False
        self._speed_m_s = min(self._walking_speed_m_s, math.sqrt(2.0 * DECELERATION_M_S2 * self._path.length_m))
        self._hold()
        self._update_state()

    def update(self, dt_s: float, robot: tuple[float, float, float, float], camera_m: Xy) -> None:
        """Walk for one tick; `robot` is its `(4,)` x, y [m], vx, vy [m/s], `camera_m` x, y of the camera."""
        left_m = max(self._path.length_m - self.s_m, 0.0)
        # The highest speed from which a constant deceleration after this tick still ends at the end of the path.
        step = DECELERATION_M_S2 * dt_s
        stopping = math.sqrt(step * step + 2.0 * DECELERATION_M_S2 * left_m) - step
        desired, max_step = self._walking_speed_m_s, step
        self._time_s += dt_s
        if self._acts:
            asked = self._command(camera_m)
            desired, max_step = asked.speed_m_s, ACTION_ACCELERATION_M_S2 * dt_s
            # The running posture ends when the target has slowed down to a walk.
            runs_on = self.posture.running and self._speed_m_s > 1.15 * self._walking_speed_m_s
            self._facing_rad, self.posture = asked.facing_rad, asked.posture
            if runs_on and not asked.posture.running:
                self.posture = replace(asked.posture, running=True)
        self._hold()
        speed = min(desired, stopping, self._speed_m_s + max_step)
        if self._acts and speed < self._speed_m_s - max_step:
            speed = min(self._speed_m_s - max_step, stopping)
        # Braking is limited: the target may come close to a robot that cuts in.
        speed = max(min(speed, self._speed_behind(robot)), min(self._speed_m_s - MAX_BRAKING_M_S2 * dt_s, speed))
        if desired < 0.0:
            speed = max(speed, -self._speed_behind(robot))
        slowest = 0.0 if desired >= 0.0 and self._speed_m_s >= 0.0 else -self.s_m / dt_s
        self._speed_m_s = min(max(speed, slowest), left_m / dt_s)
        self.s_m += self._speed_m_s * dt_s
        self._update_state()

    def predicted(self, ahead_s: float) -> tuple[float, float]:
        """x, y [m] after a time at walking speed."""
        return self._path.pose(min(self.s_m + self._walking_speed_m_s * ahead_s, self._path.length_m))[:2]

    def _hold(self) -> None:
        if self._target.carries or self._target.carried:
            self.posture = replace(self.posture, arms=arms(self._target, self._time_s, self.posture.arms))

    def _command(self, camera_m: Xy) -> Command:
        while self._action is not None and self._time_s >= end_s(self._action):
            self._action, self._begun = next(self._schedule, None), False
        action = self._action
        if action is None or self._time_s < action.at_s:
            return Command(self._walking_speed_m_s)
        if not self._begun and isinstance(action, people.Face):
            sight_rad = math.atan2(self.state[1] - camera_m[1], self.state[0] - camera_m[0])
            turn_rad = sight_rad + _TOWARDS_RAD[action.towards] - self.heading_rad
            self._asked_rad = math.remainder(turn_rad, 2.0 * math.pi)
        self._begun = True
        if self._target.uses is not None and action.kind not in ABLE[self._target.uses]:
            return Command(0.0)  # A manoeuvre of the axis that needs legs
        return command(action, self._time_s - action.at_s, self._asked_rad)

    def _speed_behind(self, robot: tuple[float, float, float, float]) -> float:
        """Highest speed that leaves room to stop behind a robot ahead; infinite if none is in the way."""
        x, y, vx, vy = robot
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        dx, dy = x - self.state[0], y - self.state[1]
        ahead, aside = cos * dx + sin * dy, cos * dy - sin * dx
        if ahead <= 0.0 or abs(aside) > ROBOT_LANE_M + self.outline.extra_m:
            return math.inf
        robot_speed = max(cos * vx + sin * vy, 0.0)
        room_m = ahead - ROBOT_DISTANCE_M - self.outline.front_m
        return robot_speed + math.sqrt(2.0 * DECELERATION_M_S2 * max(room_m, 0.0))

    def _update_state(self) -> None:
        x, y, heading = self._path.pose(self.s_m)
        self.heading_rad = heading + self._facing_rad
        self.state = (x, y, self._speed_m_s * math.cos(heading), self._speed_m_s * math.sin(heading))
        reach_m = self._reach_m
        self.tracked_m = x + reach_m * math.cos(self.heading_rad), y + reach_m * math.sin(self.heading_rad)


Walk: TypeAlias = TargetWalk | PushedWalk


def walk_of(path: Path, target: Target, axis: TargetAxis) -> Walk:
    """The target on its way, at the start."""
    return PushedWalk(path) if isinstance(path, PushedWay) else TargetWalk(path, target, axis)


def mean_speed_m_s(path: Path, target: Target) -> float:
    """About how fast the target is on its way."""
    return path.speed_m_s if isinstance(path, PushedWay) else target.speed_m_s


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
    if target.carried:
        return _BOX_ARM, _BOX_ARM
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


def places_alone(
    path: Path, target: Target, axis: TargetAxis, times_s: Iterable[float]
) -> Iterator[tuple[float, tuple[float, float, float]]]:
    """Arc length [m], and x, y [m] and heading [rad], at rising times of a target that no robot is in the way of."""
    walk, nowhere, tick = TargetWalk(path, target, axis), (FAR_M, FAR_M, 0.0, 0.0), 0
    for time_s in times_s:
        while tick * _TICK_S < time_s:
            walk.update(_TICK_S, nowhere, (FAR_M, FAR_M))
            tick += 1
        yield walk.s_m, (*walk.state[:2], walk.heading_rad)


def impossible_actions(path: Path, target: Target, axis: TargetAxis, until_s: float, name: str = "target") -> list[str]:
    """Messages about actions before `until_s` for which the path is too short."""
    problems: list[str] = []
    listed = sorted(enumerate(target.actions), key=lambda item: item[1].at_s)
    # Only these need a part of the path.
    kinds = people.Turn | people.Approach | people.Run | people.Pace | people.WalkOff
    planned = [(index, action) for index, action in listed if action.at_s < until_s and isinstance(action, kinds)]
    places = places_alone(path, target, axis, [action.at_s for _, action in planned])
    for (index, action), (s_m, _) in zip(planned, places, strict=True):
        left_m, what = path.length_m - s_m, f"{name}.{people.title(index, action)}"
        if isinstance(action, people.Turn | people.Approach) and s_m < action.back_m:
            problems.append(f"{what}: walks back {action.back_m:.1f} m, but is only {s_m:.1f} m along its path by then")
        if isinstance(action, people.Run | people.Pace | people.WalkOff) and left_m < _LEAST_WAY_M:
            problems.append(f"{what}: only {left_m:.1f} m of its path, {path.length_m:.1f} m long, are left by then")
    return problems
