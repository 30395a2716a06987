"""Level of the jitter axis: rotation of the camera above 1 Hz."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.measuring.measured import Quantity
from pftrack_sim.measuring.motion import Step
from pftrack_sim.measuring.spectrum import Estimate, Spectrum, band_of, rms_above, spectrum_of_turns

ABOVE_HZ = 1.0
"""Slower turns are taken for intended: a robot's head or a hand that keeps a person in view."""

LEAST_S = 4.0
_MOST_UNKNOWN = 3  # Successive steps that are bridged
_ANGLES = ("pitch", "yaw", "roll")


class Untold(Exception):
    """A quantity that the material does not tell; the message is the reason."""


def cuts(steps: Sequence[Step]) -> list[int]:
    """Indices of the steps over which the scene changes."""
    usual = float(np.median([one.difference for one in steps]))
    return [index for index, one in enumerate(steps) if not one.known and one.difference > max(3.0 * usual, 12.0)]


def stretches(steps: Sequence[Step], times_s: FloatArray) -> list[slice]:
    """Steps between cuts, and between longer gaps in what is known; each at least 4 s long."""
    ends, unknown = set(cuts(steps)), 0
    for index, one in enumerate(steps):
        unknown = 0 if one.known else unknown + 1
        if unknown > _MOST_UNKNOWN:
            ends.add(index)
    return stretches_between(ends, times_s)


def stretches_between(ends: set[int], times_s: FloatArray) -> list[slice]:
    """Steps that lie between the steps `ends`, and between longer gaps of the times `(N,)`; each at least 4 s long."""
    lasts = np.diff(times_s)
    ends = ends | set(np.flatnonzero(lasts > _MOST_UNKNOWN * float(np.median(lasts))).tolist())
    found = (slice(first + 1, last) for first, last in itertools.pairwise(sorted({-1, *ends, len(lasts)})))
    return [one for one in found if one.stop > one.start and times_s[one.stop] - times_s[one.start] >= LEAST_S]


def turn_rates(steps: Sequence[Step], times_s: FloatArray, own: slice) -> tuple[FloatArray, BoolArray]:
    """Rates of pitch and yaw at the `N + 1` frames of a stretch, `(N + 1, 2)` [rad/s], and which `N` steps are told."""
    known = np.array([one.known for one in steps[own]])
    turns = np.array([one.rotation[:2] for one in steps[own]])
    for angle in range(2):
        turns[:, angle] = np.interp(np.arange(len(turns)), np.flatnonzero(known), turns[known, angle])
    times = times_s[own.start : own.stop + 1]
    angles = np.concatenate([np.zeros((1, 2)), np.cumsum(turns, axis=0)])
    known[:2] = known[-2:] = False  # Where the spline ends
    return np.asarray(scipy.interpolate.CubicSpline(times, angles)(times, 1), dtype=np.float64), known


@dataclass(frozen=True)
class Systematic:
    """What widens intervals beyond chance.

    Attributes:
        focal_share: Least and greatest focal length as shares of that in use.
        frozen_deg: Shake that may be missing: an encoder repeats blocks that have hardly moved.
        shrunk: Share by which the shake may be too small for the same reason.
    """

    focal_share: tuple[float, float] = (1.0, 1.0)
    frozen_deg: float = 0.0
    shrunk: float = 0.0

    def widened(self, one: Estimate, *, roll: bool = False) -> tuple[float, float]:
        """Ends of the interval of an angle; roll does not depend on the focal length."""
        shortest, longest = (1.0, 1.0) if roll else self.focal_share
        return one.low / longest, math.hypot(one.high * (1.0 + self.shrunk), self.frozen_deg) / shortest


def measure_jitter(steps: Sequence[Step], times_s: FloatArray, systematic: Systematic) -> list[Quantity]:
    """RMS of pitch, yaw and roll above 1 Hz, and of pitch and roll together as the axis has it.

    Args:
        steps: `N - 1` steps between frames.
        times_s: `(N,)` times of the frames.
        systematic: What widens the intervals.

    Raises:
        Untold: The background is not seen for long enough.
    """
    known = stretches(steps, times_s)
    if not known:
        raise Untold(_why(steps, times_s))
    usual = float(np.median(np.diff(times_s)))
    rotation = np.array([one.rotation for one in steps])
    halves = np.array([one.parts[:2] for one in steps])
    # Where one half has too few corners, both take the rotation of the whole.
    both = np.isfinite(halves).all(axis=(1, 2))
    halves[~both] = rotation[~both, None]
    first, second = (
        [evened(halves[own, half], times_s[own.start : own.stop + 1], usual) for own in known] for half in range(2)
    )
    found = spectrum_of_turns(first, second, 1.0 / usual)
    frames = sum(own.stop - own.start for own in known)
    return jitter_quantities(found, frames, systematic)


def jitter_quantities(found: Spectrum, frames: int, systematic: Systematic) -> list[Quantity]:
    """The same from a spectrum."""
    together, each = rms_above(found, ABOVE_HZ)
    band = band_of(found, ABOVE_HZ)
    settings = {
        "jitter.angular_rms_deg": 0.0,
        "jitter.translational_rms_mm": 0.0,
        "axes.jitter.severity": 1.0,
        "axes.jitter.sources": ["ground"],
        "axes.jitter.ground_rms_deg": together.value,
        "axes.jitter.ground_rms_mm": 0.0,
        "axes.jitter.ground_band_hz": list(band),
    }
    ends = systematic.widened(together)
    quantities = [Quantity("jitter", together.value, *ends, "deg RMS", frames, "jitter", settings)]
    for name, one in zip(_ANGLES, each, strict=True):
        ends = systematic.widened(one, roll=name == "roll")
        quantities.append(Quantity(f"{name} above {ABOVE_HZ:g} Hz", one.value, *ends, "deg RMS", frames))
    return quantities


def evened(turns: FloatArray, times_s: FloatArray, step_s: float) -> FloatArray:
    """Turns between evenly spaced instants, from the angle through what is known of it (cubic spline)."""
    lasts = np.diff(times_s)[:, None]
    rates, good = turns / lasts, np.isfinite(turns[:, 0])
    # Over steps that are not known the camera turns as before and after, on average.
    for axis in range(3):
        rates[:, axis] = np.interp(times_s[1:], times_s[1:][good], rates[good, axis])
    angles = np.concatenate([np.zeros((1, 3)), np.cumsum(rates * lasts, axis=0)])
    instants = times_s[0] + step_s * np.arange(int((times_s[-1] - times_s[0]) / step_s + 1e-6) + 1)
    return np.diff(scipy.interpolate.CubicSpline(times_s, angles)(instants), axis=0)


def _why(steps: Sequence[Step], times_s: FloatArray) -> str:
    known = float(np.mean([one.known for one in steps]))
    if known > 0.5:
        return f"needs {LEAST_S:g} s without a cut or a gap, and none of {times_s[-1]:.1f} s is that long"
    unknown = [one for one in steps if not one.known]
    if np.median([one.corners for one in unknown]) < 30:
        return f"the frames have too little texture: the background is followed in {100 * known:.0f} % of them"
    return (
        f"most of what has texture moves by itself, or covers too little of the image: a background is found in "
        f"{100 * known:.0f} % of the frames"
    )
