"""Rotations of body parts, and inverse kinematics of the legs.

Axes are x forward, y left, z up.
"""

from __future__ import annotations

import numpy as np

from pftrack_sim.core.types import FloatArray

MAX_EXTENSION = 0.9982  # longest reach of a leg relative to the sum of its links: knees never lock

# Not scipy.spatial.transform.Rotation: its rounding differs in the last bit, which would change frames and truth, and
# `from_euler` takes 5 times as long for ten people.


def rotation_matrices(yaw: FloatArray, roll: FloatArray, pitch: FloatArray) -> FloatArray:
    """`(..., 3, 3)` rotations: pitch about y, then roll about x, then yaw about z [rad].

    A positive pitch leans an upright body forward and swings a hanging limb back; a positive roll lifts the left side.
    """
    cos_y, sin_y, cos_r, sin_r, cos_p, sin_p = (f(angle) for angle in (yaw, roll, pitch) for f in (np.cos, np.sin))
    sin_r_sin_p, sin_r_cos_p = sin_r * sin_p, sin_r * cos_p
    out = np.empty((*yaw.shape, 3, 3))
    out[..., 0, 0] = cos_y * cos_p - sin_y * sin_r_sin_p
    out[..., 0, 1] = -sin_y * cos_r
    out[..., 0, 2] = cos_y * sin_p + sin_y * sin_r_cos_p
    out[..., 1, 0] = sin_y * cos_p + cos_y * sin_r_sin_p
    out[..., 1, 1] = cos_y * cos_r
    out[..., 1, 2] = sin_y * sin_p - cos_y * sin_r_cos_p
    out[..., 2, 0] = -cos_r * sin_p
    out[..., 2, 1] = sin_r
    out[..., 2, 2] = cos_r * cos_p
    return out


def quaternions(rotations: FloatArray) -> FloatArray:
    """`(..., 4)` unit quaternions w, x, y, z of `(..., 3, 3)` rotation matrices.

    Of the four candidates, one per component as divisor, the one with the largest divisor is taken (Shepperd 1978).
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = np.moveaxis(rotations, (-2, -1), (0, 1))
    wx, wy, wz = zy - yz, xz - zx, yx - xy
    x_y, x_z, y_z = xy + yx, xz + zx, yz + zy
    candidates = (
        *(1.0 + xx + yy + zz, wx, wy, wz),
        *(wx, 1.0 + xx - yy - zz, x_y, x_z),
        *(wy, x_y, 1.0 - xx + yy - zz, y_z),
        *(wz, x_z, y_z, 1.0 - xx - yy + zz),
    )
    flat = np.empty((*xx.shape, 16))
    for index, component in enumerate(candidates):
        flat[..., index] = component
    flat = flat.reshape(-1, 4, 4)
    largest = flat.reshape(-1, 16)[:, ::5].argmax(axis=1)
    chosen = flat[np.arange(len(flat)), largest]
    chosen = chosen / np.sqrt((chosen * chosen).sum(axis=1))[:, None]
    return chosen.reshape(*xx.shape, 4)


def rotated(rotations: FloatArray, vectors: FloatArray) -> FloatArray:
    """`(..., 3)` vectors turned by `(..., 3, 3)` rotation matrices."""
    x, y, z = vectors[..., 0, None], vectors[..., 1, None], vectors[..., 2, None]
    return rotations[..., 0] * x + rotations[..., 1] * y + rotations[..., 2] * z


def wrapped(angle: FloatArray) -> FloatArray:
    """Angles wrapped to [-pi, pi) [rad]."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def leg_inverse_kinematics(
    hips: FloatArray, ankles: FloatArray, knee_directions: FloatArray, thighs_m: FloatArray, shanks_m: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Knees `(..., 3)` [m], and rotations `(..., 3, 3)` of thighs and shanks: z up along the bone, x to the bent knee.

    Args:
        hips: `(..., 3)` hip joints [m].
        ankles: `(..., 3)` ankle joints [m]; a leg that does not reach points at the ankle, extended.
        knee_directions: `(..., 3)` unit vectors towards which knees bend.
        thighs_m: `(...)` lengths.
        shanks_m: `(...)` lengths.
    """
    way = ankles - hips
    distance = np.sqrt((way * way).sum(axis=-1))
    length = thighs_m + shanks_m
    down = way / np.maximum(distance, 1e-9)[..., None]
    reach = np.minimum(np.maximum(distance, 0.35 * length), MAX_EXTENSION * length)
    ahead = knee_directions - (knee_directions * down).sum(axis=-1)[..., None] * down
    ahead /= np.sqrt((ahead * ahead).sum(axis=-1))[..., None]
    left = _cross(ahead, down)
    # Law of cosines: angle at the hip between the thigh and the line to the ankle.
    cos = (thighs_m**2 + reach**2 - shanks_m**2) / (2.0 * thighs_m * reach)
    along = (thighs_m * cos)[..., None]
    across = (thighs_m * np.sqrt(np.maximum(1.0 - cos * cos, 0.0)))[..., None]
    thigh = along * down + across * ahead
    shank = reach[..., None] * down - thigh
    rotations = np.empty((2, *hips.shape, 3))
    for rotation, bone, bone_m in zip(rotations, (thigh, shank), (thighs_m, shanks_m), strict=True):
        up = -bone / bone_m[..., None]
        rotation[..., 0], rotation[..., 1], rotation[..., 2] = _cross(left, up), left, up
    return hips + thigh, rotations[0], rotations[1]


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """`(..., 3)` cross products, in half the time of `np.cross`."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    out = np.empty(a.shape)
    out[..., 0], out[..., 1], out[..., 2] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return out
