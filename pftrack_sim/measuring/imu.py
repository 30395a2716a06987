"""Level of the jitter axis from an inertial sensor: what turns with it, shakes as told by its gyroscope."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from pftrack_sim.core.types import FloatArray
from pftrack_sim.measuring.imu_log import ImuLog
from pftrack_sim.measuring.jitter import LEAST_S, Systematic, evened, jitter_quantities, stretches_between
from pftrack_sim.measuring.measured import Measured, Quantity
from pftrack_sim.measuring.spectrum import spectrum_of_turns

_SCALE = Systematic(focal_share=(0.97, 1.03))  # Sensitivities of gyroscopes in phones and small robots: 3 %
_GRAVITY_M_S2 = 9.81
_OCTAVES_HZ = (0.25, 0.5, 1.0, 2.0, 4.0)  # From which the two sensors are compared
_LEAST_SLOPE = 0.3
_MOST_DEG = 5.0  # RMS; hand-held cameras of public sequences shake by 2 at most
_CLIPPED = 3  # Samples in a row at the same extreme


def measure_imu(log: ImuLog) -> Measured:
    """The shake of what an inertial sensor is mounted on, in the same quantities as from a video.

    Pitch and roll are the turns about the two axes across the vertical, which is that of the mean acceleration. Without
    an accelerometer the interval holds all three axes for the vertical one.
    """
    times, count = log.times_s, len(log.times_s)
    lasts = np.diff(times)
    usual = float(np.median(lasts))
    rate = Quantity("samples per second", 1.0 / usual, 1.0 / usual, 1.0 / usual, "Hz", count)
    known = stretches_between(set(), times)
    seconds = sum(float(times[one.stop] - times[one.start]) for one in known)
    clipped = _clipped(log.turn_rates)
    if not known or clipped:
        why = (
            f"the gyroscope is at its limit of {clipped:.3g} rad/s: the shake is larger than it tells"
            if clipped
            else f"needs {LEAST_S:g} s without a gap, and none of {times[-1]:.1f} s is that long"
        )
        return Measured(log.name, (rate,), {"jitter": why})
    doubts: list[str] = []
    if seconds < 0.8 * times[-1]:
        doubts.append(f"only {seconds:.1f} of {times[-1]:.1f} s are in stretches of {LEAST_S:g} s without a gap")
    readings = [times]
    uneven = float(np.mean(np.abs(lasts / usual - np.rint(lasts / usual)) > 0.2))
    if uneven > 0.05:
        doubts.append(f"{100 * uneven:.0f} % of the samples come at uneven times: the interval holds even ones, too")
        readings.append(times[-1] * np.arange(count) / (count - 1.0))
    up, doubt = _vertical(log)
    doubts += [doubt] if doubt else []
    ups = [up] if up is not None else list(np.eye(3)[[2, 1, 0]])
    found: list[list[Quantity]] = []
    for instants in readings:
        for axis in ups:
            turned = log.turn_rates @ _camera_axes(axis).T
            turns = 0.5 * (turned[1:] + turned[:-1]) * np.diff(instants)[:, None]
            evens = [evened(turns[own], instants[own.start : own.stop + 1], usual) for own in known]
            found.append(jitter_quantities(spectrum_of_turns(evens, evens, 1.0 / usual), count, _SCALE))
    every = [
        replace(own[0], low=min(one.low for one in own), high=max(one.high for one in own))
        for own in zip(*found, strict=True)
    ]
    (shake,) = (one.value for one in every if one.name == "jitter")
    if shake > _MOST_DEG:
        doubts.append(f"no camera sees anything that shakes by {shake:.3g} deg RMS: the unit of turns may be wrong")
    return Measured(log.name, (rate, *every), {}, tuple(doubts))


def _clipped(rates: FloatArray) -> float:
    """The rate at which samples stay in a row while other axes go on; 0 for none."""
    moves = (np.diff(rates, axis=0) != 0.0).any(axis=1)
    for values in np.abs(rates).T:
        at = values > (1.0 - 1e-6) * values.max()
        steps = np.abs(np.diff(values, prepend=0.0, append=0.0))
        fine = float(np.min(steps[steps > 0.0], initial=np.inf))
        flat = np.flatnonzero(at[1:] & at[:-1] & moves)
        runs = np.split(flat, np.flatnonzero(np.diff(flat) > 1) + 1)
        # A rounded peak of a slow turn stays within a step of rounding: a clipped one is reached by a larger one.
        if any(len(own) >= _CLIPPED - 1 and steps[own[0]] > 5.0 * fine for own in runs if len(own)):
            return float(values.max())
    return 0.0


def _vertical(log: ImuLog) -> tuple[FloatArray | None, str]:
    """`(3,)` unit vector upwards in the sensor's axes, None if it is not known; and a doubt, empty for none."""
    alone = "which axis points upwards is not known (the interval holds all), and nothing confirms unit and times"
    if log.accelerations is None:
        return None, f"no accelerometer: {alone}"
    mean = log.accelerations.mean(axis=0)
    size = float(np.linalg.norm(mean))
    if not any(abs(size / one - 1.0) < 0.15 for one in (1.0, _GRAVITY_M_S2)):
        return None, f"the mean acceleration is {size:.3g}, and gravity is 9.81 m/s2 or 1 g: {alone}"
    up = mean / size
    rate = (len(log.times_s) - 1) / float(log.times_s[-1])
    slope, error = _slope(np.cumsum(np.cross(up, log.turn_rates), axis=0) / rate, log.accelerations / size, rate)
    if slope + 2.0 * error < _LEAST_SLOPE:
        return up, (
            f"where the gyroscope turns by 1 degree the accelerometer tilts by {slope:.2g} (at most "
            f"{slope + 2.0 * error:.2g}): on wheels or legs the unit of turns or times is wrong; what hangs or flies "
            "is so"
        )
    return up, ""


def _slope(by_gyro: FloatArray, by_accelerometer: FloatArray, rate_hz: float) -> tuple[float, float]:
    """How far the `(N, 3)` vertical of one sensor tilts with that of the other, by octaves, and its standard error."""
    slopes, weights = list[float](), list[float]()
    for low in _OCTAVES_HZ:
        if 2.0 * low > 0.4 * rate_hz:
            break
        sos: Any = scipy.signal.butter(2, (low, 2.0 * low), "bandpass", fs=rate_hz, output="sos")
        turned, tilted = (
            np.asarray(scipy.signal.sosfiltfilt(sos, one - one[0], axis=0), dtype=np.float64)
            for one in (by_gyro, by_accelerometer)
        )
        power = max(float((turned**2).sum()), 1e-30)
        slopes.append(float((turned * tilted).sum()) / power)
        freedom = 4.0 * low * len(turned) / rate_hz  # Of two axes
        weights.append(power * freedom / max(float(((tilted - slopes[-1] * turned) ** 2).sum()), 1e-30))
    return float(np.average(slopes, weights=weights)), sum(weights) ** -0.5


def _camera_axes(up: FloatArray) -> FloatArray:
    """`(3, 3)` axes of pitch, yaw and roll in those of the sensor.

    Roll is about the axis that points ahead by custom: x where z is vertical (robots), else z (cameras, phones).
    """
    ahead = np.eye(3)[0 if np.abs(up).argmax() == 2 else 2]
    roll = ahead - (ahead @ up) * up
    roll /= np.linalg.norm(roll)
    return np.array([np.cross(up, roll), up, roll], dtype=np.float64)
