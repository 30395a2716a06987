"""Walk of the target along its path, and its manoeuvres."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

from pftrack_sim.agents.path import Path
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.axes import TargetAxis

DECELERATION_M_S2 = 0.8  # To a stop at the end of the path; also the acceleration afterwards.
MAX_BRAKING_M_S2 = 2.5  # For a robot in the way.
ROBOT_DISTANCE_M = 0.75
ROBOT_LANE_M = 0.6  # A robot ahead is in the way within this distance from the target's line.
MANOEUVRE_ACCELERATION_M_S2 = 2.0
BACKWARD_SPEED_M_S = 0.9
MANOEUVRE_DURATIONS_S = {"stop": 2.2, "turn": 5.2, "crouch": 3.8, "run": 3.0}  # Slowing down included.
_PAUSE_S = 0.6  # Least time of walking between two manoeuvres, so that they can be told apart.
_MAX_WALKING_SPEED_M_S = 2.2


class _Command(NamedTuple):
    """Desired speed along the path (negative: backwards), heading relative to it, and posture."""

    speed_m_s: float
    facing_rad: float = 0.0
    crouch: float = 0.0
    running: bool = False


class TargetWalk:
    """The target walks along its path, slows down to a stop at its end, and waits for a robot in its way.

    Attributes:
        s_m: Arc length on the path.
        state: x, y [m] and vx, vy [m/s].
        heading_rad: Heading of the body: the path's direction, except in the manoeuvre "turn".
        crouch: 0 upright, 1 squatting.
    """

    def __init__(self, path: Path, speed_m_s: float, axis: TargetAxis) -> None:
        self._path, self._axis = path, axis
        faster_m_s = axis.severity * axis.faster_m_s if axis.on else 0.0
        self._walking_speed_m_s = max(min(speed_m_s + faster_m_s, _MAX_WALKING_SPEED_M_S), speed_m_s)
        self.reset()

    def reset(self) -> None:
        """Return to the start of the path."""
        self.s_m, self.crouch, self.running, self._facing_rad, self._time_s = 0.0, 0.0, False, 0.0, 0.0
        self._speed_m_s = min(self._walking_speed_m_s, math.sqrt(2.0 * DECELERATION_M_S2 * self._path.length_m))
        self._update_state()

    def update(self, dt_s: float, robot: FloatArray) -> None:
        """Walk for one tick; `robot` is its `(4,)` x, y [m], vx, vy [m/s]."""
        left_m = max(self._path.length_m - self.s_m, 0.0)
        # The highest speed from which a constant deceleration after this tick still ends at the end of the path.
        step = DECELERATION_M_S2 * dt_s
        stopping = math.sqrt(step * step + 2.0 * DECELERATION_M_S2 * left_m) - step
        desired, max_step = self._walking_speed_m_s, step
        if self._axis.on:
            self._time_s += dt_s
            command = self._command()
            desired, max_step = command.speed_m_s, MANOEUVRE_ACCELERATION_M_S2 * dt_s
            self._facing_rad, self.crouch = command.facing_rad, command.crouch
            # The running posture ends when the target has slowed down to a walk.
            self.running = command.running or (self.running and self._speed_m_s > 1.15 * self._walking_speed_m_s)
        speed = min(desired, stopping, self._speed_m_s + max_step)
        if self._axis.on and speed < self._speed_m_s - max_step:
            speed = min(self._speed_m_s - max_step, stopping)
        # Braking is limited: the target may come close to a robot that cuts in.
        speed = max(min(speed, self._speed_behind(robot)), min(self._speed_m_s - MAX_BRAKING_M_S2 * dt_s, speed))
        slowest = 0.0 if desired >= 0.0 and self._speed_m_s >= 0.0 else max(desired, -self.s_m / dt_s)
        self._speed_m_s = min(max(speed, slowest), left_m / dt_s)
        self.s_m += self._speed_m_s * dt_s
        self._update_state()

    def predicted(self, ahead_s: float) -> tuple[float, float]:
        """x, y [m] after a time at walking speed."""
        x, y, _ = self._path.at(min(self.s_m + self._walking_speed_m_s * ahead_s, self._path.length_m))
        return float(x), float(y)

    def _command(self) -> _Command:
        axis = self._axis
        begin_s = axis.at_s if math.isfinite(axis.every_s) else math.inf
        for name in itertools.cycle(axis.manoeuvres):
            if self._time_s < begin_s:
                break
            if self._time_s < begin_s + MANOEUVRE_DURATIONS_S[name]:
                return self._manoeuvre(name, self._time_s - begin_s)
            begin_s += max(axis.every_s, MANOEUVRE_DURATIONS_S[name] + _PAUSE_S)
        return _Command(self._walking_speed_m_s)

    def _manoeuvre(self, name: str, since_s: float) -> _Command:
        if name == "run":
            return _Command(self._axis.run_m_s, running=True)
        if name == "crouch":
            return _Command(0.0, crouch=_smoothstep((since_s - 1.0) / 0.7) - _smoothstep((since_s - 2.7) / 0.7))
        if name == "stop":
            return _Command(0.0)
        facing = math.pi * (_smoothstep((since_s - 0.8) / 1.1) - _smoothstep((since_s - 3.9) / 1.1))
        return _Command(-BACKWARD_SPEED_M_S if 1.9 <= since_s < 3.2 else 0.0, facing)

    def _speed_behind(self, robot: FloatArray) -> float:
        """Highest speed that leaves room to stop behind a robot ahead; infinite if none is in the way."""
        x, y, vx, vy = robot.tolist()
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        dx, dy = x - self.state[0], y - self.state[1]
        ahead, aside = cos * dx + sin * dy, cos * dy - sin * dx
        if ahead <= 0.0 or abs(aside) > ROBOT_LANE_M:
            return math.inf
        robot_speed = max(cos * vx + sin * vy, 0.0)
        return robot_speed + math.sqrt(2.0 * DECELERATION_M_S2 * max(ahead - ROBOT_DISTANCE_M, 0.0))

    def _update_state(self) -> None:
        x, y, heading = (float(v) for v in self._path.at(self.s_m))
        self.heading_rad = heading + self._facing_rad
        self.state = (x, y, self._speed_m_s * math.cos(heading), self._speed_m_s * math.sin(heading))


def _smoothstep(share: float) -> float:
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)
