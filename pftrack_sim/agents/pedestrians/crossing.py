"""A walker who comes between the camera and the target at a given time, for as long as asked.

The walk is written in the moving frame of the sight line from the camera to the target, which is known only as it
happens (a closed loop decides it): while covering, the walker stands at a share of the distance and drifts across
the line at a constant rate, from one half width before it to one behind it. Everything around that is a smooth
walk that meets this one in position, velocity and acceleration.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pftrack_sim.core.errors import ParameterError

WALKER_HALF_WIDTH_M = 0.22
"""Effective half width of a person: shoulders and arms, averaged over the directions they are seen from."""

NEAR_CAMERA_M = 0.75
NEAR_TARGET_M = 0.65
"""A crossing walker comes no nearer to the camera, or to the target, than this."""

_EXIT_RAMP_S = 1.0
_EXIT_MARGIN_M = 0.9
_EXIT_LIMIT_S = 3.0
_WALK_M_S = 1.25

_DRIFT = 0.15
"""Share of the way across that is made at an even pace by those who linger."""

Xy = tuple[float, float]


@dataclass(frozen=True)
class Crossing:
    """What one walker is asked to do.

    Attributes:
        at_s: When the target's centre line goes behind the walker.
        duration_s: How long it stays there.
        depth: Where the walker crosses, as a share of the distance from the camera (0) to the target (1).
        side: Side from which it enters, seen from the camera: 1 left, -1 right.
        waiting_m: x, y of its waiting place [m], world frame.
        lead_s: Time before `at_s` at which it starts to move.
        half_width_m: Half of the width that covers the line of sight.
        edge_m_s: Speed across the line of sight while the edges pass it; in between it lingers. None for one even speed
            all the way, which lets the target out of cover gradually.

    Raises:
        ParameterError: A value is outside what it may be.
    """

    at_s: float
    duration_s: float
    depth: float
    side: Literal[-1, 1]
    waiting_m: Xy
    lead_s: float
    half_width_m: float = WALKER_HALF_WIDTH_M
    edge_m_s: float | None = None

    def __post_init__(self) -> None:
        if self.at_s < 0.0 or self.duration_s <= 0.0:
            raise ParameterError(
                f"a crossing needs at_s >= 0 and duration_s > 0, got at_s={self.at_s:g}, duration_s={self.duration_s:g}"
            )
        if not 0.0 < self.depth < 1.0:
            raise ParameterError(f"a crossing's depth must be between 0 and 1, got {self.depth:g}")

    @property
    def until_s(self) -> float:
        """When the target's centre line comes out again."""
        return self.at_s + self.duration_s

    @property
    def rate_m_s(self) -> float:
        """Speed across the line of sight as it is covered and set free."""
        return max(2.0 * self.half_width_m / self.duration_s, self.edge_m_s or 0.0)

    def across_m(self, before_s: float) -> float:
        """Way from the line of sight while covering it, `before_s` before the middle of the cover: odd in it.

        From one half width to the other, at `rate_m_s` at both ends: |x| falls as a power of the time left, the
        gentlest curve that does so without turning back, plus a slow drift so that nothing ever stands.
        """
        half_s = 0.5 * self.duration_s
        steepness = self.rate_m_s * half_s / self.half_width_m
        if steepness <= 1.0 + 1e-9:
            return self.half_width_m * before_s / half_s
        power = (steepness - _DRIFT) / (1.0 - _DRIFT)
        share = before_s / half_s
        return self.half_width_m * share * (_DRIFT + (1.0 - _DRIFT) * abs(share) ** (power - 1.0))


class OcclusionTrajectory:
    """The walk of one crossing, evaluated as it happens.

    Args:
        crossing: Time, place and side of the crossing.
    """

    def __init__(self, crossing: Crossing) -> None:
        self.crossing = crossing
        self._reference: Xy | None = None
        self._before: Xy | None = None
        self._velocity: Xy = (0.0, 0.0)
        self._begin_s = math.nan
        self._error: Xy = (0.0, 0.0)
        self._error_rate: Xy = (0.0, 0.0)
        self._exit_m_s = math.nan

    @property
    def begun(self) -> bool:
        """Whether the walker has set off."""
        return not math.isnan(self._begin_s)

    def update(self, dt_s: float, time_s: float, camera_m: Xy, target_m: Xy) -> Xy:
        """Follow the line of sight; returns where the walker would be if it were exactly on its crossing [m]."""
        ux, uy, reach = _sight(self.crossing.depth, camera_m, target_m)
        across = self._across_m(time_s)
        now = (camera_m[0] + reach * ux - across * uy, camera_m[1] + reach * uy + across * ux)
        self._before = self._reference
        if self._reference is not None and dt_s > 0.0:
            self._velocity = ((now[0] - self._reference[0]) / dt_s, (now[1] - self._reference[1]) / dt_s)
        self._reference = now
        return now

    def begin(self, dt_s: float, time_s: float, position_m: Xy, velocity_m_s: Xy | None) -> None:
        """Set off, after `update` at the same time.

        Args:
            dt_s: Length of the tick.
            time_s: Time at its end.
            position_m: Where the walker was at its beginning.
            velocity_m_s: Its velocity then; None for one that suits.
        """
        before = self._before or self._reference
        if before is None:
            raise RuntimeError("a crossing begins after its line of sight has been watched")
        self._begin_s = time_s - (dt_s if self._before is not None else 0.0)
        self._error = (position_m[0] - before[0], position_m[1] - before[1])
        rate = self._velocity if velocity_m_s is None else velocity_m_s
        self._error_rate = (rate[0] - self._velocity[0], rate[1] - self._velocity[1])

    def position(self, time_s: float) -> Xy:
        """Where the walker is, after `update` at the same time [m]."""
        reference = self._reference
        if reference is None or not self.begun:
            raise RuntimeError("a crossing has a position once it has begun")
        span = self.crossing.at_s - self._begin_s
        if time_s >= self.crossing.at_s or span <= 0.0:
            return reference
        # What is left of the way to the reference: a quintic from the start's offset and rate down to nothing.
        x = (time_s - self._begin_s) / span
        offset = 1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        rate = span * (x - x**3 * (6.0 - 8.0 * x + 3.0 * x * x))
        return (
            reference[0] + offset * self._error[0] + rate * self._error_rate[0],
            reference[1] + offset * self._error[1] + rate * self._error_rate[1],
        )

    def finished(self, time_s: float) -> bool:
        """Whether the walker is clear of the line of sight and free to walk where it likes."""
        over_s = time_s - self.crossing.until_s
        if over_s <= 0.0:
            return False
        clear = abs(self._across_m(time_s)) > self.crossing.half_width_m + _EXIT_MARGIN_M
        return clear or over_s > _EXIT_LIMIT_S

    def _across_m(self, time_s: float) -> float:
        """Offset to the left of the line of sight."""
        crossing = self.crossing
        half, rate = crossing.half_width_m, crossing.rate_m_s
        over_s = time_s - crossing.until_s
        if over_s <= 0.0:
            if crossing.edge_m_s is None or time_s <= crossing.at_s:
                return self.crossing.side * (half - rate * (time_s - crossing.at_s))
            return self.crossing.side * crossing.across_m(-over_s - 0.5 * crossing.duration_s)
        if math.isnan(self._exit_m_s):
            self._exit_m_s = self._choose_exit_rate()
        x = min(over_s / _EXIT_RAMP_S, 1.0)
        ramped = _EXIT_RAMP_S * (x**3 - 0.5 * x**4) + max(over_s - _EXIT_RAMP_S, 0.0)
        return -self.crossing.side * (half + rate * over_s + (self._exit_m_s - rate) * ramped)

    def _choose_exit_rate(self) -> float:
        """Speed across the line of sight after the crossing that makes an ordinary walking speed in the world."""
        speed = math.hypot(*self._velocity)
        rate = self.crossing.rate_m_s
        # At the end of the covered interval the velocity is the sight line's plus `rate` across it.
        return min(max(rate + _WALK_M_S - speed, 0.55), 1.4)


def _sight(depth: float, camera_m: Xy, target_m: Xy) -> tuple[float, float, float]:
    """Unit vector of the line of sight and how far along it to cross."""
    dx, dy = target_m[0] - camera_m[0], target_m[1] - camera_m[1]
    distance = math.hypot(dx, dy)
    if distance < 1e-6:
        return 1.0, 0.0, 0.0
    farthest = distance - NEAR_TARGET_M
    reach = 0.5 * distance if farthest < NEAR_CAMERA_M else min(max(depth * distance, NEAR_CAMERA_M), farthest)
    return dx / distance, dy / distance, reach


def crossing_track(
    crossing: Crossing, start_s: float, dt_s: float, camera_m: np.ndarray, target_m: np.ndarray
) -> np.ndarray:
    """The walk over a recorded episode.

    Args:
        crossing: Time, place and side of the crossing.
        start_s: Time of the first sample.
        dt_s: Time between samples.
        camera_m: `(K, 2)` camera on the ground.
        target_m: `(K, 2)` target on the ground.

    Returns:
        `(K, 2)` positions of the walker until it is free to go, NaN afterwards [m].
    """
    walk = OcclusionTrajectory(crossing)
    track = np.full((len(camera_m), 2), np.nan)
    for index, (camera, target) in enumerate(zip(camera_m.tolist(), target_m.tolist(), strict=True)):
        time_s = start_s + index * dt_s
        walk.update(dt_s, time_s, (camera[0], camera[1]), (target[0], target[1]))
        if not walk.begun and index > 0 and time_s >= crossing.at_s - crossing.lead_s:
            # One who sets off as the record begins is already on the way.
            walk.begin(dt_s, time_s, crossing.waiting_m, (0.0, 0.0) if index > 2 else None)
        track[index] = walk.position(time_s) if walk.begun else crossing.waiting_m
        if walk.finished(time_s):
            break
    return track


def at_different_depths(crossers: Sequence[Crossing]) -> tuple[Crossing, ...]:
    """The same crossings, those at the same time at different depths, so that the walkers do not collide."""
    kept: list[Crossing] = []
    for crossing in crossers:
        depth = crossing.depth
        near = [k.depth for k in kept if k.at_s - 2.0 < crossing.until_s and crossing.at_s - 2.0 < k.until_s]
        if any(abs(depth - other) < 0.2 for other in near):
            options = [d for d in np.linspace(0.2, 0.9, 15) if all(abs(d - other) >= 0.2 for other in near)]
            depth = float(min(options, key=lambda d: abs(d - crossing.depth))) if options else depth
        kept.append(replace(crossing, depth=depth))
    return tuple(kept)


def outside(point: tuple[float, float], centre: Sequence[float], radius_m: float) -> tuple[float, float]:
    """The point, or the nearest one outside a circle."""
    dx, dy = point[0] - centre[0], point[1] - centre[1]
    length = math.hypot(dx, dy)
    if length >= radius_m or length < 1e-9:
        return point
    return centre[0] + dx * radius_m / length, centre[1] + dy * radius_m / length


def within(here: tuple[float, float], there: tuple[float, float], reach_m: float) -> tuple[float, float]:
    """`there`, or the point towards it that can be reached."""
    dx, dy = there[0] - here[0], there[1] - here[1]
    length = math.hypot(dx, dy)
    if length <= reach_m:
        return there
    return here[0] + dx * reach_m / length, here[1] + dy * reach_m / length
