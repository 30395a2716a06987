"""What one person's gait is like at each speed: a table to look up instead of formulas to evaluate at every tick."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.agents.gait import foot_roll as soles
from pftrack_sim.agents.gait import joint_trajectories as curves
from pftrack_sim.agents.gait.leg_kinematics import STRAIGHT
from pftrack_sim.scene.people.anatomy import Anatomy

Array = NDArray[np.float64]

TOP_SPEED_M_S = 2.6
_STEP_M_S = 0.04
_SPEEDS = np.arange(0.0, TOP_SPEED_M_S + 1.5 * _STEP_M_S, _STEP_M_S)


class GaitParameters(NamedTuple):
    """Numbers that depend on speed alone, `(P,)` each.

    Attributes:
        stride_m: Length of a stride.
        stance: Share of the stride a foot stands.
        strike_rad: Toes-up angle of the foot at contact.
        push_rad: Heel-up angle of the foot at lift-off.
        low_m: Lowest height of the hips over the ground.
        high_m: Highest height of the hips.
        clearance_m: Of a foot's sole in the middle of its swing.
        sway_m: Amplitude of the pelvis to the sides.
        vigour: 1 at natural speed: how far pelvis, trunk and arms swing.
    """

    stride_m: Array
    stance: Array
    strike_rad: Array
    push_rad: Array
    low_m: Array
    high_m: Array
    clearance_m: Array
    sway_m: Array
    vigour: Array


def table(anatomy: Anatomy) -> Array:
    """`(S, 9)` gauges at `S` speeds, for `look_up`."""
    speed = _SPEEDS
    stride = curves.stride_length(speed, anatomy.height_m)
    stance = curves.stance_share(speed)
    strike, push = soles.heel_strike_pitch(speed), soles.toe_off_pitch(speed)
    heel_x, heel_r, toe_x, toe_r = (np.full_like(speed, value) for value in anatomy.sole_m)
    ankle = np.full_like(speed, anatomy.ankle_m)
    reach = 0.9995 * STRAIGHT * (anatomy.thigh_m + anatomy.shank_m)

    # Both legs must reach the ground at contact, when they are farthest apart: that is how low the hips must come.
    behind_pitch = soles.stance_pitch(np.full_like(speed, 0.5), stance, strike, push)
    lead_roll, lead_z = soles.rolled(strike, ankle, (heel_x, heel_r), (toe_x, toe_r))
    trail_roll, trail_z = soles.rolled(behind_pitch, ankle, (heel_x, heel_r), (toe_x, toe_r))
    lead = soles.UNDERFOOT * stride + lead_roll
    trail = (0.5 - soles.UNDERFOOT) * stride - trail_roll
    low = np.minimum(
        lead_z + np.sqrt(np.maximum(reach**2 - lead**2, 0.0)), trail_z + np.sqrt(np.maximum(reach**2 - trail**2, 0.0))
    )
    upright = anatomy.ankle_m + 0.9976 * (anatomy.thigh_m + anatomy.shank_m)
    low = np.minimum(low, upright)
    high = np.minimum(low + np.maximum(curves.bob(speed), 0.80 * (upright - low)), upright)
    # Feet that hardly pitch must be lifted instead.
    clearance = anatomy.height_m * (0.011 + 0.014 * np.exp(-speed / 0.4))
    vigour = stride / curves.stride_length(1.3, anatomy.height_m) * curves.once_moving(speed)
    return np.stack([stride, stance, strike, push, low, high, clearance, curves.sideways_sway(speed), vigour], axis=1)


RUN_STANCE = 0.37
"""Share of the stride a runner's foot stands: below a half, both are in the air in between (Novacheck, "The
biomechanics of running", Gait and Posture 7:77, 1998: 39 % at 3.2 m/s)."""


def run_gauge(anatomies: Sequence[Anatomy], speed_m_s: Array) -> GaitParameters:
    """Gauges of running at speeds `(P,)`: strides of 1.25 to 1.5 a second (Novacheck 1998), a soft landing."""
    stride = speed_m_s / (1.22 + 0.06 * speed_m_s)
    height = np.array([one.height_m for one in anatomies])
    leg = np.array([one.thigh_m + one.shank_m for one in anatomies])
    ankle = np.array([one.ankle_m for one in anatomies])
    reach = 0.5 * RUN_STANCE * stride
    low = ankle + np.sqrt(np.maximum((0.965 * leg) ** 2 - (0.55 * reach) ** 2, 0.25 * leg**2))
    same = np.ones_like(speed_m_s)
    return GaitParameters(
        stride_m=stride,
        stance=RUN_STANCE * same,
        strike_rad=0.10 * same,
        push_rad=0.85 * same,
        low_m=low,
        high_m=low + 0.07 * same,
        clearance_m=0.10 * height,
        sway_m=0.008 * same,
        vigour=1.35 * same,
    )


def blended(walk: GaitParameters, run: GaitParameters, share: Array) -> GaitParameters:
    """Gauges `(P,)` between walking and running; those who do not run at all keep theirs to the bit."""
    return GaitParameters(*(np.where(share > 0.0, a + share * (b - a), a) for a, b in zip(walk, run, strict=True)))


def look_up(tables: Array, speed_m_s: Array) -> GaitParameters:
    """Gauges at speeds `(P,)`, from `(P, S, 9)` tables."""
    place = np.minimum(speed_m_s, TOP_SPEED_M_S) / _STEP_M_S
    below = place.astype(np.int64)
    share = (place - below)[:, None]
    rows = np.arange(len(below))
    values = (1.0 - share) * tables[rows, below] + share * tables[rows, below + 1]
    return GaitParameters(*values.T)
