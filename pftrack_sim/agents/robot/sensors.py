"""Errors of gyroscope, accelerometer and range finder."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.proprioception import PROPRIO_HIGH, PROPRIO_INDEX, RANGE_M, RANGES
from pftrack_sim.core.random_streams import stream
from pftrack_sim.scenario.robot import Sensors

_GYRO, _ACCELEROMETER = (
    [PROPRIO_INDEX[name.format(axis)] for axis in "xyz"] for name in ("gyro_{}_rad_s", "accelerometer_{}_m_s2")
)


class SensorErrors:
    """What sensors add to the truth: the same at a time of an episode however often they are read.

    Args:
        sensors: How large the errors are.
        seed: That of the episode.
    """

    def __init__(self, sensors: Sensors, seed: int) -> None:
        self._sensors, self._seed = sensors, seed
        self._exact = sensors == Sensors()
        drawn = stream(seed, "sensors", "bias").standard_normal((2, 3))
        self._bias = drawn * [[math.radians(sensors.gyro_bias_deg_s)], [sensors.accelerometer_bias_m_s2]]

    def added(self, proprio: NDArray[np.float32], tick: int) -> NDArray[np.float32]:
        """`(n,)` proprioception with the errors of a tick of the clock."""
        if self._exact:
            return proprio
        sensors, rng = self._sensors, stream(self._seed, "sensors", tick)
        noise = rng.standard_normal((2, 3)) * [
            [math.radians(sensors.gyro_noise_deg_s)],
            [sensors.accelerometer_noise_m_s2],
        ]
        measured = proprio.astype(np.float64)
        measured[_GYRO], measured[_ACCELEROMETER] = (
            measured[rows] + bias + own
            for rows, bias, own in zip((_GYRO, _ACCELEROMETER), self._bias, noise, strict=True)
        )
        ranges = measured[RANGES]
        sigma = np.hypot(sensors.range_noise_m, sensors.range_noise_share * ranges)
        found = ranges + sigma * rng.standard_normal(len(ranges))
        returned = (ranges < RANGE_M) & (rng.random(len(ranges)) >= sensors.range_lost)
        measured[RANGES] = np.where(returned, np.clip(found, 0.0, RANGE_M), RANGE_M)
        return np.clip(measured, -PROPRIO_HIGH, PROPRIO_HIGH).astype(np.float32)
