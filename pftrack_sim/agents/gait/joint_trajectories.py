"""Joint and foot trajectories over the gait cycle, from published means of normal walking.

The sagittal angles of thigh, knee and ankle are rounded means of adults at natural cadence, read off the normative
curves of Winter, "Biomechanics and Motor Control of Human Movement" (2009), appendix A, and Perry and Burnfield, "Gait
Analysis" (2010), part II. A gait cycle (one stride) runs from heel strike to the next heel strike of the same foot;
the other leg is half a cycle later. Phases are fractions of the cycle since heel strike.

The sole is flat between two arcs. A pitched foot rolls on the heel's arc (toes up) or the toes' arc (heel up) without
slipping, so the point of contact of a foot in stance never moves over the ground.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.gait.foot_kernels import FOOT_FLAT, HEEL_RISE
from pftrack_sim.core.types import FloatArray

Sole: TypeAlias = tuple[FloatArray | float, FloatArray | float, FloatArray | float, FloatArray | float]
"""As `Anatomy.sole_m`: x of the heel arc's centre, its radius, x of the toe arc's centre, its radius [m]."""

DOWN_POWER, UP_POWER, LIFT_POWER = 1.5, 2.7, 1.2
"""Of the phases after heel strike and before toe-off in `stance_pitch`, and of a sine over the swing in the lift."""

_HARMONICS = 5

# Every 5 % of a cycle from heel strike [deg]; flexion and dorsiflexion are positive, the thigh against the vertical.
_THIGH = (23, 22, 20, 16, 11.5, 7, 2.5, -2, -6.5, -11, -14.5, -15.5, -12, -4, 6, 14.5, 20.5, 24.5, 26, 25)
_KNEE = (5, 11, 16, 18, 17.5, 15, 12, 9, 7.5, 8.5, 13, 22, 37, 53, 62, 61.5, 51, 33, 15, 5)
_ANKLE = (0, -4, -5, -2, 2, 4.5, 6.5, 8, 9.5, 10, 8, 1.5, -10, -18, -15, -8, -3, 0, 1, 1)


def _fourier_basis(phase: FloatArray) -> FloatArray:
    """`(..., 2 * _HARMONICS + 1)`: 1, then cosines and sines of the harmonics."""
    angle = 2.0 * np.pi * phase[..., None] * np.arange(1, _HARMONICS + 1)
    return np.concatenate([np.ones((*phase.shape, 1)), np.cos(angle), np.sin(angle)], axis=-1)


def _fourier_coefficients(samples_deg: ArrayLike) -> FloatArray:
    """`(2 * _HARMONICS + 1,)` least-squares coefficients [rad]."""
    values = np.radians(np.asarray(samples_deg, dtype=float))
    solution = np.linalg.lstsq(_fourier_basis(np.arange(len(values)) / len(values)), values, rcond=None)[0]
    return np.asarray(solution, dtype=np.float64)


_COEFFICIENTS = np.stack([_fourier_coefficients(samples) for samples in (_THIGH, _KNEE, _ANKLE)], axis=1)


def leg_angles(phase: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Thigh against the vertical, knee flexion and ankle dorsiflexion [rad], each of the shape of `phase`."""
    angles = _fourier_basis(np.asarray(phase, dtype=float)) @ _COEFFICIENTS
    return angles[..., 0], angles[..., 1], angles[..., 2]


def rolled_ankle(pitch: FloatArray, ankle_m: FloatArray | float, sole: Sole) -> tuple[FloatArray, FloatArray]:
    """Ankle of a foot that rolls on the ground: x ahead of the flat foot's ankle, and height above the ground [m].

    `pitch` is positive with toes up [rad]; `ankle_m` is the height of the ankle above the sole.
    """
    heel_x, heel_radius, toe_x, toe_radius = sole
    centre = np.where(pitch > 0.0, heel_x, toe_x)
    radius = np.where(pitch > 0.0, heel_radius, toe_radius)
    cos, sin = np.cos(pitch), np.sin(pitch)
    above = ankle_m - radius
    return centre - radius * pitch - centre * cos - above * sin, radius - centre * sin + above * cos


def _swing_trajectory() -> tuple[FloatArray, FloatArray, FloatArray, float, float]:
    """Published swing: progress, travel, pitch relative to its ends; pitch at heel strike and toe-off [rad]."""
    toe_off_phase, leg, stride, ankle = 0.62, 0.245, 0.82, 0.045
    phase = np.linspace(toe_off_phase, 1.0, 65)
    thigh, knee, dorsiflexion = leg_angles(phase)
    pitch = thigh - knee + dorsiflexion
    heel_strike, toe_off = float(pitch[-1]), float(-pitch[0])
    # The path of the ankle over the ground, less the contribution of the rolling sole, is the path of the foot.
    x = stride * phase + leg * (np.sin(thigh) + np.sin(thigh - knee))
    ahead, _ = rolled_ankle(pitch, ankle, (-0.03, 0.016, 0.102, 0.028))
    progress = np.linspace(0.0, 1.0, 65)
    travel = np.maximum.accumulate((x - ahead) - (x - ahead)[0])
    # Blended with a smooth step, so that the foot is at rest at both ends.
    travel = 0.5 * np.clip(travel / travel[-1], 0.0, 1.0) + 0.5 * (progress**2 * (3.0 - 2.0 * progress))
    return progress, travel, np.where(pitch < 0.0, pitch / toe_off, pitch / heel_strike), heel_strike, toe_off


_PROGRESS, _TRAVEL, _RELATIVE_PITCH, _HEEL_STRIKE, _TOE_OFF = _swing_trajectory()
SWING = _PROGRESS, _TRAVEL, _RELATIVE_PITCH
"""Progress, fraction of the way to the next foothold, and pitch relative to that at toe-off or heel strike."""


def heel_strike_pitch(speed_m_s: FloatArray) -> FloatArray:
    """Toes-up angle of the foot at heel strike [rad]: the published 18 deg at natural speed, less when slower."""
    return _HEEL_STRIKE * 1.25 * (1.0 - np.exp(-speed_m_s / 0.8))


def toe_off_pitch(speed_m_s: FloatArray) -> FloatArray:
    """Heel-up angle of the foot at toe-off [rad], positive: about 57 deg at natural speed.

    That is less than the published 67 deg, because the toes of the shoe do not bend.
    """
    return _TOE_OFF * 0.97 * (1.0 - np.exp(-speed_m_s / 0.6))


def stance_pitch(
    phase: FloatArray, stance_fraction: FloatArray, heel_strike_rad: FloatArray, toe_off_rad: FloatArray
) -> FloatArray:
    """Pitch of a foot in stance, toes up positive [rad]: down from heel strike, flat, heel up to toe-off."""
    down = np.maximum(1.0 - phase / FOOT_FLAT, 0.0)
    up = np.minimum(np.maximum((phase - HEEL_RISE) / (stance_fraction - HEEL_RISE), 0.0), 1.0)
    return heel_strike_rad * down**DOWN_POWER - toe_off_rad * up**UP_POWER
