"""Geoms that cannot change an image: out of view, or unable to occlude any person.

Decided from bounding boxes and conservative: a geom that is ruled out changes no pixel.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from pftrack_sim.camera.extents import CORNERS
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
        self._middle, self._half = boxes[:, 0], boxes[:, 1]
        self._corners = boxes[:, :1] + CORNERS * boxes[:, 1:]
        self._radii = np.linalg.norm(np.abs(self._middle) + self._half, axis=1) + _MARGIN_M
        """Of spheres about the origins of the geoms that hold their boxes, with a margin."""
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
        sides = np.array(_sides(PixelRect(0, 0, *size), focal_and_centre(K)))
        return self._unbounded[ids] | boxes_in_view(
            ids, data.geom_xpos, data.geom_xmat, self._middle, self._half, self._radii,
            np.array(T_world_camera, dtype=np.float64, order="C"), sides, near_m, _MARGIN_M,
        )  # fmt: skip

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
        normals, offsets = _view_planes(T_world_camera, K, rects, near_m)
        forward = T_world_camera[:3, 2]
        # Beyond the near plane, within the person's rectangle, and not entirely behind the person.
        normals = np.concatenate([normals, np.broadcast_to(-forward, (len(rects), 3))])
        offsets = np.concatenate([offsets, farthest_m + forward @ T_world_camera[:3, 3]])

        def within(reaches: BoolArray) -> BoolArray:
            """`(N, P)` from whether geoms reach each of the planes."""
            sides = reaches[:, 1 : 1 + 4 * len(rects)].reshape(-1, len(rects), 4).all(axis=2)
            return reaches[:, :1] & sides & reaches[:, 1 + 4 * len(rects) :]

        occludes = np.repeat(self._unbounded[geoms, None], len(rects), axis=1)
        # Spheres first: few of a place's many geoms are left to look at closely.
        spheres = within(data.geom_xpos[geoms] @ normals.T + offsets > -self._radii[geoms, None])
        near = np.flatnonzero(spheres.any(axis=1))
        if near.size:
            boxes = within(self._reaches(data, geoms[near], normals, offsets))
            # From above, a geom below a person's soles occludes nothing of the person.
            from_above = T_world_camera[2, 3] > lowest_m
            boxes &= (self._top(data, geoms[near])[:, None] > lowest_m + GROUND_CONTACT_M) | ~from_above
            some = np.flatnonzero(boxes.any(axis=1))
            if some.size:
                boxes[some] &= ~self._separated_by_face(data, T_world_camera[:3, 3], geoms[near[some]], limbs)
            occludes[near] |= boxes
        return occludes

    def _reaches(self, data: mujoco.MjData, geoms: IntArray, normals: FloatArray, offsets: FloatArray) -> BoolArray:
        """`(N, M)` whether a geom's box has a point x with n.x + offset > 0, for M unit normals n."""
        axes = data.geom_xmat[geoms].reshape(-1, 3, 3)
        middle = data.geom_xpos[geoms] + (axes @ self._middle[geoms, :, None])[:, :, 0]
        radius = (np.abs(normals @ axes) @ self._half[geoms, :, None])[:, :, 0]
        return middle @ normals.T + radius > -offsets - _MARGIN_M

    def _top(self, data: mujoco.MjData, geoms: IntArray) -> FloatArray:
        """`(N,)` height of the top of each geom's box [m]."""
        vertical = data.geom_xmat[geoms].reshape(-1, 3, 3)[:, 2]
        middle = np.einsum("nk,nk->n", vertical, self._middle[geoms])
        return data.geom_xpos[geoms, 2] + middle + np.einsum("nk,nk->n", np.abs(vertical), self._half[geoms])

    def _separated_by_face(
        self, data: mujoco.MjData, eye: FloatArray, geoms: IntArray, limbs: Sequence[IntArray]
    ) -> BoolArray:
        """`(N, P)` whether the camera and a whole person lie on the outer side of one face of a geom's box.

        Such a geom occludes nothing of the person: a wall of a corridor, a shelf behind the person.
        """
        every = np.concatenate(limbs)
        starts = np.concatenate([[0], np.cumsum([8 * len(own) for own in limbs])[:-1]])
        rotations = data.geom_xmat[every].reshape(-1, 3, 3)
        points = (self._corners[every] @ rotations.transpose(0, 2, 1) + data.geom_xpos[every, None]).reshape(-1, 3)
        axes = data.geom_xmat[geoms].reshape(-1, 3, 3).transpose(0, 2, 1)
        origins = (axes @ data.geom_xpos[geoms, :, None])[:, :, 0] + self._middle[geoms]
        half = (self._half[geoms] + _FACE_MARGIN_M)[:, :, None]
        along = (axes.reshape(-1, 3) @ points.T).reshape(len(geoms), 3, -1)
        low = np.minimum.reduceat(along, starts, axis=2) - origins[:, :, None]
        high = np.maximum.reduceat(along, starts, axis=2) - origins[:, :, None]
        camera = (axes @ eye - origins)[:, :, None]
        separated = ((camera > half) & (low > half)) | ((camera < -half) & (high < -half))
        return separated.any(axis=1) & ~self._unbounded[geoms, None]


def _view_planes(
    T_world_camera: FloatArray, K: FloatArray, rects: Sequence[PixelRect], near_m: float
) -> tuple[FloatArray, FloatArray]:
    """Planes of the views through P rectangles of the image, `n.x + offset > 0` inside, in the world frame.

    Returns:
        `(1 + 4 P, 3)` unit normals and `(1 + 4 P,)` offsets: the near plane, then the left, right, top and bottom of
        each rectangle.
    """
    intrinsics = focal_and_centre(K)
    planes = [(0.0, 0.0, 1.0)]
    for rect in rects:
        planes += _sides(rect, intrinsics)
    normals = np.array(planes)
    normals /= np.sqrt(np.einsum("ij,ij->i", normals, normals))[:, None]
    world = normals @ T_world_camera[:3, :3].T
    offsets = -world @ T_world_camera[:3, 3]
    offsets[0] -= near_m
    return world, offsets


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
