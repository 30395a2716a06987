"""Joint and foot trajectories over the gait cycle, from published curves.

The sagittal angles of thigh, knee and ankle are rounded means of adults at natural cadence, read off the normative
curves of Winter, "Biomechanics and Motor Control of Human Movement" (2009), appendix A, and Perry and Burnfield, "Gait
Analysis" (2010), part II. A gait cycle (one stride) runs from heel strike to the next heel strike of the same foot;
the other leg is half a cycle later. Phases are fractions of the cycle since heel strike.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.gait.walk import rolled_ankle
from pftrack_sim.core.types import FloatArray

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


def _swing_trajectory() -> FloatArray:
    toe_off_phase, leg, stride, ankle = 0.62, 0.245, 0.82, 0.045
    phase = np.linspace(toe_off_phase, 1.0, 65)
    thigh, knee, dorsiflexion = leg_angles(phase)
    pitch = thigh - knee + dorsiflexion
    # The path of the ankle over the ground, less the contribution of the rolling sole, is the path of the foot.
    x = stride * phase + leg * (np.sin(thigh) + np.sin(thigh - knee))
    ahead, _ = rolled_ankle(pitch, ankle, np.where(pitch > 0.0, -0.03, 0.102), np.where(pitch > 0.0, 0.016, 0.028))
    progress = np.linspace(0.0, 1.0, 65)
    travel = np.maximum.accumulate((x - ahead) - (x - ahead)[0])
    # Blended with a smooth step, so that the foot is at rest at both ends.
    travel = 0.5 * np.clip(travel / travel[-1], 0.0, 1.0) + 0.5 * (progress**2 * (3.0 - 2.0 * progress))
    return np.stack([travel, pitch], axis=1)


SWING = _swing_trajectory()
"""`(65, 2)` over the progress of a swing: share of the way to the next foothold, and pitch [rad], toes up."""
