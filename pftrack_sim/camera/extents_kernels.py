"""Kernels that project the vertices of bodies."""

from __future__ import annotations

import numpy as np
from numba import njit

from pftrack_sim.camera.pinhole import Intrinsics
from pftrack_sim.core.fused import fused_dot
from pftrack_sim.core.types import FloatArray, IntArray


@njit(cache=True, nogil=True)
def measure_bodies(
    vertices: FloatArray,
    first: IntArray,
    ends: IntArray,
    geoms: IntArray,
    positions: FloatArray,
    rotations: FloatArray,
    pose: FloatArray,
    intrinsics: Intrinsics,
    near_m: float,
    fused: bool,
) -> tuple[FloatArray, FloatArray, FloatArray, bool]:
    """What `Bodies.boxes` gives, of parts that are geoms of a scene; and whether the near plane cuts any of them.

    The boxes are those of parts that the plane does not cut.

    Args:
        vertices: `(V, 3)` of all parts, one part after the other.
        first: `(S + 1,)` index of each part's first vertex.
        ends: `(B + 1,)` index of each body's first part.
        geoms: `(S,)` ids of the parts.
        positions: `(ngeom, 3)` of the geoms.
        rotations: `(ngeom, 9)` of the geoms.
        pose: `(4, 4)` T_world_camera.
        intrinsics: fx, fy, cx, cy [px].
        near_m: Distance of the near plane.
        fused: See `project_parts`; the poses of parts in camera axes are always products added unrounded.
    """
    parts = len(geoms)
    centres, axes = np.empty((parts, 3)), np.empty((parts, 3, 3))
    places, turned = np.empty((parts, 3)), np.empty((parts, 3, 3))
    for part in range(parts):
        geom = geoms[part]
        for row in range(3):
            places[part, row] = positions[geom, row]
            for column in range(3):
                turned[part, row, column] = rotations[geom, 3 * row + column]
        x, y, z = places[part, 0] - pose[0, 3], places[part, 1] - pose[1, 3], places[part, 2] - pose[2, 3]
        for axis in range(3):
            centres[part, axis] = fused_dot(pose[:, axis], x, y, z)
            for column in range(3):
                along = turned[part, 0, column], turned[part, 1, column], turned[part, 2, column]
                axes[part, axis, column] = fused_dot(pose[:, axis], along[0], along[1], along[2])
    extents, ranges = project_parts(vertices, first, centres, axes, places, turned, fused)
    cut = False
    for part in range(parts):
        if ranges[part, 0] < near_m:
            cut = cut or ranges[part, 1] >= near_m
            extents[part] = np.nan
    boxes, depths, lowest = gather_bodies(extents, ranges, ends, intrinsics)
    return boxes, depths, lowest, cut


@njit(cache=True, nogil=True, inline="always")
def _dot(row: FloatArray, x: float, y: float, z: float, fused: bool) -> float:
    if fused:
        return fused_dot(row, x, y, z)
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
    # Comparisons, not `min` and `max`, and numbers set one by one: they compile in a fraction of the time.
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
            height = _dot(up, x, y, z, False) + positions[part, 2]
            left, right = u if u < left else left, u if u > right else right
            top, bottom = v if v < top else top, v if v > bottom else bottom
            near, far = depth if depth < near else near, depth if depth > far else far
            lowest = height if height < lowest else lowest
        extents[part, 0], extents[part, 1], extents[part, 2], extents[part, 3] = left, top, right, bottom
        ranges[part, 0], ranges[part, 1], ranges[part, 2] = near, far, lowest
    return extents, ranges


@njit(cache=True, nogil=True)
def gather_bodies(
    extents: FloatArray, ranges: FloatArray, ends: IntArray, intrinsics: Intrinsics
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`(B, 4)` boxes [px], `(B, 2)` depth ranges and `(B,)` lowest heights of bodies from those of their parts.

    Parts `ends[body]` to `ends[body + 1]` are a body's; those with NaN extents have none. The intrinsics are fx, fy,
    cx, cy.
    """
    fx, fy, cx, cy = intrinsics
    bodies = len(ends) - 1
    boxes, depths, lowest = np.empty((bodies, 4)), np.empty((bodies, 2)), np.empty(bodies)
    for body in range(bodies):
        left, top, right, bottom, near, far, low = np.inf, np.inf, -np.inf, -np.inf, np.inf, -np.inf, np.inf
        for part in range(ends[body], ends[body + 1]):
            # Comparisons with NaN are false.
            left = extents[part, 0] if extents[part, 0] < left else left
            top = extents[part, 1] if extents[part, 1] < top else top
            right = extents[part, 2] if extents[part, 2] > right else right
            bottom = extents[part, 3] if extents[part, 3] > bottom else bottom
            near = ranges[part, 0] if ranges[part, 0] < near else near
            far = ranges[part, 1] if ranges[part, 1] > far else far
            low = ranges[part, 2] if ranges[part, 2] < low else low
        # NaN without a part in front of the camera.
        x, y = left * fx + cx if left <= right else np.nan, top * fy + cy if left <= right else np.nan
        boxes[body, 0], boxes[body, 1] = x, y
        boxes[body, 2], boxes[body, 3] = right * fx + cx - x, bottom * fy + cy - y
        depths[body, 0], depths[body, 1], lowest[body] = near, far, low
    return boxes, depths, lowest
