"""Geoms that cannot change an image: out of view, or unable to occlude any person.

Decided from bounding boxes, and before people from the triangles of meshes too. Conservative: a geom that is ruled out
changes no pixel.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import mujoco
import numpy as np

from pftrack_sim.camera.pinhole import Intrinsics, focal_and_centre
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.render.backend import PixelRect

_BOUNDED_TYPES = [
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name}"))
    for name in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX", "MESH")
]
"""Types of geoms that lie inside their `geom_aabb`."""

GROUND_CONTACT_M = 1e-4  # Soles penetrate the ground by up to this much without being occluded by it


class Bounds:
    """Oriented bounding boxes of a model's geoms.

    Args:
        model: The model.
        triangles: Whether `may_occlude` looks at the triangles of meshes, too; the model is then kept until `release`.
    """

    def __init__(self, model: mujoco.MjModel, *, triangles: bool = False) -> None:
        boxes = np.array(model.geom_aabb, dtype=np.float64).reshape(-1, 2, 3)
        middle, half = np.ascontiguousarray(boxes[:, 0]), np.ascontiguousarray(boxes[:, 1])
        radii = np.linalg.norm(np.abs(middle) + half, axis=1)
        self._boxes = middle, half, radii
        self.unbounded: BoolArray = ~np.isin(model.geom_type, _BOUNDED_TYPES)
        """`(ngeom,)` geoms without a box: nothing is ever ruled out for them."""
        self._ids: IntArray = np.arange(model.ngeom)
        vertices, faces = np.empty((0, 3), dtype=np.float32), np.empty((0, 3), dtype=np.int32)
        self._meshes = vertices, faces, np.zeros((model.ngeom, 3), dtype=np.intp)
        if triangles:
            ranges = np.stack([model.mesh_vertadr, model.mesh_faceadr, model.mesh_facenum], axis=1).astype(np.intp)
            is_mesh = (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)[:, None]
            of_geoms = ranges[model.geom_dataid] if len(ranges) else self._meshes[2]
            self._meshes = model.mesh_vert, model.mesh_face, np.where(is_mesh, of_geoms, 0)

    def release(self) -> None:
        """Release the triangles; `may_occlude` then looks at boxes alone."""
        vertices, faces, ranges = self._meshes
        self._meshes = vertices[:0].copy(), faces[:0].copy(), np.zeros_like(ranges)

    def in_view(
        self,
        data: mujoco.MjData,
        T_world_camera: FloatArray,
        K: FloatArray,
        size: tuple[int, int],
        near_m: float,
        geoms: IntArray | None = None,
    ) -> BoolArray:
        """`(N,)` which geoms, None for all, may be visible in an image of `size` width and height [px]."""
        from pftrack_sim.render.culling_kernels import boxes_in_view  # numba: imported when it is used

        ids, poses = self._ids if geoms is None else geoms, (data.geom_xpos, data.geom_xmat)
        pose, rect = np.ascontiguousarray(T_world_camera, dtype=np.float64), (0, 0, *size)
        found = boxes_in_view(ids, poses, self._boxes, pose, focal_and_centre(K), rect, near_m)
        return self.unbounded[ids] | found

    def hidden(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        T_world_camera: FloatArray,
        intrinsics: Intrinsics,
        size: tuple[int, int],
        near_m: float,
        geoms: IntArray,
    ) -> IntArray:
        """`(M,)` places among `(N,)` geoms of those that change no pixel of a color image of `size`, see `in_view`.

        None where a material of the model reflects; none that casts a shadow, where a light casts any. The intrinsics
        are the focal lengths fx, fy and the principal point cx, cy [px].
        """
        from pftrack_sim.render.culling_kernels import hidden_boxes  # numba: imported when it is used

        poses, rect = (data.geom_xpos, data.geom_xmat), (0, 0, *size)
        pose = np.ascontiguousarray(T_world_camera, dtype=np.float64)
        return hidden_boxes(
            geoms, poses, self._boxes, self.unbounded, pose, intrinsics, rect, near_m, model.mat_reflectance,
            model.light_active, model.light_castshadow, model.geom_castshadow,
        )  # fmt: skip

    def any_in_view(
        self,
        data: mujoco.MjData,
        T_world_camera: FloatArray,
        intrinsics: Intrinsics,
        size: tuple[int, int],
        near_m: float,
        geoms: IntArray,
    ) -> bool:
        """Whether any of some geoms, none of them `unbounded`, may be visible; see `in_view`.

        The intrinsics are the focal lengths fx, fy and the principal point cx, cy [px].
        """
        from pftrack_sim.render.culling_kernels import any_box_in_view  # numba: imported when it is used

        poses, rect = (data.geom_xpos, data.geom_xmat), (0, 0, *size)
        return any_box_in_view(geoms, poses, self._boxes, T_world_camera, intrinsics, rect, near_m)

    def may_occlude(
        self,
        data: mujoco.MjData,
        T_world_camera: FloatArray,
        K: FloatArray,
        geoms: IntArray,
        limbs: Sequence[IntArray],
        rects: Sequence[PixelRect],
        farthest_m: FloatArray,
        lowest_m: FloatArray,
        near_m: float,
    ) -> BoolArray:
        """`(N, P)` whether each of N geoms may occlude each of P people.

        Args:
            data: Poses.
            T_world_camera: `(4, 4)` camera pose.
            K: `(3, 3)` camera matrix [px].
            geoms: `(N,)` ids.
            limbs: Geom ids of each person.
            rects: Rectangle of the image around each person.
            farthest_m: `(P,)` depth of each person's farthest point.
            lowest_m: `(P,)` height of each person's lowest point.
            near_m: Depth of the near plane.
        """
        from pftrack_sim.render.culling_kernels import Meshes, boxes_before_people  # numba: imported when it is used

        poses, pose = (data.geom_xpos, data.geom_xmat), np.ascontiguousarray(T_world_camera, dtype=np.float64)
        # From above, a geom below a person's soles occludes nothing of the person.
        above_m = np.where(pose[2, 3] > lowest_m, lowest_m + GROUND_CONTACT_M, -np.inf)
        ends = np.array([0, *itertools.accumulate(map(len, limbs))])
        found = boxes_before_people(
            geoms, poses, self._boxes, Meshes(*self._meshes), pose, focal_and_centre(K), np.array(rects), near_m,
            farthest_m, above_m, np.concatenate(limbs), ends,
        )  # fmt: skip
        return self.unbounded[geoms, None] | found

    def any_may_occlude(
        self,
        data: mujoco.MjData,
        T_world_camera: FloatArray,
        intrinsics: Intrinsics,
        geoms: IntArray,
        limbs: IntArray,
        rect: PixelRect,
        farthest_m: float,
        lowest_m: float,
        near_m: float,
    ) -> bool:
        """Whether any of some geoms, none of them `unbounded`, may occlude a person; see `may_occlude`.

        Args:
            data: Poses.
            T_world_camera: `(4, 4)` camera pose.
            intrinsics: Focal lengths fx, fy and principal point cx, cy [px].
            geoms: `(N,)` ids.
            limbs: Geom ids of the person.
            rect: Rectangle of the image around the person.
            farthest_m: Depth of the person's farthest point.
            lowest_m: Height of the person's lowest point.
            near_m: Depth of the near plane.
        """
        from pftrack_sim.render.culling_kernels import Meshes, any_box_before  # numba: imported when it is used

        above_m = lowest_m + GROUND_CONTACT_M if T_world_camera[2, 3] > lowest_m else -math.inf
        return any_box_before(
            geoms, (data.geom_xpos, data.geom_xmat), self._boxes, Meshes(*self._meshes), T_world_camera, intrinsics,
            (rect.left, rect.top, rect.width, rect.height), near_m, farthest_m, above_m, limbs,
        )  # fmt: skip
