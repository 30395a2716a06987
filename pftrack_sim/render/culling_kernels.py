"""Kernels that find the geoms in a view, and those that may occlude people.

Arguments of several kernels: `poses`, `(ngeom, 3)` positions [m] and `(ngeom, 9)` rotations of geoms; `boxes`,
`(ngeom, 3)` middles and `(ngeom, 3)` half sizes of their oriented bounding boxes in the frames of the geoms, and
`(ngeom,)` radii of spheres about the positions that hold the boxes [m]; `sides`, `(4, 3)` inward normals of a view's
sides in camera axes, of any length.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numba import njit

from pftrack_sim.core.types import BoolArray, FloatArray, IntArray

Poses: TypeAlias = tuple[FloatArray, FloatArray]
Boxes: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]


@njit(cache=True, nogil=True)
def boxes_in_view(
    geoms: IntArray, poses: Poses, boxes: Boxes, pose: FloatArray, sides: FloatArray, near_m: float, margin_m: float
) -> BoolArray:
    """`(N,)` whether the boxes of geoms reach into the view of a camera at `(4, 4)` `pose`, or miss it by a margin."""
    planes = _planes(pose, sides, near_m, np.inf)
    seen = np.zeros(len(geoms), dtype=np.bool_)
    for index in range(len(geoms)):
        seen[index] = _reaches(geoms[index], planes, poses, boxes, margin_m)
    return seen


@njit(cache=True, nogil=True)
def boxes_before_people(
    geoms: IntArray,
    poses: Poses,
    boxes: Boxes,
    pose: FloatArray,
    sides: FloatArray,
    near_m: float,
    farthest_m: FloatArray,
    above_m: FloatArray,
    limbs: IntArray,
    ends: IntArray,
    margin_m: float,
    face_margin_m: float,
) -> BoolArray:
    """`(N, P)` whether the box of a geom may be between a camera and a person.

    Args:
        geoms: `(N,)` ids.
        poses: See above.
        boxes: See above.
        pose: `(4, 4)` T_world_camera.
        sides: `(P, 4, 3)` of the view of each person.
        near_m: Depth of the near plane.
        farthest_m: `(P,)` depth of each person's farthest point.
        above_m: `(P,)` height up to which geoms occlude nothing of a person.
        limbs: Geom ids of all people, one person after the other.
        ends: `(P + 1,)` where each person's begin and end.
        margin_m: Boxes outside a view by less than this are in it.
        face_margin_m: Boxes nearer than this are not beside a person or the camera.
    """
    before = np.zeros((len(geoms), len(farthest_m)), dtype=np.bool_)
    for person in range(len(farthest_m)):
        planes, own = _planes(pose, sides[person], near_m, farthest_m[person]), limbs[ends[person] : ends[person + 1]]
        for index in range(len(geoms)):
            geom = geoms[index]
            before[index, person] = (
                _reaches(geom, planes, poses, boxes, margin_m)
                and _top(geom, poses, boxes) > above_m[person]
                and not _separates(geom, pose, own, poses, boxes, face_margin_m)
            )
    return before


@njit(cache=True, nogil=True)
def _planes(pose: FloatArray, sides: FloatArray, near_m: float, farthest_m: float) -> tuple[FloatArray, FloatArray]:
    """`(6, 3)` unit normals and `(6,)` offsets of the near plane, the sides and the far plane of a view in the world.

    Points x inside have n.x + offset > 0.
    """
    normals, offsets = np.zeros((6, 3)), np.zeros(6)
    for plane in range(6):
        x, y, z = 0.0, 0.0, 1.0 - 2.0 * (plane == 5)
        if 0 < plane < 5:
            x, y, z = sides[plane - 1, 0], sides[plane - 1, 1], sides[plane - 1, 2]
        length = math.sqrt(x * x + y * y + z * z)
        for axis in range(3):
            normals[plane, axis] = (pose[axis, 0] * x + pose[axis, 1] * y + pose[axis, 2] * z) / length
            offsets[plane] -= normals[plane, axis] * pose[axis, 3]
    offsets[0] -= near_m
    offsets[5] += farthest_m
    return normals, offsets


@njit(cache=True, nogil=True)
def _reaches(geom: int, planes: tuple[FloatArray, FloatArray], poses: Poses, boxes: Boxes, margin_m: float) -> bool:
    """Whether a geom's box reaches to the inner side of each plane."""
    (normals, offsets), (positions, rotations), (middles, halves, radii_m) = planes, poses, boxes
    for plane in range(6):
        distance = offsets[plane]
        for axis in range(3):
            distance += normals[plane, axis] * positions[geom, axis]
        if distance <= -radii_m[geom]:
            return False
        # The box's middle, and how far the box reaches from there towards the plane.
        for along in range(3):
            turned = 0.0
            for axis in range(3):
                turned += normals[plane, axis] * rotations[geom, 3 * axis + along]
            distance += turned * middles[geom, along] + abs(turned) * halves[geom, along]
        if distance <= -margin_m:
            return False
    return True


@njit(cache=True, nogil=True)
def _top(geom: int, poses: Poses, boxes: Boxes) -> float:
    """Height of the top of a geom's box [m]."""
    (positions, rotations), (middles, halves, _) = poses, boxes
    height = positions[geom, 2]
    for along in range(3):
        vertical = rotations[geom, 6 + along]
        height += vertical * middles[geom, along] + abs(vertical) * halves[geom, along]
    return height


@njit(cache=True, nogil=True)
def _separates(geom: int, pose: FloatArray, limbs: IntArray, poses: Poses, boxes: Boxes, margin_m: float) -> bool:
    """Whether the camera and all limbs of a person lie on the outer side of one face of a geom's box.

    Such a geom occludes nothing of the person: a wall of a corridor, a shelf behind the person.
    """
    (positions, rotations), (middles, halves, _) = poses, boxes
    for face in range(3):
        x, y, z = rotations[geom, face], rotations[geom, 3 + face], rotations[geom, 6 + face]
        origin = x * positions[geom, 0] + y * positions[geom, 1] + z * positions[geom, 2] + middles[geom, face]
        camera = x * pose[0, 3] + y * pose[1, 3] + z * pose[2, 3] - origin
        reach = halves[geom, face] + margin_m
        if abs(camera) <= reach:
            continue
        side = 1.0 if camera > 0.0 else -1.0
        outside = True
        for limb in limbs:
            middle = x * positions[limb, 0] + y * positions[limb, 1] + z * positions[limb, 2] - origin
            radius = 0.0
            for along in range(3):
                turned = x * rotations[limb, along] + y * rotations[limb, 3 + along] + z * rotations[limb, 6 + along]
                middle += turned * middles[limb, along]
                radius += abs(turned) * halves[limb, along]
            if side * middle - radius <= reach:
                outside = False
                break
        if outside:
            return True
    return False
