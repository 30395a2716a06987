"""How joints move in normal walking: published means over a stride, kept as a few Fourier harmonics.

The sagittal angles of thigh, knee and ankle are rounded means of adults at natural cadence, read off the normative
curves of Winter, "Biomechanics and Motor Control of Human Movement" (2009), appendix A, and Perry and Burnfield, "Gait
Analysis" (2010), part II. A stride runs from heel contact to the next heel contact of the same foot; the other leg is
half a stride later. How stride, stance and the path of the trunk change with speed is from the sources named below.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_HARMONICS = 5

# Every 5 % of a stride from heel contact [deg]; flexion and dorsiflexion are positive, the thigh against the vertical.
_THIGH = (23, 22, 20, 16, 11.5, 7, 2.5, -2, -6.5, -11, -14.5, -15.5, -12, -4, 6, 14.5, 20.5, 24.5, 26, 25)
_KNEE = (5, 11, 16, 18, 17.5, 15, 12, 9, 7.5, 8.5, 13, 22, 37, 53, 62, 61.5, 51, 33, 15, 5)
_ANKLE = (0, -4, -5, -2, 2, 4.5, 6.5, 8, 9.5, 10, 8, 1.5, -10, -18, -15, -8, -3, 0, 1, 1)


def _harmonics_of(samples: ArrayLike) -> Array:
    """`(2 * _HARMONICS + 1,)` least-squares coefficients: mean, then cosine and sine of each harmonic [rad]."""
    values = np.radians(np.asarray(samples, dtype=float))
    found = np.linalg.lstsq(_basis(np.arange(len(values)) / len(values)), values, rcond=None)[0]
    return np.asarray(found, dtype=np.float64)


def _basis(cycle: Array) -> Array:
    turn = 2.0 * np.pi * cycle[..., None] * np.arange(1, _HARMONICS + 1)
    return np.concatenate([np.ones((*cycle.shape, 1)), np.cos(turn), np.sin(turn)], axis=-1)


_COEFFICIENTS = np.stack([_harmonics_of(samples) for samples in (_THIGH, _KNEE, _ANKLE)], axis=1)


def leg_angles(cycle: ArrayLike) -> tuple[Array, Array, Array]:
    """Thigh against the vertical, knee flexion, ankle dorsiflexion [rad].

    Args:
        cycle: Share of the stride since this foot's heel contact; any shape, any real number.
    """
    angles = _basis(np.asarray(cycle, dtype=float)) @ _COEFFICIENTS
    return angles[..., 0], angles[..., 1], angles[..., 2]


def stride_length(speed_m_s: ArrayLike, height_m: ArrayLike) -> Array:
    """Length of a stride (two steps) at a speed [m].

    Stride frequency grows with the 0.57th power of speed in statures per second, 64.8 strides a minute at one (Grieve
    and Gear, Ergonomics 9:379, 1966; Grieve, Physiotherapy 54:283, 1968), so length grows with its 0.43rd power.
    """
    height = np.asarray(height_m, dtype=float)
    return np.asarray(height * (60.0 / 64.8) * np.maximum(np.asarray(speed_m_s) / height, 1e-4) ** 0.43)


def stance_share(speed_m_s: Array) -> Array:
    """Share of the stride a foot stays on the ground: 62 % at natural speed, less when faster.

    A linear fit to Murray et al., American Journal of Physical Medicine 45:8 (1966), and Murray et al., Acta
    Orthopaedica Scandinavica 55 (1984).
    """
    return np.clip(0.70 - 0.06 * speed_m_s, 0.55, 0.70)


def sideways_sway(speed_m_s: Array) -> Array:
    """Amplitude of the trunk's sway towards the foot it stands on [m].

    Half of the 7.0 cm peak to peak at 0.7 m/s and 3.9 cm at 1.6 m/s that Orendurff et al. measured, Journal of
    Rehabilitation Research and Development 41:829 (2004); it vanishes with the speed.
    """
    return np.clip(0.0471 - 0.0172 * speed_m_s, 0.012, 0.035) * once_moving(speed_m_s)


def bob(speed_m_s: Array) -> Array:
    """Vertical travel of the pelvis, peak to peak [m]: 2.7 cm at 0.7 m/s, 4.8 cm at 1.6 m/s (Orendurff et al. 2004)."""
    return np.clip(0.0111 + 0.0232 * speed_m_s, 0.0, 0.075) * once_moving(speed_m_s)


def once_moving(speed_m_s: Array) -> Array:
    """0 at rest, rising smoothly to 1 at 0.4 m/s."""
    share = np.clip(speed_m_s / 0.4, 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


def shoulder_angles(cycle: Array, swing: Array) -> Array:
    """Flexion of the shoulder [rad]: 24 deg back near the same side's heel contact, 8 deg forward near the other's.

    Murray, American Journal of Physical Medicine 46:290 (1967), at natural speed, where `swing` is 1.
    """
    return np.radians(-6.0) * np.minimum(swing, 1.0) - np.radians(16.0) * swing * np.cos(2.0 * np.pi * (cycle - 0.03))


def elbow_angles(cycle: Array, swing: Array) -> Array:
    """Flexion of the elbow [rad]: most as the arm swings forward (Murray 1967, as `shoulder_angles`)."""
    return np.radians(13.0) + np.radians(11.0) * swing * (1.0 - 0.85 * np.cos(2.0 * np.pi * (cycle - 0.06)))
