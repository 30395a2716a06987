"""Kernels of the poses of the robot's camera and of its beams: products of matrices, with NumPy's bits."""

from __future__ import annotations

import numpy as np
from numba import njit

from pftrack_sim.core.fused import fused_dot
from pftrack_sim.core.types import FloatArray


@njit(cache=True, nogil=True)
def camera_pose(positions: FloatArray, rotations: FloatArray, camera: int) -> FloatArray:
    """`(4, 4)` T_world_camera, axes as OpenCV, from `(ncam, 3)` and `(ncam, 9)` poses, axes as MuJoCo."""
    pose = np.zeros((4, 4))
    for row in range(3):
        axes = rotations[camera, 3 * row : 3 * row + 3]
        pose[row, 0] = fused_dot(axes, 1.0, 0.0, 0.0)
        pose[row, 1] = fused_dot(axes, 0.0, -1.0, 0.0)
        pose[row, 2] = fused_dot(axes, 0.0, 0.0, -1.0)
        pose[row, 3] = positions[camera, row]
    pose[3, 3] = 1.0
    return pose


@njit(cache=True, nogil=True)
def rays(
    positions: FloatArray, rotations: FloatArray, body: int, beams: FloatArray, height_m: float
) -> tuple[FloatArray, FloatArray]:
    """`(3,)` origin [m], `height_m` above a body, and `(3 N,)` directions of `(N, 3)` beams in its frame.

    Poses of bodies are `(nbody, 3)` and `(nbody, 9)`.
    """
    origin, directions = np.empty(3), np.empty(3 * len(beams))
    for row in range(3):
        axes = rotations[body, 3 * row : 3 * row + 3]
        origin[row] = positions[body, row] + height_m * axes[2]
        for beam in range(len(beams)):
            directions[3 * beam + row] = fused_dot(beams[beam], axes[0], axes[1], axes[2])
    return origin, directions
