"""Kernels that project the vertices of bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types
from numba.extending import intrinsic

from pftrack_sim.core.types import FloatArray, IntArray


def _fused(_: Any, a: Any, b: Any, c: Any) -> Any:
    """Product of two numbers plus a third, rounded once."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return types.float64(a, b, c), generate


_fused_multiply_add: Any = intrinsic(_fused)


@njit(cache=True, nogil=True, inline="always")
def _dot(row: FloatArray, x: float, y: float, z: float, fused: bool) -> float:
    if fused:
        return _fused_multiply_add(row[2], z, _fused_multiply_add(row[1], y, row[0] * x))
    return row[0] * x + row[1] * y + row[2] * z


@njit(cache=True, nogil=True, error_model="numpy")
def project_parts(
    vertices: FloatArray,
    first: IntArray,
    centres: FloatArray,
    axes: FloatArray,
    positions: FloatArray,
    rotations: FloatArray,
    fused: bool,
) -> tuple[FloatArray, FloatArray]:
    """`(S, 4)` extents, and `(S, 3)` depth ranges and lowest heights of parts, as if all lay in front of the camera.

    Args:
        vertices: `(V, 3)` of all parts, one part after the other.
        first: `(S + 1,)` index of each part's first vertex.
        centres: `(S, 3)` positions of the parts in camera axes.
        axes: `(S, 3, 3)` rotations to camera axes.
        positions: `(S, 3)` positions in the world frame.
        rotations: `(S, 3, 3)` rotations to the world frame.
        fused: Whether products are added unrounded, as BLAS libraries multiply matrices.
    """
    extents, ranges = np.empty((len(centres), 4)), np.empty((len(centres), 3))
    for part in range(len(centres)):
        across, down, ahead, up = axes[part, 0], axes[part, 1], axes[part, 2], rotations[part, 2]
        left, top, right, bottom, near, far = np.inf, np.inf, -np.inf, -np.inf, np.inf, -np.inf
        lowest = np.inf
        for index in range(first[part], first[part + 1]):
            x, y, z = vertices[index, 0], vertices[index, 1], vertices[index, 2]
            depth = _dot(ahead, x, y, z, fused) + centres[part, 2]
            u = (_dot(across, x, y, z, fused) + centres[part, 0]) / depth
            v = (_dot(down, x, y, z, fused) + centres[part, 1]) / depth
            left, right, top, bottom = min(left, u), max(right, u), min(top, v), max(bottom, v)
            near, far = min(near, depth), max(far, depth)
            lowest = min(lowest, _dot(up, x, y, z, False) + positions[part, 2])
        extents[part] = left, top, right, bottom
        ranges[part] = near, far, lowest
    return extents, ranges


@njit(cache=True, nogil=True)
def gather_bodies(
    extents: FloatArray, ranges: FloatArray, ends: IntArray, intrinsics: tuple[float, float, float, float]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`(B, 4)` boxes [px], `(B, 2)` depth ranges and `(B,)` lowest heights of bodies from those of their parts.

    Parts `ends[body]` to `ends[body + 1]` are a body's; those with NaN extents have none. The intrinsics are fx, fy,
    cx, cy.
    """
    fx, fy, cx, cy = intrinsics
    boxes = np.full((len(ends) - 1, 4), np.nan)
    depths, lowest = np.empty((len(boxes), 2)), np.empty(len(boxes))
    for body in range(len(boxes)):
        parts = slice(ends[body], ends[body + 1])
        depths[body] = ranges[parts, 0].min(), ranges[parts, 1].max()
        lowest[body] = ranges[parts, 2].min()
        left, top, right, bottom = np.inf, np.inf, -np.inf, -np.inf
        for part in range(ends[body], ends[body + 1]):
            if not np.isnan(extents[part, 0]):
                left, top = min(left, extents[part, 0]), min(top, extents[part, 1])
                right, bottom = max(right, extents[part, 2]), max(bottom, extents[part, 3])
        if left <= right:
            x, y = left * fx + cx, top * fy + cy
            boxes[body] = x, y, right * fx + cx - x, bottom * fy + cy - y
    return boxes, depths, lowest
