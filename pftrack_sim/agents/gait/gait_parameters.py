"""Gait parameters as functions of speed: published relations, tabulated once per person."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from pftrack_sim.agents.gait.joint_trajectories import heel_strike_pitch, rolled_ankle, stance_pitch, toe_off_pitch
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.people.anatomy import Anatomy

MAX_EXTENSION = 0.9982  # longest reach of a leg relative to the sum of its links: knees never lock
_MAX_SPEED_M_S = 2.6
_STEP_M_S = 0.04
_SPEEDS_M_S = np.arange(0.0, _MAX_SPEED_M_S + 1.5 * _STEP_M_S, _STEP_M_S)

_MID_STANCE = 0.245  # phase at which a walker's body is above the ankle of the flat foot
# Below a half there are flight phases (Novacheck, "The biomechanics of running", Gait and Posture 7:77, 1998: 39 % at
# 3.2 m/s).
RUN_STANCE_FRACTION = 0.37


class GaitParameters(NamedTuple):
    """Gait parameters of `P` people at their speeds, `(P,)` each.

    Attributes:
        stride_m: Stride length (two steps).
        heel_strike_rad: Toes-up angle of the foot at heel strike.
        toe_off_rad: Heel-up angle of the foot at toe-off.
        clearance_m: Height of the sole in mid-swing.
        sway_m: Lateral amplitude of the pelvis.
        amplitude: Relative amplitude of the rotations of pelvis, trunk and arms; 1 at natural speed.
        mid_stance: Phase at which the body is above the ankle of the flat foot.
    """

    stride_m: FloatArray
    stance_fraction: FloatArray
    heel_strike_rad: FloatArray
    toe_off_rad: FloatArray
    hip_low_m: FloatArray
    hip_high_m: FloatArray
    clearance_m: FloatArray
    sway_m: FloatArray
    amplitude: FloatArray
    mid_stance: FloatArray


def stride_length(speed_m_s: ArrayLike, height_m: ArrayLike) -> FloatArray:
    """Stride length (two steps) [m].

    Stride frequency grows with the 0.57th power of speed in statures per second, 64.8 strides a minute at one (Grieve
    and Gear, Ergonomics 9:379, 1966; Grieve, Physiotherapy 54:283, 1968), so length grows with its 0.43rd power.
    """
    height = np.asarray(height_m, dtype=float)
    return np.asarray(height * (60.0 / 64.8) * np.maximum(np.asarray(speed_m_s) / height, 1e-4) ** 0.43)


@lru_cache(maxsize=64)
def walking_table(anatomy: Anatomy) -> FloatArray:
    """`(S, 9)` lookup table of all parameters but the last, at `S` speeds, for `walking_parameters`; read-only."""
    speed = _SPEEDS_M_S
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
    table = np.stack([stride, stance, heel_strike, toe_off, low, high, clearance, sway, amplitude], 1)
    table.setflags(write=False)
    return table


def walking_parameters(tables: FloatArray, speed_m_s: FloatArray) -> GaitParameters:
    """Parameters of walking at speeds `(P,)`, interpolated in `(P, S, 9)` tables."""
    return GaitParameters(*_interpolated(tables, speed_m_s))


@njit(cache=True, nogil=True)
def _interpolated(tables: FloatArray, speed_m_s: FloatArray) -> FloatArray:
    """`(10, P)` values of `(P, S, 9)` tables at speeds, and the constant last parameter."""
    values = np.full((tables.shape[2] + 1, len(speed_m_s)), _MID_STANCE)
    for person in range(len(speed_m_s)):
        place = min(speed_m_s[person], _MAX_SPEED_M_S) / _STEP_M_S
        below = int(place)
        share = place - below
        for column in range(tables.shape[2]):
            low, high = tables[person, below, column], tables[person, below + 1, column]
            values[column, person] = (1.0 - share) * low + share * high
    return values


def running_parameters(anatomies: Sequence[Anatomy], speed_m_s: FloatArray) -> GaitParameters:
    """Parameters of running at speeds `(P,)`: 1.25 to 1.5 strides a second (Novacheck 1998), landing on bent knees."""
    stride = speed_m_s / (1.22 + 0.06 * speed_m_s)
    height, leg, ankle = np.array([(one.height_m, one.thigh_m + one.shank_m, one.ankle_m) for one in anatomies]).T
    reach = 0.5 * RUN_STANCE_FRACTION * stride
    low = ankle + np.sqrt(np.maximum((0.965 * leg) ** 2 - (0.55 * reach) ** 2, 0.25 * leg**2))
    ones = np.ones_like(speed_m_s)
    return GaitParameters(
        stride_m=stride,
        stance_fraction=RUN_STANCE_FRACTION * ones,
        heel_strike_rad=0.10 * ones,
        toe_off_rad=0.85 * ones,
        hip_low_m=low,
        hip_high_m=low + 0.07 * ones,
        clearance_m=0.10 * height,
        sway_m=0.008 * ones,
        amplitude=1.35 * ones,
        mid_stance=0.5 * RUN_STANCE_FRACTION * ones,
    )


def blended(walk: GaitParameters, run: GaitParameters, share: FloatArray) -> GaitParameters:
    """Parameters `(P,)` between walking (share 0, unchanged to the bit) and running (share 1)."""
    return GaitParameters(*(np.where(share > 0.0, a + share * (b - a), a) for a, b in zip(walk, run, strict=True)))
