"""Kernels that find the geoms in a view, and those that may occlude people.

Arguments of several kernels: `poses`, `(ngeom, 3)` positions [m] and `(ngeom, 9)` rotations of geoms; `boxes`,
`(ngeom, 3)` middles and `(ngeom, 3)` half sizes of their oriented bounding boxes in the frames of the geoms, and
`(ngeom,)` radii of spheres about the positions that hold the boxes [m]; `meshes`, see `Meshes`; `pose`, `(4, 4)`
T_world_camera; `intrinsics`, fx, fy, cx, cy [px]; `rect`, left, top, width and height of a view in the image [px].
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.camera.pinhole import Intrinsics
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray

Poses: TypeAlias = tuple[FloatArray, FloatArray]
Boxes: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]


class Meshes(NamedTuple):
    """Triangles of geoms that are meshes.

    Attributes:
        vertices: `(V, 3)` of all meshes, in the frames of their geoms [m].
        faces: `(F, 3)` vertices of each triangle, counted from the mesh's first.
        ranges: `(ngeom, 3)` first vertex, first triangle and number of triangles of each geom; none of another shape.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    ranges: IntArray


_MARGIN_M, _MARGIN_PX = 0.01, 1.0  # OpenGL computes in single precision: a geom outside by less may still touch a pixel
_FACE_MARGIN_M = 1e-4  # The same, for a person and the camera on the far side of a face


@njit(cache=True, nogil=True)
def boxes_in_view(
    geoms: IntArray,
    poses: Poses,
    boxes: Boxes,
    pose: FloatArray,
    intrinsics: Intrinsics,
    rect: tuple[int, int, int, int],
    near_m: float,
) -> BoolArray:
    """`(N,)` whether the boxes of geoms reach into a view beyond the near plane, or miss it by a margin."""
    planes = _planes(pose, intrinsics, rect, near_m, np.inf)
    seen = np.zeros(len(geoms), dtype=np.bool_)
    for index in range(len(geoms)):
        seen[index] = _reaches(geoms[index], planes, poses, boxes)
    return seen


@njit(cache=True, nogil=True)
def hidden_boxes(
    geoms: IntArray,
    poses: Poses,
    boxes: Boxes,
    unbounded: BoolArray,
    pose: FloatArray,
    intrinsics: Intrinsics,
    rect: tuple[int, int, int, int],
    near_m: float,
    reflectance: NDArray[np.float32],
    light_active: BoolArray,
    light_castshadow: BoolArray,
    geom_castshadow: BoolArray,
) -> IntArray:
    """`(M,)` places among `(N,)` geoms of those that neither reach into a view nor show in it otherwise.

    Args:
        geoms: `(N,)` ids.
        poses: See above.
        boxes: See above.
        unbounded: `(ngeom,)` geoms without a box, never hidden.
        pose: See above.
        intrinsics: See above.
        rect: See above.
        near_m: Depth of the near plane.
        reflectance: `(nmat,)` of the materials; with one that reflects, nothing is hidden.
        light_active: `(nlight,)` lights that are on.
        light_castshadow: `(nlight,)` lights that cast shadows.
        geom_castshadow: `(ngeom,)` geoms that cast shadows, hidden only if no light does.
    """
    count, shadows = 0, False
    places = np.empty(len(geoms), dtype=np.intp)
    for material in range(len(reflectance)):
        if reflectance[material] > 0.0:
            return places[:0]
    for light in range(len(light_active)):
        shadows = shadows or (light_active[light] and light_castshadow[light])
    planes = _planes(pose, intrinsics, rect, near_m, np.inf)
    for index in range(len(geoms)):
        geom = geoms[index]
        shown = unbounded[geom] or (shadows and geom_castshadow[geom]) or _reaches(geom, planes, poses, boxes)
        if not shown:
            places[count] = index
            count += 1
    return places[:count]


@njit(cache=True, nogil=True)
def any_box_in_view(
    geoms: IntArray,
    poses: Poses,
    boxes: Boxes,
    pose: FloatArray,
    intrinsics: Intrinsics,
    rect: tuple[int, int, int, int],
    near_m: float,
) -> bool:
    """Whether the box of any of some geoms may reach into a view, see `boxes_in_view`."""
    planes, found = _planes(pose, intrinsics, rect, near_m, np.inf), False
    for geom in geoms:
        found = found or _reaches(geom, planes, poses, boxes)
    return found


@njit(cache=True, nogil=True)
def boxes_before_people(
    geoms: IntArray,
    poses: Poses,
    boxes: Boxes,
    meshes: Meshes,
    pose: FloatArray,
    intrinsics: Intrinsics,
    rects: IntArray,
    near_m: float,
    farthest_m: FloatArray,
    above_m: FloatArray,
    limbs: IntArray,
    ends: IntArray,
) -> BoolArray:
    """`(N, P)` whether the box of a geom, and of a mesh a triangle, may be between a camera and a person.

    Args:
        geoms: `(N,)` ids.
        poses: See above.
        boxes: See above.
        meshes: See above.
        pose: See above.
        intrinsics: See above.
        rects: `(P, 4)` view of each person.
        near_m: Depth of the near plane.
        farthest_m: `(P,)` depth of each person's farthest point.
        above_m: `(P,)` height up to which geoms occlude nothing of a person.
        limbs: Geom ids of all people, one person after the other.
        ends: `(P + 1,)` where each person's begin and end.
    """
    before = np.zeros((len(geoms), len(rects)), dtype=np.bool_)
    for person in range(len(rects)):
        left, top, width, height = rects[person]
        planes = _planes(pose, intrinsics, (left, top, width, height), near_m, farthest_m[person])
        own = limbs[ends[person] : ends[person + 1]]
        for index in range(len(geoms)):
            before[index, person] = _before(geoms[index], planes, above_m[person], own, poses, boxes, meshes, pose)
    return before


@njit(cache=True, nogil=True)
def any_box_before(
    geoms: IntArray,
    poses: Poses,
    boxes: Boxes,
    meshes: Meshes,
    pose: FloatArray,
    intrinsics: Intrinsics,
    rect: tuple[int, int, int, int],
    near_m: float,
    farthest_m: float,
    above_m: float,
    limbs: IntArray,
) -> bool:
    """Whether any of some geoms may be between a camera and one person, see `boxes_before_people`."""
    planes, found = _planes(pose, intrinsics, rect, near_m, farthest_m), False
    for geom in geoms:
        found = found or _before(geom, planes, above_m, limbs, poses, boxes, meshes, pose)
    return found


@njit(cache=True, nogil=True)
def _before(
    geom: int,
    planes: tuple[FloatArray, FloatArray],
    above_m: float,
    limbs: IntArray,
    poses: Poses,
    boxes: Boxes,
    meshes: Meshes,
    pose: FloatArray,
) -> bool:
    """Whether a geom may be between a camera and a person with these limbs."""
    return (
        _reaches(geom, planes, poses, boxes)
        and _top(geom, poses, boxes) > above_m
        and not _separates(geom, pose, limbs, poses, boxes)
        and (meshes.ranges[geom, 2] == 0 or _some_triangle_reaches(geom, planes, above_m, poses, meshes))
    )


@njit(cache=True, nogil=True)
def _planes(
    pose: FloatArray, intrinsics: Intrinsics, rect: tuple[int, int, int, int], near_m: float, farthest_m: float
) -> tuple[FloatArray, FloatArray]:
    """`(6, 3)` unit normals and `(6,)` offsets of the near plane, the sides and the far plane of a view in the world.

    Points x inside have n.x + offset > 0.
    """
    (fx, fy, cx, cy), (left, top, width, height) = intrinsics, rect
    right, bottom = left + width + _MARGIN_PX, top + height + _MARGIN_PX
    inwards = (
        (0.0, 0.0, 1.0),
        (fx, 0.0, cx - left + _MARGIN_PX),
        (-fx, 0.0, right - cx),
        (0.0, fy, cy - top + _MARGIN_PX),
        (0.0, -fy, bottom - cy),
        (0.0, 0.0, -1.0),
    )
    normals, offsets = np.zeros((6, 3)), np.zeros(6)
    for plane in range(6):
        x, y, z = inwards[plane]
        length = math.sqrt(x * x + y * y + z * z)
        for axis in range(3):
            normals[plane, axis] = (pose[axis, 0] * x + pose[axis, 1] * y + pose[axis, 2] * z) / length
            offsets[plane] -= normals[plane, axis] * pose[axis, 3]
    offsets[0] -= near_m
    offsets[5] += farthest_m
    return normals, offsets


@njit(cache=True, nogil=True)
def _reaches(geom: int, planes: tuple[FloatArray, FloatArray], poses: Poses, boxes: Boxes) -> bool:
    """Whether a geom's box reaches to the inner side of each plane."""
    (normals, offsets), (positions, rotations), (middles, halves, radii_m) = planes, poses, boxes
    for plane in range(6):
        distance = offsets[plane]
        for axis in range(3):
            distance += normals[plane, axis] * positions[geom, axis]
        if distance <= -radii_m[geom] - _MARGIN_M:
            return False
        # The box's middle, and how far the box reaches from there towards the plane.
        for along in range(3):
            turned = 0.0
            for axis in range(3):
                turned += normals[plane, axis] * rotations[geom, 3 * axis + along]
            distance += turned * middles[geom, along] + abs(turned) * halves[geom, along]
        if distance <= -_MARGIN_M:
            return False
    return True


@njit(cache=True, nogil=True)
def _some_triangle_reaches(
    geom: int, planes: tuple[FloatArray, FloatArray], above_m: float, poses: Poses, meshes: Meshes
) -> bool:
    """Whether a triangle of a mesh reaches above a height, and to the inner side of each plane; True of other geoms.

    Much of a box is empty where one mesh holds the crown of a tree, or the ground and what is painted on it.
    """
    vertices, (first, start, count) = meshes.vertices, meshes.ranges[geom]
    if count == 0:
        return True
    (normals, offsets), (positions, rotations) = planes, poses
    distances, turned = np.empty(6), np.empty((6, 3))
    for plane in range(6):
        distances[plane] = offsets[plane]
        for axis in range(3):
            distances[plane] += normals[plane, axis] * positions[geom, axis]
            turned[plane, axis] = 0.0
            for along in range(3):
                turned[plane, axis] += normals[plane, along] * rotations[geom, 3 * along + axis]
    up_x, up_y, up_z = rotations[geom, 6], rotations[geom, 7], rotations[geom, 8]
    higher_m = above_m - positions[geom, 2]
    for face in range(start, start + count):
        a, b, c = first + meshes.faces[face, 0], first + meshes.faces[face, 1], first + meshes.faces[face, 2]
        if not (
            up_x * vertices[a, 0] + up_y * vertices[a, 1] + up_z * vertices[a, 2] > higher_m
            or up_x * vertices[b, 0] + up_y * vertices[b, 1] + up_z * vertices[b, 2] > higher_m
            or up_x * vertices[c, 0] + up_y * vertices[c, 1] + up_z * vertices[c, 2] > higher_m
        ):
            continue
        inside = True
        for plane in range(6):
            x, y, z, least = turned[plane, 0], turned[plane, 1], turned[plane, 2], -distances[plane] - _MARGIN_M
            if not (
                x * vertices[a, 0] + y * vertices[a, 1] + z * vertices[a, 2] > least
                or x * vertices[b, 0] + y * vertices[b, 1] + z * vertices[b, 2] > least
                or x * vertices[c, 0] + y * vertices[c, 1] + z * vertices[c, 2] > least
            ):
                inside = False
                break
        if inside:
            return True
    return False


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
def _separates(geom: int, pose: FloatArray, limbs: IntArray, poses: Poses, boxes: Boxes) -> bool:
    """Whether the camera and all limbs of a person lie on the outer side of one face of a geom's box.

    Such a geom occludes nothing of the person: a wall of a corridor, a shelf behind the person.
    """
    (positions, rotations), (middles, halves, _) = poses, boxes
    for face in range(3):
        x, y, z = rotations[geom, face], rotations[geom, 3 + face], rotations[geom, 6 + face]
        origin = x * positions[geom, 0] + y * positions[geom, 1] + z * positions[geom, 2] + middles[geom, face]
        camera = x * pose[0, 3] + y * pose[1, 3] + z * pose[2, 3] - origin
        reach = halves[geom, face] + _FACE_MARGIN_M
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
