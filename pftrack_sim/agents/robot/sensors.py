"""Errors of gyroscope, accelerometer and range finder; rate and delay of these and of the odometry."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.proprioception import PROPRIO_INDEX, RANGES, proprio_high
from pftrack_sim.core.random_streams import stream
from pftrack_sim.scenario.robot import Robot, Sensors

_ROUNDING = 1e-6
_ROWS = {"odometry": slice(0, 5), "imu": slice(5, 11), "range": RANGES}  # Each a sensor with a rate and a delay

GYRO, ACCELEROMETER = (
    [PROPRIO_INDEX[name.format(axis)] for axis in "xyz"] for name in ("gyro_{}_rad_s", "accelerometer_{}_m_s2")
)


class SensorErrors:
    """What sensors tell instead of the truth: the same at a time of an episode however often they are read."""

    def __init__(self, robot: Robot, seed: int, tick_s: float) -> None:
        self._sensors, self._seed, sensors = robot.sensors, seed, robot.sensors
        self._range_m = robot.range_finder.range_m
        self._high = proprio_high(robot.range_finder.beams, self._range_m)
        self._exact = sensors == Sensors()
        self._held = [
            (rows, tick_s * rate_hz, round(1e-3 * delay_ms / tick_s), deque[tuple[int, NDArray[np.float32]]]())
            for name, rows in _ROWS.items()
            for rate_hz, delay_ms in [(getattr(sensors, f"{name}_rate_hz"), getattr(sensors, f"{name}_delay_ms"))]
            if rate_hz or delay_ms
        ]
        self.hold = bool(self._held)
        """Whether `sense` is needed at every tick."""
        drawn = stream(seed, "sensors", "bias").standard_normal((2, 3))
        self._bias = drawn * [[math.radians(sensors.gyro_bias_deg_s)], [sensors.accelerometer_bias_m_s2]]

    def sense(self, proprio: NDArray[np.float32], tick: int) -> None:
        """Let slow and late sensors sense `(n,)` proprioception at a tick of the clock, in order of time."""
        measured = self._added(proprio, tick)
        for rows, a_tick, delay, queue in self._held:
            if not queue or not a_tick or int(tick * a_tick + _ROUNDING) > int((tick - 1) * a_tick + _ROUNDING):
                queue.append((tick, measured[rows]))
            while len(queue) > 1 and queue[1][0] <= tick - delay:
                queue.popleft()

    def read(self, proprio: NDArray[np.float32], tick: int) -> NDArray[np.float32]:
        """`(n,)` what sensors tell at a tick of the clock, within their bounds: late ones what they have told last."""
        measured = self._added(proprio, tick)
        for rows, *_, queue in self._held:
            measured[rows] = queue[0][1]
        return np.minimum(np.maximum(measured, -self._high), self._high)

    def _added(self, proprio: NDArray[np.float32], tick: int) -> NDArray[np.float32]:
        """`(n,)` proprioception with the errors of a tick of the clock."""
        if self._exact:
            return proprio
        sensors, rng = self._sensors, stream(self._seed, "sensors", tick)
        noise = rng.standard_normal((2, 3)) * [
            [math.radians(sensors.gyro_noise_deg_s)],
            [sensors.accelerometer_noise_m_s2],
        ]
        measured = proprio.astype(np.float64)
        measured[GYRO], measured[ACCELEROMETER] = (
            measured[rows] + bias + own
            for rows, bias, own in zip((GYRO, ACCELEROMETER), self._bias, noise, strict=True)
        )
        ranges = measured[RANGES]
        sigma = np.hypot(sensors.range_noise_m, sensors.range_noise_share * ranges)
        found = ranges + sigma * rng.standard_normal(len(ranges))
        returned = (ranges < self._range_m) & (rng.random(len(ranges)) >= sensors.range_lost)
        measured[RANGES] = np.where(returned, np.clip(found, 0.0, self._range_m), self._range_m)
        return measured.astype(np.float32)
