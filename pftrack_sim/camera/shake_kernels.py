"""Kernel of a camera's displacement."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pftrack_sim.core.fused import fused_dot, fused_multiply_add
from pftrack_sim.core.types import FloatArray

_EPSILON = float(np.finfo(np.float64).eps)


@njit(cache=True, nogil=True)
def displaced(pose: FloatArray, axes: FloatArray) -> FloatArray:
    """`(4, 4)` pose, displaced in its own axes by the rotation vector [rad] and translation in `(6,)` axes.

    The steps are those of `cv2.Rodrigues` and of a product of matrices.
    """
    moved = np.eye(4)
    x, y, z = axes[0], axes[1], axes[2]
    angle = math.sqrt(x * x + y * y + z * z)
    if angle >= _EPSILON:
        cos, sin = math.cos(angle), math.sin(angle)
        rest, inverse = 1.0 - cos, 1.0 / angle
        x, y, z = x * inverse, y * inverse, z * inverse
        moved[0, 0], moved[1, 1], moved[2, 2] = cos + rest * (x * x), cos + rest * (y * y), cos + rest * (z * z)
        moved[0, 1], moved[1, 0] = rest * (x * y) - sin * z, rest * (x * y) + sin * z
        moved[0, 2], moved[2, 0] = rest * (x * z) + sin * y, rest * (x * z) - sin * y
        moved[1, 2], moved[2, 1] = rest * (y * z) - sin * x, rest * (y * z) + sin * x
    moved[:3, 3] = axes[3:]
    out = np.empty((4, 4))
    for row in range(4):
        for column in range(4):
            first = fused_dot(pose[row], moved[0, column], moved[1, column], moved[2, column])
            out[row, column] = fused_multiply_add(pose[row, 3], moved[3, column], first)
    return out
