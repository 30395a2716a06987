"""Rotations of body parts. Axes are x forward, y left, z up."""

from __future__ import annotations

import numpy as np

from pftrack_sim.agents.gait.kernels import set_quaternions, set_rotations
from pftrack_sim.core.types import FloatArray

# Not scipy.spatial.transform.Rotation: its rounding differs in the last bit, which would change frames and truth, and
# `from_euler` takes 5 times as long for ten people.


def rotation_matrices(yaw: FloatArray, roll: FloatArray, pitch: FloatArray) -> FloatArray:
    """`(..., 3, 3)` rotations: pitch about y, then roll about x, then yaw about z [rad].

    A positive pitch leans an upright body forward and swings a hanging limb back; a positive roll lifts the left side.
    """
    out = np.empty((*yaw.shape, 3, 3))
    set_rotations(yaw.ravel(), roll.ravel(), pitch.ravel(), out.reshape(-1, 3, 3))
    return out


def quaternions(rotations: FloatArray) -> FloatArray:
    """`(..., 4)` unit quaternions w, x, y, z of `(..., 3, 3)` rotation matrices.

    Of the four candidates, one per component as divisor, the one with the largest divisor is taken (Shepperd 1978).
    """
    out = np.empty((*rotations.shape[:-2], 4))
    set_quaternions(rotations.reshape(-1, 3, 3), out.reshape(-1, 4))
    return out


def wrapped(angle: FloatArray) -> FloatArray:
    """Angles wrapped to [-pi, pi) [rad]."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
