"""The operator's head of the scripted robot: where the camera is aimed, and how it gets there.

The head answers like a person in manual tracking: after a reaction time, as a second-order system (McRuer and Jex 1967,
"A review of quasi-linear pilot models", IEEE Transactions on Human Factors in Electronics HFE-8(3)). Everything random
is drawn once from streams of its own, and is a function of time: it does not depend on the rate of the camera, nor on
anything else in the scene.
"""

from __future__ import annotations

import bisect
import math
from collections import deque
from typing import NamedTuple

import numpy as np

from pftrack_sim.agents.pedestrians.obstacle_map import Xy
from pftrack_sim.core.random_streams import stream
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario import robot as scenario
from pftrack_sim.scenario.people import GAZE_M

GAZE_DEAD_ZONE_RAD = math.radians(6.0)
"""The head does not react to smaller errors of direction: the target stays in view, but is rarely centred."""
_GAZE_TIME_CONSTANT_S = 0.6
_GAZE_URGENCY_RAD = math.radians(8.0)  # An error beyond the dead zone by this much doubles the gain
_MIN_DISTANCE_M = 0.3

_START_S = 2.0  # Before this time nothing happens; the aim begins to wander from the target at the start
_EDGE_RAD = math.radians(5.0)  # The centre of a target that is kept in view is this far inside the image
_EDGE_TIME_CONSTANT_S = 0.12  # At which a target at the edge is brought back
_EDGE_PREVIEW_S = 0.15
_COSINES = 12
_EVENTS = 1024


def bearing(T_world_camera: FloatArray, target_m: Xy, height_m: float = GAZE_M) -> tuple[float, float]:
    """Direction of a target at x, y and a height above the ground from the optical axis, to the left and up [rad]."""
    # Numbers one by one: arrays of three cost ten times as much.
    (x_x, y_x, z_x, at_x), (x_y, y_y, z_y, at_y), (x_z, y_z, z_z, at_z), _ = T_world_camera.tolist()
    to_x, to_y, to_z = target_m[0] - at_x, target_m[1] - at_y, height_m - at_z
    x = x_x * to_x + x_y * to_y + x_z * to_z
    y = y_x * to_x + y_y * to_y + y_z * to_z
    z = z_x * to_x + z_y * to_y + z_z * to_z
    return math.atan2(-x, z), math.atan2(-y, max(math.hypot(x, z), _MIN_DISTANCE_M))


def gaze_rate(error_rad: float, tick_s: float, dead_zone_rad: float = GAZE_DEAD_ZONE_RAD) -> float:
    """Rate [rad/s] about one axis that brings an error of direction back into the dead zone, without overshoot.

    A slow human operator behaves alike.
    """
    beyond = max(abs(error_rad) - dead_zone_rad, 0.0)
    gain = 1.0 + beyond / _GAZE_URGENCY_RAD
    return math.copysign(min(beyond * gain / _GAZE_TIME_CONSTANT_S, beyond / tick_s), error_rad)


class Event(NamedTuple):
    """One glance or stop: when it begins, how long it lasts, and its side and size, about 1 or -1."""

    begin_s: float
    length_s: float
    size: float


class Events:
    """Glances or stops at random times: a third of the mean pause between two, and an exponential rest.

    Args:
        per_minute: How many in the long run; fewer where they are so long that there is hardly a pause.
        length_s: Mean length.
    """

    def __init__(self, per_minute: float, length_s: float, rng: np.random.Generator) -> None:
        self._events: list[Event] = []
        if per_minute > 0.0:
            pause_s = max(60.0 / per_minute - length_s, 0.5)
            draws = rng.random((_EVENTS, 4))
            lengths = length_s * (0.7 + 0.6 * draws[:, 0])
            pauses = pause_s * (1.0 - 2.0 * np.log1p(-draws[:, 1])) / 3.0
            pauses[0] = _START_S + pause_s * draws[0, 1]
            begins = np.cumsum(pauses) + np.concatenate([[0.0], np.cumsum(lengths[:-1])])
            sizes = np.where(draws[:, 2] < 0.5, -1.0, 1.0) * (0.7 + 0.6 * draws[:, 3])
            self._events = [Event(*row) for row in np.stack([begins, lengths, sizes], axis=1).tolist()]

    def at(self, time_s: float) -> Event | None:
        """The event that is going on, or None."""
        index = bisect.bisect_right(self._events, time_s, key=lambda event: event.begin_s) - 1
        event = self._events[index] if index >= 0 else None
        return event if event is not None and time_s < event.begin_s + event.length_s else None


class Wander:
    """A smooth Gaussian process of time: a sum of cosines of random frequency and phase, 0.4 to 1.6 times the mean."""

    def __init__(self, rms: float, period_s: float, rng: np.random.Generator) -> None:
        share = (np.arange(_COSINES) + rng.random(_COSINES)) / _COSINES
        omega = 2.0 * math.pi / period_s * (0.4 + 1.2 * share)
        phase = rng.uniform(0.0, 2.0 * math.pi, _COSINES)
        self._cosines: list[tuple[float, float]] = np.stack([omega, phase], axis=1).tolist()
        self._amplitude = rms * math.sqrt(2.0 / _COSINES)

    def at(self, time_s: float) -> float:
        """Value at a time."""
        if self._amplitude == 0.0:
            return 0.0
        return self._amplitude * sum([math.cos(omega * time_s + phase) for omega, phase in self._cosines])


class Head:
    """Pan and tilt rates by which the operator aims at the target.

    Args:
        half_view_rad: Half the horizontal and the vertical field of view.
        limits_rad_s: Highest pan and tilt rate.
        gaze_m: Height of the point of the target that the camera is turned to.
    """

    def __init__(
        self,
        operator: scenario.Operator,
        half_view_rad: tuple[float, float],
        limits_rad_s: tuple[float, float],
        seed: int,
        gaze_m: float = GAZE_M,
    ) -> None:
        self._operator, self._gaze_m = operator, gaze_m
        self._limits_rad_s = limits_rad_s
        self._dead_zone_rad = math.radians(operator.dead_zone_deg)
        self._omega = 2.0 * math.pi * operator.head_hz
        rms = math.radians(operator.wander_deg)
        self._wander = tuple(
            Wander(share * rms, operator.wander_s, stream(seed, "operator", "aim", name))
            for name, share in (("pan", 1.0), ("tilt", 0.5))
        )
        self._glances = Events(operator.glances_per_minute, operator.glance_s, stream(seed, "operator", "glances"))
        self._glance_rad = math.radians(operator.glance_deg)
        keep = operator.keep_in_view
        self._edges_rad = tuple(max(half - _EDGE_RAD, _EDGE_RAD) if keep else math.inf for half in half_view_rad)
        self.reset()

    def reset(self) -> None:
        """Return to the start of the episode."""
        self._rates = [0.0, 0.0]
        self._last: tuple[float, float] | None = None
        self._seen: deque[tuple[float, float, float]] = deque()

    def rates(self, T_world_camera: FloatArray, target_m: Xy, tick_s: float, time_s: float) -> tuple[float, float]:
        """Pan, tilt rate [rad/s] for the coming tick, from a `(4, 4)` camera pose and x, y of the target."""
        now = bearing(T_world_camera, target_m, self._gaze_m)
        seen = now
        if self._operator.reaction_s:
            seen = bearing(T_world_camera, self._delayed(target_m, time_s), self._gaze_m)
        for axis, aim in enumerate(self.aim(time_s)):
            edge = self._edges_rad[axis]
            error = math.remainder(seen[axis] - _within(aim, edge - self._dead_zone_rad), 2.0 * math.pi)
            # Where the target will be, as it moves in the image.
            ahead = now[axis] + _EDGE_PREVIEW_S / tick_s * (now[axis] - self._last[axis] if self._last else 0.0)
            self._rates[axis] = self._kept(self._rate(axis, error, tick_s), ahead, edge)
        self._last = now
        return self._rates[0], self._rates[1]

    def aim(self, time_s: float) -> tuple[float, float]:
        """Wanted direction of the target from the optical axis, to the left and up [rad]; zero at the start."""
        fade = min(time_s / _START_S, 1.0)
        fade *= fade * (3.0 - 2.0 * fade)
        glance = self._glances.at(time_s)
        pan = fade * self._wander[0].at(time_s) + (self._glance_rad * glance.size if glance is not None else 0.0)
        return pan, fade * self._wander[1].at(time_s)

    def _delayed(self, target_m: Xy, time_s: float) -> Xy:
        """The place of the target a reaction time ago, interpolated; at the start its first place."""
        seen = self._seen
        seen.append((time_s, *target_m))
        then = time_s - self._operator.reaction_s
        while len(seen) > 1 and seen[1][0] <= then:
            seen.popleft()
        if len(seen) == 1 or then <= seen[0][0]:
            return seen[0][1:]
        (t0, x0, y0), (t1, x1, y1) = seen[0], seen[1]
        share = (then - t0) / (t1 - t0)
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0)

    def _rate(self, axis: int, error_rad: float, tick_s: float) -> float:
        """The rate of a tick: by the first-order law, or integrated from r' = w^2 e - 2 d w r, implicit in r."""
        if self._omega == 0.0:
            return gaze_rate(error_rad, tick_s, self._dead_zone_rad)
        beyond = math.copysign(max(abs(error_rad) - self._dead_zone_rad, 0.0), error_rad)
        pull = self._rates[axis] + tick_s * self._omega**2 * beyond
        limit = self._limits_rad_s[axis]
        return max(-limit, min(limit, pull / (1.0 + 2.0 * self._operator.head_damping * self._omega * tick_s)))

    @staticmethod
    def _kept(rate: float, bearing_rad: float, edge_rad: float) -> float:
        """The rate, or the one that brings a target at the edge of the view back."""
        beyond = abs(bearing_rad) - edge_rad
        if beyond <= 0.0:
            return rate
        back = beyond / _EDGE_TIME_CONSTANT_S
        return max(rate, back) if bearing_rad > 0.0 else min(rate, -back)


def _within(angle_rad: float, limit_rad: float) -> float:
    """The angle, bent smoothly towards a limit."""
    if math.isinf(limit_rad):
        return angle_rad
    limit = max(limit_rad, 1e-3)
    return limit * math.tanh(angle_rad / limit)
