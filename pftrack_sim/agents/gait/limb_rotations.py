"""Rotations of many limbs at once, spelled out by component: numpy's own calls cost more than the arithmetic."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def turned(yaw: ArrayLike, roll: ArrayLike, pitch: ArrayLike) -> Array:
    """Rotations `(..., 3, 3)`: first pitch about y, then roll about x, then yaw about z [rad].

    Axes are x forward, y left, z up: a positive pitch leans an upright body forward and swings a hanging limb back, a
    positive roll lifts the left side.
    """
    yaw, roll, pitch = np.asarray(yaw), np.asarray(roll), np.asarray(pitch)
    cos_y, sin_y, cos_r, sin_r, cos_p, sin_p = (
        np.cos(yaw),
        np.sin(yaw),
        np.cos(roll),
        np.sin(roll),
        np.cos(pitch),
        np.sin(pitch),
    )
    tilt = sin_r * sin_p
    lift = sin_r * cos_p
    out = np.empty((*np.broadcast_shapes(yaw.shape, roll.shape, pitch.shape), 3, 3))
    out[..., 0, 0] = cos_y * cos_p - sin_y * tilt
    out[..., 0, 1] = -sin_y * cos_r
    out[..., 0, 2] = cos_y * sin_p + sin_y * lift
    out[..., 1, 0] = sin_y * cos_p + cos_y * tilt
    out[..., 1, 1] = cos_y * cos_r
    out[..., 1, 2] = sin_y * sin_p - cos_y * lift
    out[..., 2, 0] = -cos_r * sin_p
    out[..., 2, 1] = sin_r
    out[..., 2, 2] = cos_r * cos_p
    return out


def quaternions(rotations: Array) -> Array:
    """`(..., 4)` unit quaternions w, x, y, z of `(..., 3, 3)` rotations.

    Of the four candidates (one per component as divisor) the one with the largest divisor is kept, so that no rotation
    is near a singularity (Shepperd 1978).
    """
    r = rotations
    xx, yy, zz = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    table = np.empty((*xx.shape, 4, 4))
    table[..., 0, 0] = 1.0 + xx + yy + zz
    table[..., 1, 1] = 1.0 + xx - yy - zz
    table[..., 2, 2] = 1.0 - xx + yy - zz
    table[..., 3, 3] = 1.0 - xx - yy + zz
    table[..., 0, 1] = table[..., 1, 0] = r[..., 2, 1] - r[..., 1, 2]
    table[..., 0, 2] = table[..., 2, 0] = r[..., 0, 2] - r[..., 2, 0]
    table[..., 0, 3] = table[..., 3, 0] = r[..., 1, 0] - r[..., 0, 1]
    table[..., 1, 2] = table[..., 2, 1] = r[..., 0, 1] + r[..., 1, 0]
    table[..., 1, 3] = table[..., 3, 1] = r[..., 0, 2] + r[..., 2, 0]
    table[..., 2, 3] = table[..., 3, 2] = r[..., 1, 2] + r[..., 2, 1]
    flat = table.reshape(-1, 4, 4)
    best = flat[:, (0, 1, 2, 3), (0, 1, 2, 3)].argmax(axis=1)
    chosen = flat[np.arange(len(flat)), best]
    chosen = chosen / np.sqrt((chosen * chosen).sum(axis=1))[:, None]
    return chosen.reshape(*xx.shape, 4)


def moved(rotations: Array, local: ArrayLike) -> Array:
    """Local vectors `(..., 3)` seen from outside: `rotations @ local`, broadcast over the leading axes."""
    vector = np.asarray(local)
    x, y, z = vector[..., 0, None], vector[..., 1, None], vector[..., 2, None]
    return rotations[..., 0] * x + rotations[..., 1] * y + rotations[..., 2] * z


def wrapped(angle: Array) -> Array:
    """Angles brought into [-pi, pi) [rad]."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
