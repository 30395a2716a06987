"""Parameters of gait by speed, and joint and foot trajectories over the gait cycle, from published relations.

The sagittal angles of thigh, knee and ankle are rounded means of adults at natural cadence, read off the normative
curves of Winter, "Biomechanics and Motor Control of Human Movement" (2009), appendix A, and Perry and Burnfield, "Gait
Analysis" (2010), part II. A gait cycle (one stride) runs from heel strike to the next heel strike of the same foot;
the other leg is half a cycle later. Phases are fractions of the cycle since heel strike.

The sole is flat between two arcs. A pitched foot rolls on the heel's arc (toes up) or the toes' arc (heel up) without
slipping, so the point of contact of a foot in stance never moves over the ground.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.compiled import record_type
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.people.anatomy import Anatomy

Sole: TypeAlias = tuple[FloatArray | float, FloatArray | float, FloatArray | float, FloatArray | float]
"""As `Anatomy.sole_m`: x of the heel arc's centre, its radius, x of the toe arc's centre, its radius [m]."""

FOOT_FLAT = 0.13  # phase at which the foot is flat after heel strike
HEEL_RISE = 0.30  # phase at which the heel starts to leave the ground
DOWN_POWER, UP_POWER = 1.5, 2.7  # of the phases after heel strike and before toe-off in `stance_pitch`

MAX_EXTENSION = 0.9982  # longest reach of a leg relative to the sum of its links: knees never lock
# Below a half there are flight phases (Novacheck, "The biomechanics of running", Gait and Posture 7:77, 1998: 39 % at
# 3.2 m/s).
RUN_STANCE_FRACTION = 0.37
_MID_STANCE = 0.245  # phase at which a walker's body is above the ankle of the flat foot
_MAX_SPEED_M_S, _STEP_M_S = 2.6, 0.04  # of the tables

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


def _swing_trajectory() -> tuple[FloatArray, float, float]:
    """Published swing: `(65, 2)` travel and pitch relative to its ends; pitch at heel strike and toe-off [rad]."""
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
    relative_pitch = np.where(pitch < 0.0, pitch / toe_off, pitch / heel_strike)
    return np.stack([travel, relative_pitch], axis=1), heel_strike, toe_off


SWING, _HEEL_STRIKE, _TOE_OFF = _swing_trajectory()
"""`(65, 2)` over the progress of a swing: share of the way to the next foothold, pitch relative to its ends."""


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


PARAMETERS = record_type(
    [
        ("stride_m", "f8"),  # stride length: two steps
        ("stance_fraction", "f8"),
        ("heel_strike_rad", "f8"),  # toes-up angle of the foot at heel strike
        ("toe_off_rad", "f8"),  # heel-up angle of the foot at toe-off
        ("hip_low_m", "f8"),
        ("hip_high_m", "f8"),
        ("clearance_m", "f8"),  # height of the sole in mid-swing
        ("sway_m", "f8"),  # lateral amplitude of the pelvis
        ("amplitude", "f8"),  # of the rotations of pelvis, trunk and arms; 1 at natural speed
        ("mid_stance", "f8"),  # phase at which the body is above the ankle of the flat foot
    ]
)
"""Parameters of one person's gait at one speed."""


def stride_length(speed_m_s: ArrayLike, height_m: ArrayLike) -> FloatArray:
    """Stride length (two steps) [m].

    Stride frequency grows with the 0.57th power of speed in statures per second, 64.8 strides a minute at one (Grieve
    and Gear, Ergonomics 9:379, 1966; Grieve, Physiotherapy 54:283, 1968), so length grows with its 0.43rd power.
    """
    height = np.asarray(height_m, dtype=float)
    return np.asarray(height * (60.0 / 64.8) * np.maximum(np.asarray(speed_m_s) / height, 1e-4) ** 0.43)


@lru_cache(maxsize=64)
def parameter_table(anatomy: Anatomy) -> FloatArray:
    """`(S, 10)` rows of `PARAMETERS` of walking at speeds in steps of 0.04 m/s; read-only."""
    speed = np.arange(0.0, _MAX_SPEED_M_S + 1.5 * _STEP_M_S, _STEP_M_S)
    stride = stride_length(speed, anatomy.height_m)
    # Linear fit to Murray et al., American Journal of Physical Medicine 45:8 (1966), and Murray et al., Acta
    # Orthopaedica Scandinavica 55 (1984): 62 % at natural speed.
    stance = np.clip(0.70 - 0.06 * speed, 0.55, 0.70)
    # Smooth step from 0 at rest to 1 at 0.4 m/s.
    moving = np.clip(speed / 0.4, 0.0, 1.0)
    moving = moving * moving * (3.0 - 2.0 * moving)
    # Orendurff et al., Journal of Rehabilitation Research and Development 41:829 (2004), at 0.7 m/s and 1.6 m/s: 7.0 cm
    # and 3.9 cm of lateral, 2.7 cm and 4.8 cm of vertical travel of the trunk, peak to peak.
    sway = np.clip(0.0471 - 0.0172 * speed, 0.012, 0.035) * moving
    vertical_travel = np.clip(0.0111 + 0.0232 * speed, 0.0, 0.075) * moving
    heel_strike, toe_off = heel_strike_pitch(speed), toe_off_pitch(speed)
    leg = anatomy.thigh_m + anatomy.shank_m
    reach = 0.9995 * MAX_EXTENSION * leg
    # At heel strike the feet are farthest apart; the hips must be low enough for both legs to reach the ground.
    trailing_pitch = stance_pitch(np.full_like(speed, 0.5), stance, heel_strike, toe_off)
    leading_x, leading_z = rolled_ankle(heel_strike, anatomy.ankle_m, anatomy.sole_m)
    trailing_x, trailing_z = rolled_ankle(trailing_pitch, anatomy.ankle_m, anatomy.sole_m)
    leading_x = _MID_STANCE * stride + leading_x
    trailing_x = (0.5 - _MID_STANCE) * stride - trailing_x
    low = np.minimum(
        leading_z + np.sqrt(np.maximum(reach**2 - leading_x**2, 0.0)),
        trailing_z + np.sqrt(np.maximum(reach**2 - trailing_x**2, 0.0)),
    )
    upright = anatomy.ankle_m + 0.9976 * leg
    low = np.minimum(low, upright)
    high = np.minimum(low + np.maximum(vertical_travel, 0.80 * (upright - low)), upright)
    # Slow walkers hardly pitch their feet and lift them higher instead.
    clearance = anatomy.height_m * (0.011 + 0.014 * np.exp(-speed / 0.4))
    amplitude = stride / stride_length(1.3, anatomy.height_m) * moving
    mid_stance = np.full_like(speed, _MID_STANCE)
    table = np.stack([stride, stance, heel_strike, toe_off, low, high, clearance, sway, amplitude, mid_stance], axis=1)
    table.setflags(write=False)
    return table


def parameters_at(
    tables: FloatArray, anatomies: Sequence[Anatomy], speed_m_s: FloatArray, running: FloatArray
) -> NDArray[Any]:
    """`(P,)` records of `PARAMETERS` at speeds `(P,)`, between walking (running 0) and running (1).

    Args:
        tables: `(P, S, 10)` of `parameter_table`.
        anatomies: Of the `P` people.
        speed_m_s: `(P,)`.
        running: `(P,)` shares.
    """
    place = np.minimum(speed_m_s, _MAX_SPEED_M_S) / _STEP_M_S
    below, people = place.astype(np.intp), np.arange(len(place))
    share = (place - below)[:, None]
    values = (1.0 - share) * tables[people, below] + share * tables[people, below + 1]
    if running.any():
        values += running[:, None] * (_running(anatomies, speed_m_s) - values)
    return values.view(PARAMETERS)[:, 0]


def _running(anatomies: Sequence[Anatomy], speed_m_s: FloatArray) -> FloatArray:
    """`(P, 10)` rows of `PARAMETERS`: 1.25 to 1.5 strides a second (Novacheck 1998), landing on bent knees."""
    stride = speed_m_s / (1.22 + 0.06 * speed_m_s)
    height, leg, ankle = np.array([(one.height_m, one.thigh_m + one.shank_m, one.ankle_m) for one in anatomies]).T
    reach = 0.5 * RUN_STANCE_FRACTION * stride
    low = ankle + np.sqrt(np.maximum((0.965 * leg) ** 2 - (0.55 * reach) ** 2, 0.25 * leg**2))
    run = np.zeros(len(stride), PARAMETERS)
    run["stride_m"], run["hip_low_m"], run["hip_high_m"] = stride, low, low + 0.07
    run["stance_fraction"], run["mid_stance"] = RUN_STANCE_FRACTION, 0.5 * RUN_STANCE_FRACTION
    run["heel_strike_rad"], run["toe_off_rad"] = 0.10, 0.85
    run["clearance_m"], run["sway_m"], run["amplitude"] = 0.10 * height, 0.008, 1.35
    return run.view(np.float64).reshape(len(stride), -1)
