"""From hip and ankle to the knee: a leg as two links that bend forward."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STRAIGHT = 0.9982
"""Longest reach of a leg relative to its two links: knees never lock."""


def bent_legs(
    hips: Array, ankles: Array, forward: Array, thighs_m: Array, shanks_m: Array
) -> tuple[Array, Array, Array]:
    """Where knees are and how thighs and shanks stand.

    Args:
        hips: `(..., 3)` hip joints [m].
        ankles: `(..., 3)` ankle joints [m]. Out of reach, the leg points at it, stretched.
        forward: `(..., 3)` unit vectors towards which knees bend.
        thighs_m: `(...)` lengths.
        shanks_m: `(...)` lengths.

    Returns:
        Knees `(..., 3)`, and rotations `(..., 3, 3)` of thighs and of shanks: z up along the bone, x where the knee
        bends.
    """
    way = ankles - hips
    distance = np.sqrt((way * way).sum(axis=-1))
    reach = thighs_m + shanks_m
    down = way / np.maximum(distance, 1e-9)[..., None]
    used = np.minimum(np.maximum(distance, 0.35 * reach), STRAIGHT * reach)
    ahead = forward - (forward * down).sum(axis=-1)[..., None] * down
    ahead /= np.sqrt((ahead * ahead).sum(axis=-1))[..., None]
    side = crossed(ahead, down)
    # Law of cosines: angle at the hip between the thigh and the line to the ankle.
    cos = (thighs_m**2 + used**2 - shanks_m**2) / (2.0 * thighs_m * used)
    along = (thighs_m * cos)[..., None]
    out = (thighs_m * np.sqrt(np.maximum(1.0 - cos * cos, 0.0)))[..., None]
    from_hip = along * down + out * ahead
    from_knee = used[..., None] * down - from_hip
    return (
        hips + from_hip,
        _upright(-from_hip / thighs_m[..., None], side),
        _upright(-from_knee / shanks_m[..., None], side),
    )


def _upright(up: Array, side: Array) -> Array:
    """Rotations `(..., 3, 3)` whose z is `up` and whose y is `side`."""
    out = np.empty((*up.shape, 3))
    out[..., 0] = crossed(side, up)
    out[..., 1] = side
    out[..., 2] = up
    return out


def crossed(first: Array, second: Array) -> Array:
    """Cross product of `(..., 3)` vectors; several times faster than numpy's for a handful of them."""
    out = np.empty(np.broadcast_shapes(first.shape, second.shape))
    out[..., 0] = first[..., 1] * second[..., 2] - first[..., 2] * second[..., 1]
    out[..., 1] = first[..., 2] * second[..., 0] - first[..., 0] * second[..., 2]
    out[..., 2] = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return out
