"""Power of a shake over frequency, its RMS with an interval, and the band that it fills.

Spectra are Welch's (1967): Hann windows of 4 s, half overlapping. From video they are cross spectra of two estimates
from separate features, so that the errors of each, which are independent, average out instead of adding up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy

from pftrack_sim.core.types import FloatArray

_WINDOW_S = 4.0
_LINE: Any = "linear"  # The stubs of SciPy know "constant" alone
_FADING = 1.94  # A Hann window's variance is that of a stretch shorter by this
_OVERLAP = 0.056  # Twice the squared correlation of half overlapping ones


@dataclass(frozen=True, eq=False)
class Spectrum:
    """One-sided power spectral density of three angles.

    Attributes:
        hz: `(F,)` frequencies, evenly spaced.
        density: `(3, F)` of pitch, yaw and roll [deg^2 / Hz].
        seconds: Length of what it is from, as far as windows that fade in and out weigh it.
        windows: Number of independent windows averaged.
    """

    hz: FloatArray
    density: FloatArray
    seconds: float
    windows: float


class Estimate(NamedTuple):
    """A value and its 95 % interval."""

    value: float
    low: float
    high: float


def spectrum_of_turns(first: Sequence[FloatArray], second: Sequence[FloatArray], rate_hz: float) -> Spectrum:
    """Spectrum of the angles whose change from sample to sample has been estimated twice.

    Args:
        first: Stretches of `(N, 3)` turns between successive samples [rad].
        second: The same by the other estimate.
        rate_hz: Samples per second.
    """
    size = min(round(_WINDOW_S * rate_hz), max(len(one) for one in first))
    total, windows = np.zeros((3, size // 2 + 1)), 0.0
    for a, b in zip(first, second, strict=True):
        if len(a) < size:
            continue
        cross: Any = scipy.signal.csd(
            np.degrees(a), np.degrees(b), rate_hz, "hann", size, size // 2, detrend=_LINE, axis=0
        )[1]
        count = 1 + (len(a) - size) // (size - size // 2)
        total += count * np.asarray(cross.real, dtype=np.float64).T
        windows += count
    hz = rate_hz / size * np.arange(size // 2 + 1, dtype=np.float64)
    # A turn is the difference of two angles.
    with np.errstate(divide="ignore", invalid="ignore"):
        density = total / windows / (4.0 * np.sin(np.pi * hz / rate_hz) ** 2)
    density[:, 0] = 0.0
    independent = windows / (1.0 + _OVERLAP * (1.0 - 1.0 / windows))
    return Spectrum(hz, density, independent * size / rate_hz / _FADING, independent)


def rms_above(found: Spectrum, above_hz: float) -> tuple[Estimate, list[Estimate]]:
    """RMS of the angles above a frequency [deg]: of pitch and roll together (root mean square), and of each of three.

    Their squares are taken for chi-square distributed, with the degrees of freedom of a Gaussian process with this
    spectrum: 2 T (integral of S)^2 / integral of S^2 (Blackman and Tukey 1958).
    """
    step = found.hz[1]
    inside = np.clip((found.hz + 0.5 * step - above_hz) / step, 0.0, 1.0)
    power = np.maximum((found.density * inside).sum(axis=1) * step, 1e-12)
    # The square of an average of windows is too large by its own variance.
    squares = (found.density**2 * inside).sum(axis=1) * step / (1.0 + 1.0 / found.windows)
    variance = np.maximum(squares, 1e-24) / found.seconds
    each = [_estimate(one, spread) for one, spread in zip(power, variance, strict=True)]
    shake = [0, 2]
    return _estimate(float(power[shake].mean()), float(variance[shake].sum() / 4.0)), each


def _estimate(power: float, variance: float) -> Estimate:
    freedom = max(1.0, 2.0 * power**2 / variance)
    low, high = (float(scipy.stats.chi2.ppf(share, freedom)) for share in (0.975, 0.025))
    return Estimate(math.sqrt(power), math.sqrt(power * freedom / low), math.sqrt(power * freedom / high))


def band_of(found: Spectrum, above_hz: float) -> tuple[float, float]:
    """Lowest and highest frequency of a flat spectrum whose power is spread as that of a shake.

    From the frequencies below which 10 and 90 % of the power of pitch and roll are.
    """
    step = found.hz[1]
    inside = found.hz + 0.5 * step > above_hz
    power = np.maximum(found.density[[0, 2]].mean(axis=0)[inside], 0.0)
    below = np.cumsum(power) / max(float(power.sum()), 1e-30)
    upper = np.asarray(found.hz[inside] + 0.5 * step, dtype=np.float64)
    low, high = (float(np.interp(share, below, upper)) for share in (0.1, 0.9))
    margin = (high - low) / 8.0
    low = max(above_hz, low - margin)
    return low, min(max(high + margin, low + step), float(found.hz[-1]))
