"""Geoms that cannot change an image: out of view, or unable to occlude any person.

Decided from bounding boxes and conservative: a geom that is ruled out changes no pixel.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.render.backend import PixelRect

_BOUNDED_TYPES = [
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name}"))
    for name in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX", "MESH")
]
"""Types of geoms that lie inside their `geom_aabb`."""

_MARGIN_M, _MARGIN_PX = 0.01, 1.0  # OpenGL computes in single precision: a geom outside by less may still touch a pixel
_FACE_MARGIN_M = 1e-4  # The same, for a person and the camera on the far side of a face
GROUND_CONTACT_M = 1e-4  # Soles penetrate the ground by up to this much without being occluded by it


class Bounds:
    """Oriented bounding boxes of a model's geoms."""

    def __init__(self, model: mujoco.MjModel) -> None:
        boxes = np.array(model.geom_aabb, dtype=np.float64).reshape(-1, 2, 3)
        middle, half = np.ascontiguousarray(boxes[:, 0]), np.ascontiguousarray(boxes[:, 1])
        radii = np.linalg.norm(np.abs(middle) + half, axis=1) + _MARGIN_M
        self._boxes = middle, half, radii
        self._unbounded = ~np.isin(model.geom_type, _BOUNDED_TYPES)
        self._ids: IntArray = np.arange(model.ngeom)

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

        ids = self._ids if geoms is None else geoms
        poses, pose = (data.geom_xpos, data.geom_xmat), np.array(T_world_camera, dtype=np.float64, order="C")
        sides = np.array(_sides(PixelRect(0, 0, *size), focal_and_centre(K)))
        return self._unbounded[ids] | boxes_in_view(ids, poses, self._boxes, pose, sides, near_m, _MARGIN_M)

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
        from pftrack_sim.render.culling_kernels import boxes_before_people  # numba: imported when it is used

        poses, pose = (data.geom_xpos, data.geom_xmat), np.array(T_world_camera, dtype=np.float64, order="C")
        intrinsics = focal_and_centre(K)
        sides = np.array([_sides(rect, intrinsics) for rect in rects])
        # From above, a geom below a person's soles occludes nothing of the person.
        above_m = np.where(pose[2, 3] > lowest_m, lowest_m + GROUND_CONTACT_M, -np.inf)
        ends = np.cumsum([0, *map(len, limbs)])
        return self._unbounded[geoms, None] | boxes_before_people(
            geoms, poses, self._boxes, pose, sides, near_m, farthest_m, above_m, np.concatenate(limbs), ends, _MARGIN_M,
            _FACE_MARGIN_M,
        )  # fmt: skip


def _sides(rect: PixelRect, intrinsics: tuple[float, float, float, float]) -> tuple[tuple[float, float, float], ...]:
    """Inward normals, of any length, of the left, right, top and bottom of a view, in camera axes."""
    fx, fy, cx, cy = intrinsics
    left, top, width, height = rect
    right, bottom = left + width + _MARGIN_PX, top + height + _MARGIN_PX
    return (
        (fx, 0.0, cx - left + _MARGIN_PX),
        (-fx, 0.0, right - cx),
        (0.0, fy, cy - top + _MARGIN_PX),
        (0.0, -fy, bottom - cy),
    )
