"""Geoms that cannot change an image: out of view, or unable to occlude a person.

Decided from bounding boxes, and before people from the triangles of meshes too. Conservative: a geom that is ruled out
changes no pixel.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.pinhole import Intrinsics
from pftrack_sim.core.compiled import kernel
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.render.backend import PixelRect

_BOUNDED_TYPES = [
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name}"))
    for name in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX", "MESH")
]
"""Types of geoms that lie inside their `geom_aabb`."""

GROUND_CONTACT_M = 1e-4  # Soles penetrate the ground by up to this much without being occluded by it

_MARGIN_M, _MARGIN_PX = 0.01, 1.0  # OpenGL computes in single precision: a geom outside by less may still touch a pixel
_FACE_MARGIN_M = 1e-4  # The same, for a person and the camera on the far side of a face


class Bounds:
    """Oriented bounding boxes of a model's geoms.

    Args:
        model: The model.
        triangles: Whether `may_occlude` looks at the triangles of meshes, too; the model is then kept until `release`.
    """

    def __init__(self, model: mujoco.MjModel, *, triangles: bool = False) -> None:
        boxes = np.array(model.geom_aabb, dtype=np.float64).reshape(-1, 2, 3)
        self._middles, self._halves = boxes[:, 0], boxes[:, 1]
        self._radii_m = np.linalg.norm(np.abs(boxes[:, 0]) + boxes[:, 1], axis=1)
        self.unbounded: BoolArray = ~np.isin(model.geom_type, _BOUNDED_TYPES)
        """`(ngeom,)` geoms without a box: nothing is ever ruled out for them."""
        self._is_mesh: BoolArray = model.geom_type == mujoco.mjtGeom.mjGEOM_MESH
        self._model = model if triangles else None

    def release(self) -> None:
        """Release the model; `may_occlude` then looks at boxes alone."""
        self._model = None

    def in_view(
        self,
        data: mujoco.MjData,
        T_world_camera: FloatArray,
        intrinsics: Intrinsics,
        rect: PixelRect,
        near_m: float,
        geoms: IntArray,
    ) -> BoolArray:
        """`(N,)` which geoms may be visible in a rectangle of the image."""
        return self.unbounded[geoms] | self._inside(data, geoms, *_planes(T_world_camera, intrinsics, rect, near_m))

    def may_occlude(
        self,
        data: mujoco.MjData,
        T_world_camera: FloatArray,
        intrinsics: Intrinsics,
        rect: PixelRect,
        near_m: float,
        geoms: IntArray,
        limbs: IntArray,
        farthest_m: float,
        lowest_m: float,
    ) -> BoolArray:
        """`(N,)` whether each of N geoms may occlude a person.

        Args:
            data: Poses.
            T_world_camera: `(4, 4)` camera pose.
            intrinsics: Focal lengths fx, fy and principal point cx, cy [px].
            rect: Rectangle of the image around the person.
            near_m: Depth of the near plane.
            geoms: `(N,)` ids.
            limbs: Geom ids of the person.
            farthest_m: Depth of the person's farthest point.
            lowest_m: Height of the person's lowest point.
        """
        # From above, a geom below a person's soles occludes nothing of the person.
        least_m = lowest_m + GROUND_CONTACT_M if T_world_camera[2, 3] > lowest_m else -np.inf
        normals, offsets = _planes(T_world_camera, intrinsics, rect, near_m, farthest_m, least_m)
        found = self._inside(data, geoms, normals, offsets)
        left = np.flatnonzero(found)
        if left.size:
            found[left] = ~self._separates(data, geoms[left], T_world_camera[:3, 3], limbs)
        model = self._model
        if model is not None:
            for index in left[self._is_mesh[geoms[left]] & found[left]]:
                found[index] = _some_triangle_reaches(model, data, int(geoms[index]), normals, offsets)
        return self.unbounded[geoms] | found

    def _inside(self, data: mujoco.MjData, geoms: IntArray, normals: FloatArray, offsets: FloatArray) -> BoolArray:
        """`(N,)` whether the boxes of geoms reach to the inner side of each of some planes, or miss it by a margin."""
        distances = normals @ data.geom_xpos[geoms].T + offsets[:, None]
        found = distances.min(axis=0) > -self._radii_m[geoms] - _MARGIN_M
        left = np.flatnonzero(found)
        if left.size:
            ids = geoms[left]
            turned = normals @ data.geom_xmat[ids].reshape(-1, 3, 3)
            reach = turned @ self._middles[ids, :, None] + np.abs(turned) @ self._halves[ids, :, None]
            found[left] = (distances.T[left] + reach[..., 0]).min(axis=1) > -_MARGIN_M
        return found

    def _separates(self, data: mujoco.MjData, geoms: IntArray, camera_m: FloatArray, limbs: IntArray) -> BoolArray:
        """`(N,)` whether the camera and all limbs of a person lie on the outer side of one face of a geom's box.

        Such a geom occludes nothing of the person: a wall of a corridor, a shelf behind the person.
        """
        axes = data.geom_xmat[geoms].reshape(-1, 3, 3).transpose(0, 2, 1)
        origins = (axes @ data.geom_xpos[geoms, :, None])[..., 0] + self._middles[geoms]
        reach = self._halves[geoms] + _FACE_MARGIN_M
        camera = axes @ camera_m - origins
        rotations = data.geom_xmat[limbs].reshape(-1, 3, 3)
        middles = data.geom_xpos[limbs] + (rotations @ self._middles[limbs, :, None])[..., 0]
        # `(N, 3, L)` middles of the limbs along the axes of each geom, and how far they reach from there.
        along = axes @ middles.T - origins[..., None]
        turned = np.abs(axes.reshape(-1, 3) @ rotations.transpose(1, 0, 2).reshape(3, -1))
        radii = (turned.reshape(-1, len(limbs), 3) * self._halves[limbs]).sum(axis=-1).reshape(along.shape)
        nearest = (np.sign(camera)[..., None] * along - radii).min(axis=-1)
        return ((np.abs(camera) > reach) & (nearest > reach)).any(axis=1)


def _planes(
    pose: FloatArray,
    intrinsics: Intrinsics,
    rect: PixelRect,
    near_m: float,
    farthest_m: float = np.inf,
    least_m: float = -np.inf,
) -> tuple[FloatArray, FloatArray]:
    """`(7, 3)` unit normals and `(7,)` offsets, in the world, of the planes that bound what is looked for.

    They are the near plane, the far one, the sides of a view, and a height. Points x inside have n.x + offset > 0.
    """
    fx, fy, cx, cy = intrinsics
    left, top = cx - rect.left + _MARGIN_PX, cy - rect.top + _MARGIN_PX
    right, bottom = rect.width + 2.0 * _MARGIN_PX - left, rect.height + 2.0 * _MARGIN_PX - top
    sides = _unit(fx, left), _unit(-fx, right), _unit(fy, top), _unit(-fy, bottom)
    inwards = np.array(
        [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)]
        + [(across, 0.0, ahead) for across, ahead in sides[:2]]
        + [(0.0, down, ahead) for down, ahead in sides[2:]]
    )
    normals = np.empty((7, 3))
    normals[:6] = inwards @ pose[:3, :3].T
    normals[6] = 0.0, 0.0, 1.0
    offsets = -normals @ pose[:3, 3]
    offsets[0] -= near_m
    offsets[1] += farthest_m
    offsets[6] = -_MARGIN_M - least_m
    return normals, offsets


def _unit(x: float, y: float) -> tuple[float, float]:
    length = math.hypot(x, y)
    return x / length, y / length


def _some_triangle_reaches(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, normals: FloatArray, offsets: FloatArray
) -> bool:
    """Whether a triangle of a mesh reaches to the inner side of each plane.

    Much of a box is empty where one mesh holds the crown of a tree, or the ground and what is painted on it.
    """
    mesh = int(model.geom_dataid[geom])
    first, start, count = (int(values[mesh]) for values in (model.mesh_vertadr, model.mesh_faceadr, model.mesh_facenum))
    least = -_MARGIN_M - offsets - normals @ data.geom_xpos[geom]
    turned = normals @ data.geom_xmat[geom].reshape(3, 3)
    return some_triangle_inside(model.mesh_vert, first, model.mesh_face[start : start + count], turned, least)


@kernel
def some_triangle_inside(
    vertices: NDArray[np.float32], first: int, faces: NDArray[np.int32], normals: FloatArray, least: FloatArray
) -> bool:
    """Whether any of `(F, 3)` triangles reaches to the inner side of each of P planes.

    Vertices of the triangles are counted from the `first` of `(V, 3)`; a point x is inside where `normals` `(P, 3)`
    times x is more than `least` `(P,)`.
    """
    for face in range(len(faces)):
        inside = 0
        while inside < len(normals):
            x, y, z = normals[inside, 0], normals[inside, 1], normals[inside, 2]
            reached = False
            for corner in range(3):
                vertex = first + faces[face, corner]
                distance = x * vertices[vertex, 0] + y * vertices[vertex, 1] + z * vertices[vertex, 2]
                reached = reached or distance > least[inside]
            if not reached:
                break
            inside += 1
        if inside == len(normals):
            return True
    return False
