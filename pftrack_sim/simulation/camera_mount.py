"""The mast and head that carry the camera, displaced with it: a shaken camera does not see what it stands on."""

from __future__ import annotations

import mujoco
import numpy as np

from pftrack_sim.core.types import FloatArray
from pftrack_sim.render.backend import geoms_drawn

_BODIES = ("robot/mast", "robot/pan", "robot/head")


class CameraMount:
    """Drawn geoms of a model's mast, pan unit and head."""

    def __init__(self, model: mujoco.MjModel) -> None:
        bodies = [model.body(name).id for name in _BODIES]
        self._geoms = np.flatnonzero(geoms_drawn(model) & np.isin(model.geom_bodyid, bodies))

    def follow(self, data: mujoco.MjData, T_world_rest: FloatArray, T_world_camera: FloatArray) -> None:
        """Displace the mount rigidly with the camera.

        Args:
            data: Poses; those of the mount's geoms change until kinematics are computed again.
            T_world_rest: `(4, 4)` camera pose without vibration.
            T_world_camera: `(4, 4)` camera pose with it.
        """
        rotation = T_world_camera[:3, :3] @ T_world_rest[:3, :3].T
        positions, rotations = data.geom_xpos[self._geoms], data.geom_xmat[self._geoms].reshape(-1, 3, 3)
        data.geom_xpos[self._geoms] = (positions - T_world_rest[:3, 3]) @ rotation.T + T_world_camera[:3, 3]
        data.geom_xmat[self._geoms] = (rotation @ rotations).reshape(-1, 9)
