"""The mast and head that carry the camera, displaced with it where they would otherwise stand in its view."""

from __future__ import annotations

import mujoco
import numpy as np

from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.core.types import FloatArray
from pftrack_sim.render.backend import clip_depths_m, geoms_drawn
from pftrack_sim.render.culling import Bounds

_BODIES = ("robot/mast", "robot/pan", "robot/head")


class CameraMount:
    """Drawn geoms of a model's mast, pan unit and head.

    A vibration of the mount displaces the camera alone. By a few millimetres, all of the head remains behind the
    camera; where wind takes the camera farther back, the mount follows it.

    Args:
        model: With the robot.
        K: `(3, 3)` camera matrix [px], but for its principal point, which is the middle of the image.
        size: Width and height of the rendered image [px].
    """

    def __init__(self, model: mujoco.MjModel, K: FloatArray, size: tuple[int, int]) -> None:
        bodies = [model.body(name).id for name in _BODIES]
        self._geoms = np.flatnonzero(geoms_drawn(model) & np.isin(model.geom_bodyid, bodies))
        self._bounds, self._near_m = Bounds(model), clip_depths_m(model)[0]
        self._unbounded = bool(self._bounds.unbounded[self._geoms].any())
        self._intrinsics, self._size = (*focal_and_centre(K)[:2], 0.5 * size[0], 0.5 * size[1]), size

    def follow(self, data: mujoco.MjData, T_world_rest: FloatArray, T_world_camera: FloatArray) -> None:
        """Displace the mount rigidly with the camera if the camera would see a part of it.

        Args:
            data: Poses; those of the mount's geoms may change until kinematics are computed again.
            T_world_rest: `(4, 4)` camera pose without vibration.
            T_world_camera: `(4, 4)` camera pose with it.
        """
        view = np.ascontiguousarray(T_world_camera), self._intrinsics, self._size, self._near_m, self._geoms
        if not self._unbounded and not self._bounds.any_in_view(data, *view):
            return
        displacement = T_world_camera @ np.linalg.inv(T_world_rest)
        rotation, translation = displacement[:3, :3], displacement[:3, 3]
        rotations = data.geom_xmat[self._geoms].reshape(-1, 3, 3)
        data.geom_xpos[self._geoms] = data.geom_xpos[self._geoms] @ rotation.T + translation
        data.geom_xmat[self._geoms] = (rotation @ rotations).reshape(-1, 9)
