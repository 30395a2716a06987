"""A shoe that rolls on the ground, and what it does between two contacts.

The sole is flat between two arcs. Pitching the foot rolls it on the heel's arc (toes up) or on the toes' (heel up)
without slipping, so a foot that stands only ever rolls and its point of contact never moves over the ground.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.agents.gait.joint_trajectories import leg_angles

Array = NDArray[np.float64]

UNDERFOOT = 0.245
"""Share of the stride after contact at which the body is above where the flat foot's ankle stands."""
_ROLL_DOWN = 0.13
"""Share of the stride in which the foot comes down flat after heel contact."""
_HEEL_RISE = 0.30
"""Share of the stride at which the heel starts to leave the ground."""


def rolled(pitch: Array, ankle_m: Array, heel: tuple[Array, Array], toe: tuple[Array, Array]) -> tuple[Array, Array]:
    """The ankle of a foot that rolls on the ground.

    Args:
        pitch: Angle of the foot, toes up positive [rad].
        ankle_m: Height of the ankle above the sole.
        heel: x of the heel arc's centre ahead of the ankle and its radius [m].
        toe: The same for the toes.

    Returns:
        x ahead of where the ankle is when the foot is flat, and height above the ground [m].
    """
    on_heel = pitch > 0.0
    centre = np.where(on_heel, heel[0], toe[0])
    radius = np.where(on_heel, heel[1], toe[1])
    cos, sin = np.cos(pitch), np.sin(pitch)
    above = ankle_m - radius
    return centre - radius * pitch - centre * cos - above * sin, radius - centre * sin + above * cos


def heel_strike_pitch(speed_m_s: Array) -> Array:
    """Toes-up angle at contact [rad]: the published 18 deg at natural speed, less when slower."""
    return _STRIKE * 1.25 * (1.0 - np.exp(-speed_m_s / 0.8))


def toe_off_pitch(speed_m_s: Array) -> Array:
    """Heel-up angle at lift-off [rad], positive: about 57 deg at natural speed.

    That is less than the published 67 deg: a shoe whose toes do not bend would stand on its tip.
    """
    return _PUSH * 0.97 * (1.0 - np.exp(-speed_m_s / 0.6))


def stance_pitch(cycle: Array, share: Array, strike: Array, push: Array) -> Array:
    """Pitch of a standing foot [rad]: down from the heel, flat, up over the toes.

    Args:
        cycle: Share of the stride since contact.
        share: Share of the stride a foot stands.
        strike: Toes-up angle at contact [rad].
        push: Heel-up angle at lift-off [rad].
    """
    down = np.maximum(1.0 - cycle / _ROLL_DOWN, 0.0)
    up = np.minimum(np.maximum((cycle - _HEEL_RISE) / (share - _HEEL_RISE), 0.0), 1.0)
    return strike * down**1.5 - push * up**2.7


def swing(progress: Array, strike: Array, push: Array) -> tuple[Array, Array, Array]:
    """What a foot does in the air, as the published joint angles have it.

    Args:
        progress: 0 at lift-off, 1 at contact.
        strike: Toes-up angle at contact [rad].
        push: Heel-up angle at lift-off [rad].

    Returns:
        Share of the way to the next contact, pitch [rad], and height of the sole's lowest point as a share of the
        largest.
    """
    shape = np.interp(progress, _PROGRESS, _PITCH_SHAPE)
    pitch = np.where(shape < 0.0, push, strike) * shape
    return np.interp(progress, _PROGRESS, _TRAVEL), pitch, np.sin(np.pi * progress) ** 1.2


def _tables() -> tuple[Array, Array, Array, float, float]:
    """Swing of the published gait: progress, travel, pitch relative to its ends; strike and push angle [rad]."""
    lift_off, leg, stride, ankle = 0.62, 0.245, 0.82, 0.045
    cycle = np.linspace(lift_off, 1.0, 65)
    thigh, knee, flexion = leg_angles(cycle)
    pitch = thigh - knee + flexion
    strike, push = float(pitch[-1]), float(-pitch[0])
    # The ankle over the ground, less what the rolling sole contributes, is the way of the foot itself.
    x = stride * cycle + leg * (np.sin(thigh) + np.sin(thigh - knee))
    ahead, _ = rolled(
        pitch, np.full(65, ankle), (np.full(65, -0.03), np.full(65, 0.016)), (np.full(65, 0.102), np.full(65, 0.028))
    )
    progress = np.linspace(0.0, 1.0, 65)
    travel = np.maximum.accumulate((x - ahead) - (x - ahead)[0])
    # A foot starts and lands at rest on the ground: the published curve is eased into both ends.
    share = np.clip(travel / travel[-1], 0.0, 1.0)
    eased = progress**2 * (3.0 - 2.0 * progress)
    return progress, 0.5 * share + 0.5 * eased, np.where(pitch < 0.0, pitch / push, pitch / strike), strike, push


_PROGRESS, _TRAVEL, _PITCH_SHAPE, _STRIKE, _PUSH = _tables()
