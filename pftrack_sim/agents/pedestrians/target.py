"""The target's walk along its script."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.agents.pedestrians.manoeuvres import ACCELERATION_M_S2, Manoeuvres
from pftrack_sim.scenario.axes import TargetAxis

if TYPE_CHECKING:
    from pftrack_sim.agents.path import Path

STOP_M_S2 = 0.8
"""Deceleration to a stop at the end of the path, and acceleration afterwards."""

HURRY_M_S2 = 2.5
"""Hardest braking, when a robot drives into its way."""

ROBOT_GAP_M = 0.75
ROBOT_LANE_M = 0.6


class TargetWalk:
    """One walk along one path: at its speed, slowing to a stop at the end, waiting for a robot in its way.

    Args:
        path: Where it walks.
        speed_m_s: Its speed. It is already walking at the start.
        axis: What it does besides.

    Attributes:
        s_m: How far along the path it is.
        heading_rad: Where it faces: the path's direction, unless it faces about.
        crouch: 0 upright, 1 squatting.
        running: Whether it runs.
    """

    def __init__(self, path: Path, speed_m_s: float, axis: TargetAxis) -> None:
        self._path = path
        self._script = Manoeuvres(axis, speed_m_s) if axis.on else None
        self._speed_m_s = speed_m_s if self._script is None else self._script.walk_m_s
        self.reset()

    def reset(self) -> None:
        """Back to the start of the path."""
        self.s_m = 0.0
        self.crouch, self.running, self._facing_rad, self._time_s = 0.0, False, 0.0, 0.0
        self._now_m_s = min(self._speed_m_s, math.sqrt(2.0 * STOP_M_S2 * self._path.length_m))
        self._look()

    @property
    def state(self) -> tuple[float, float, float, float]:
        """x, y [m] and velocity [m/s]."""
        return self._state

    def advance(self, dt_s: float, robot: NDArray[np.float64] | None) -> None:
        """Walk one tick; `robot` is its x, y, vx, vy, or None."""
        left = max(self._path.length_m - self.s_m, 0.0)
        # The fastest from which, after this tick, an even deceleration still ends at the end of the path.
        brake = STOP_M_S2 * dt_s
        stopping = math.sqrt(brake * brake + 2.0 * STOP_M_S2 * left) - brake
        wish_m_s, harder = self._speed_m_s, brake
        if self._script is not None:
            wish_m_s, harder = self._manoeuvre(dt_s)
        wanted = min(wish_m_s, stopping, self._now_m_s + harder)
        if wanted < self._now_m_s - harder and harder > brake:
            wanted = min(self._now_m_s - harder, stopping)
        if robot is not None:
            # Never harder than it can brake: a robot that jumps in front is met while still slowing down.
            wanted = max(min(wanted, self._behind_robot(robot)), min(self._now_m_s - HURRY_M_S2 * dt_s, wanted))
        least = 0.0 if wish_m_s >= 0.0 and self._now_m_s >= 0.0 else max(wish_m_s, -self.s_m / dt_s)
        self._now_m_s = min(max(wanted, least), left / dt_s if dt_s > 0.0 else 0.0)
        self.s_m += self._now_m_s * dt_s
        self._look()

    def _manoeuvre(self, dt_s: float) -> tuple[float, float]:
        """Take up what the script says now: speed wanted [m/s], and how much it may change in this tick [m/s]."""
        assert self._script is not None
        self._time_s += dt_s
        wish = self._script.wish(self._time_s)
        self._facing_rad, self.crouch = wish.facing_rad, wish.crouch
        # Running ends when the target has slowed down to a walk.
        self.running = wish.running or (self.running and self._now_m_s > 1.15 * self._speed_m_s)
        return wish.speed_m_s, ACCELERATION_M_S2 * dt_s

    def foresee_s(self, ahead_s: float) -> float:
        """How far along the path it will be, undisturbed."""
        return min(self.s_m + self._speed_m_s * ahead_s, self._path.length_m)

    def foresee(self, ahead_s: float) -> tuple[float, float, float]:
        """Where it will be, undisturbed: x, y [m] and heading [rad]."""
        x, y, heading = self._path.at(self.foresee_s(ahead_s))
        return float(x), float(y), float(heading)

    def _behind_robot(self, robot: NDArray[np.float64]) -> float:
        """The fastest that leaves room to stop behind a robot ahead."""
        x, y, vx, vy = robot.tolist()
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        dx, dy = x - self._state[0], y - self._state[1]
        ahead, aside = cos * dx + sin * dy, cos * dy - sin * dx
        if ahead <= 0.0 or abs(aside) > ROBOT_LANE_M:
            return math.inf
        along = max(cos * vx + sin * vy, 0.0)
        return along + math.sqrt(2.0 * STOP_M_S2 * max(ahead - ROBOT_GAP_M, 0.0))

    def _look(self) -> None:
        x, y, heading = self._path.at(self.s_m)
        along = float(heading)
        self.heading_rad = along + self._facing_rad
        speed = self._now_m_s
        self._state = (float(x), float(y), speed * math.cos(along), speed * math.sin(along))
