"""Which geoms cannot matter, told from their bounding boxes: out of view, or unable to come between camera and person.

Every answer errs on the safe side: what is ruled out certainly changes no pixel.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.camera.shapes import CORNERS
from pftrack_sim.render.backend import PixelRect

Array = NDArray[np.float64]

_BOUNDED = [
    int(kind)
    for kind in (
        mujoco.mjtGeom.mjGEOM_SPHERE,
        mujoco.mjtGeom.mjGEOM_CAPSULE,
        mujoco.mjtGeom.mjGEOM_ELLIPSOID,
        mujoco.mjtGeom.mjGEOM_CYLINDER,
        mujoco.mjtGeom.mjGEOM_BOX,
        mujoco.mjtGeom.mjGEOM_MESH,
    )
]
"""Geoms that lie inside their `geom_aabb`."""

_SLACK_M, _SLACK_PX = 0.01, 1.0
"""OpenGL computes in single precision: what misses by less may still touch."""

_FACE_SLACK_M = 1e-4
"""The same for bodies on either side of a face."""

_TOUCH_M = 1e-4
"""A sole that goes into the ground by less stands on it: the ground covers nothing of it."""


class Bounds:
    """Oriented bounding boxes of a model's geoms."""

    def __init__(self, model: mujoco.MjModel) -> None:
        boxes = np.array(model.geom_aabb, dtype=np.float64).reshape(-1, 2, 3)
        self._middle, self._half = boxes[:, 0], boxes[:, 1]
        self._corners = boxes[:, :1] + CORNERS * boxes[:, 1:]
        self._unbounded = ~np.isin(model.geom_type, _BOUNDED)

    def in_view(
        self, data: mujoco.MjData, T_world_camera: Array, K: Array, size: tuple[int, int], near_m: float
    ) -> NDArray[np.bool_]:
        """`(ngeom,)` which geoms may be seen in an image of `size` width and height [px]."""
        normals, offsets = _view(T_world_camera, K, [PixelRect(0, 0, *size)], near_m)
        every = np.arange(len(self._half))
        return self._reaches(data, every, normals, offsets).all(axis=1) | self._unbounded

    def may_occlude(
        self,
        data: mujoco.MjData,
        T_world_camera: Array,
        K: Array,
        geoms: NDArray[np.intp],
        limbs: Sequence[NDArray[np.intp]],
        rects: Sequence[PixelRect],
        farthest_m: Array,
        lowest_m: Array,
        near_m: float,
    ) -> NDArray[np.bool_]:
        """Which geoms may come between the camera and whom.

        Args:
            data: Positions.
            T_world_camera: `(4, 4)` camera pose.
            K: `(3, 3)` camera matrix [px].
            geoms: `(N,)` ids.
            limbs: Geom ids of each of P people.
            rects: Where in the image each is.
            farthest_m: `(P,)` depth of each one's farthest point.
            lowest_m: `(P,)` height of each one's lowest point.
            near_m: Depth below which nothing is drawn.

        Returns:
            `(N, P)`
        """
        normals, offsets = _view(T_world_camera, K, rects, near_m)
        forward = T_world_camera[:3, 2]
        # In front of the near plane, within each person's rectangle, and beginning before the person ends.
        normals = np.concatenate([normals, np.broadcast_to(-forward, (len(rects), 3))])
        offsets = np.concatenate([offsets, farthest_m + forward @ T_world_camera[:3, 3]])
        reaches = self._reaches(data, geoms, normals, offsets)
        sides = reaches[:, 1 : 1 + 4 * len(rects)].reshape(len(geoms), len(rects), 4).all(axis=2)
        covers = reaches[:, :1] & sides & reaches[:, 1 + 4 * len(rects) :]
        # Seen from above, what lies below a person's soles covers nothing of the person.
        looks_down = T_world_camera[2, 3] > lowest_m
        covers &= (self._highest(data, geoms)[:, None] > lowest_m + _TOUCH_M) | ~looks_down
        some = np.flatnonzero(covers.any(axis=1))
        if some.size:
            covers[some] &= ~self._across_a_face(data, T_world_camera[:3, 3], geoms[some], limbs)
        return covers | self._unbounded[geoms, None]

    def _reaches(
        self, data: mujoco.MjData, geoms: NDArray[np.intp], normals: Array, offsets: Array
    ) -> NDArray[np.bool_]:
        """`(N, M)` whether a geom's box has a point x with n.x + offset > 0, for M unit normals n."""
        axes = data.geom_xmat[geoms].reshape(-1, 3, 3)
        middle = data.geom_xpos[geoms] + (axes @ self._middle[geoms, :, None])[:, :, 0]
        radius = (np.abs(normals @ axes) @ self._half[geoms, :, None])[:, :, 0]
        return middle @ normals.T + radius > -offsets - _SLACK_M

    def _highest(self, data: mujoco.MjData, geoms: NDArray[np.intp]) -> Array:
        """`(N,)` height of the top of each geom's box [m]."""
        upright = data.geom_xmat[geoms].reshape(-1, 3, 3)[:, 2]
        rise = np.einsum("nk,nk->n", upright, self._middle[geoms])
        return data.geom_xpos[geoms, 2] + rise + np.einsum("nk,nk->n", np.abs(upright), self._half[geoms])

    def _across_a_face(
        self, data: mujoco.MjData, eye: Array, geoms: NDArray[np.intp], limbs: Sequence[NDArray[np.intp]]
    ) -> NDArray[np.bool_]:
        """`(N, P)` whether camera and a whole person lie on the far side of one face of a geom's box.

        Such a geom covers nothing of the person: the wall of a corridor, the shelf behind it.
        """
        every = np.concatenate(limbs)
        starts = np.concatenate([[0], np.cumsum([8 * len(own) for own in limbs])[:-1]])
        turns = data.geom_xmat[every].reshape(-1, 3, 3)
        points = (self._corners[every] @ turns.transpose(0, 2, 1) + data.geom_xpos[every, None]).reshape(-1, 3)
        axes = data.geom_xmat[geoms].reshape(-1, 3, 3).transpose(0, 2, 1)
        origins = (axes @ data.geom_xpos[geoms, :, None])[:, :, 0] + self._middle[geoms]
        half = (self._half[geoms] + _FACE_SLACK_M)[:, :, None]
        along = (axes.reshape(-1, 3) @ points.T).reshape(len(geoms), 3, -1)
        low = np.minimum.reduceat(along, starts, axis=2) - origins[:, :, None]
        high = np.maximum.reduceat(along, starts, axis=2) - origins[:, :, None]
        seen_from = (axes @ eye - origins)[:, :, None]
        beyond = ((seen_from > half) & (low > half)) | ((seen_from < -half) & (high < -half))
        return beyond.any(axis=1) & ~self._unbounded[geoms, None]


def _view(T_world_camera: Array, K: Array, rects: Sequence[PixelRect], near_m: float) -> tuple[Array, Array]:
    """Planes around what is seen in rectangles of the image: inside is n.x + offset > 0.

    Args:
        T_world_camera: `(4, 4)` camera pose.
        K: `(3, 3)` camera matrix [px].
        rects: P rectangles.
        near_m: Depth of the near plane.

    Returns:
        `(1 + 4 P, 3)` unit normals and `(1 + 4 P,)` offsets, world frame: the near plane, then left, right, top and
        bottom of each rectangle.
    """
    fx, fy, cx, cy = focal_and_centre(K)
    planes = [(0.0, 0.0, 1.0)]
    for left, top, width, height in rects:
        right, bottom = left + width + _SLACK_PX, top + height + _SLACK_PX
        planes += [
            (fx, 0.0, cx - left + _SLACK_PX),
            (-fx, 0.0, right - cx),
            (0.0, fy, cy - top + _SLACK_PX),
            (0.0, -fy, bottom - cy),
        ]
    normals = np.array(planes)
    normals /= np.sqrt(np.einsum("ij,ij->i", normals, normals))[:, None]
    world = normals @ T_world_camera[:3, :3].T
    offsets = -world @ T_world_camera[:3, 3]
    offsets[0] -= near_m
    return world, offsets
