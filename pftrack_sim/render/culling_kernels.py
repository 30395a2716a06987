"""Kernel that finds the geoms in a camera's view."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pftrack_sim.core.types import BoolArray, FloatArray, IntArray


@njit(cache=True, nogil=True)
def boxes_in_view(
    geoms: IntArray,
    positions: FloatArray,
    rotations: FloatArray,
    middles: FloatArray,
    halves: FloatArray,
    radii_m: FloatArray,
    pose: FloatArray,
    slopes: FloatArray,
    near_m: float,
    margin_m: float,
) -> BoolArray:
    """`(N,)` whether the oriented boxes of geoms reach into a view.

    Args:
        geoms: `(N,)` ids.
        positions: `(ngeom, 3)` [m].
        rotations: `(ngeom, 9)`.
        middles: `(ngeom, 3)` of the boxes in the frames of the geoms [m].
        halves: `(ngeom, 3)` half sizes of the boxes [m].
        radii_m: `(ngeom,)` of spheres about the positions that hold the boxes.
        pose: `(4, 4)` T_world_camera.
        slopes: `(4, 3)` normals of the view's sides, inwards, in camera axes.
        near_m: Depth of the near plane.
        margin_m: Boxes outside by less than this are in view.
    """
    normals, offsets = np.zeros((5, 3)), np.zeros(5)
    for plane in range(5):
        x, y, z = (0.0, 0.0, 1.0) if plane == 0 else (slopes[plane - 1, 0], slopes[plane - 1, 1], slopes[plane - 1, 2])
        length = math.sqrt(x * x + y * y + z * z)
        for axis in range(3):
            normals[plane, axis] = (pose[axis, 0] * x + pose[axis, 1] * y + pose[axis, 2] * z) / length
            offsets[plane] -= normals[plane, axis] * pose[axis, 3]
    offsets[0] -= near_m
    seen = np.zeros(len(geoms), dtype=np.bool_)
    for index in range(len(geoms)):
        geom, inside = geoms[index], True
        for plane in range(5):
            distance = offsets[plane]
            for axis in range(3):
                distance += normals[plane, axis] * positions[geom, axis]
            if distance <= -radii_m[geom]:
                inside = False
                break
            # The box's middle, and how far the box reaches from there towards the plane.
            for along in range(3):
                turned = 0.0
                for axis in range(3):
                    turned += normals[plane, axis] * rotations[geom, 3 * axis + along]
                distance += turned * middles[geom, along] + abs(turned) * halves[geom, along]
            if distance <= -margin_m:
                inside = False
                break
        seen[index] = inside
    return seen
