"""Kernels of what the robot senses: poses of its camera and beams, with NumPy's bits, and its proprioception."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.core.fused import fused_dot
from pftrack_sim.core.types import FloatArray, IntArray


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


@njit(cache=True, nogil=True)
def readings(
    odometry: tuple[float, float, float],
    sensed: FloatArray,
    places: IntArray,
    scale: FloatArray,
    ranges_m: FloatArray,
    farthest_m: float,
) -> NDArray[np.float32]:
    """`(3 + S + R,)` odometry, `(S,)` scaled places of what is sensed, and `(R,)` ranges.

    A range is at most the farthest one, and that where it is -1: without a hit.
    """
    count = len(places)
    values = np.empty(3 + count + len(ranges_m), dtype=np.float32)
    values[0], values[1], values[2] = odometry
    for index in range(count):
        values[3 + index] = sensed[places[index]] * scale[index]
    for beam in range(len(ranges_m)):
        range_m = ranges_m[beam]
        values[3 + count + beam] = farthest_m if range_m < 0.0 or range_m > farthest_m else range_m
    return values
