"""Soft darkness on the ground under feet and around furniture and walls, which keep the light of the sky from it.

It is drawn, and no geom: nothing collides with it, and the truth does not know it.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.render.culling import View
from pftrack_sim.scene.layout import CONTACT, CONTACT_HEIGHT_M, CONTACT_OF_THINGS, PEOPLE_GROUP

_OPACITY, _OPACITY_OF_THINGS = 0.65, 0.5
_RESTING_M, _GONE_M = 0.05, 0.22  # Heights of a foot's middle on the ground, and where it darkens nothing
_SEEN_PX, _PLAIN_PX = 3.0, 6.0  # Length in the image below which nothing is drawn, and above which it is opaque
_LENGTH_M = 0.6


class ContactShadows:
    """Those of one model, whose scene has a material and a mesh for them."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._material = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MATERIAL, CONTACT))
        self._mesh = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MESH, CONTACT))
        people: list[int] = np.flatnonzero(np.asarray(model.geom_group) == PEOPLE_GROUP).tolist()
        feet = [geom for geom in people if self._mesh >= 0 and model.geom(geom).name.endswith("foot")]
        self.feet = np.array(feet, dtype=np.intp)
        """Geoms that darken the ground."""
        # The axes of meshes and of their geoms are those of their inertia.
        self._things = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MESH, CONTACT_OF_THINGS))
        self._things_place, self._things_axes = np.zeros(3), np.eye(3)
        if self._things >= 0:
            self._things_place = np.array(model.mesh_pos[self._things])
            self._things_axes = _axes(model.mesh_quat[self._things])
        self._mesh_axes = _axes(model.mesh_quat[self._mesh]) if self._mesh >= 0 else np.eye(3)
        self._forward = np.array([_axes(model.geom_quat[geom])[0] for geom in feet]).reshape(-1, 3)

    def add(self, view: View, scene: mujoco.MjvScene, shown: BoolArray) -> None:
        """Add those of things, and of the `(F,)` feet that are shown, to a scene."""
        if self._things >= 0:
            colour = np.array([0.0, 0.0, 0.0, _OPACITY_OF_THINGS], dtype=np.float32)
            self._draw(scene, self._things, self._things_place, self._things_axes, colour)
        places = view.geom_xpos[self.feet]
        depths = np.maximum((places - view.T_world_camera[:3, 3]) @ view.T_world_camera[:3, 2], view.near_m)
        opacity = np.clip((_GONE_M - places[:, 2]) / (_GONE_M - _RESTING_M), 0.0, 1.0)
        opacity *= np.clip((_LENGTH_M * view.K[0, 0] / depths - _SEEN_PX) / (_PLAIN_PX - _SEEN_PX), 0.0, 1.0)
        for foot in np.flatnonzero(shown & (opacity > 0.0)):
            x, y, _ = view.geom_xmat[self.feet[foot]].reshape(3, 3) @ self._forward[foot]
            length = max(float(np.hypot(x, y)), 1e-9)
            turn = np.array([[x, -y, 0.0], [y, x, 0.0], [0.0, 0.0, length]]) / length @ self._mesh_axes
            place = np.array([*places[foot, :2], CONTACT_HEIGHT_M])
            colour = np.array([0.0, 0.0, 0.0, _OPACITY * opacity[foot]], dtype=np.float32)
            self._draw(scene, self._mesh, place, turn, colour)

    def _draw(
        self, scene: mujoco.MjvScene, mesh: int, place: FloatArray, turn: FloatArray, colour: NDArray[np.float32]
    ) -> None:
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_MESH, np.zeros(3), place, turn.reshape(-1), colour)
        geom.dataid, geom.matid, geom.texcoord, geom.castshadow = 2 * mesh, self._material, 1, 0
        scene.ngeom += 1


def _axes(quaternion: FloatArray) -> FloatArray:
    """`(3, 3)` rotation matrix of a quaternion."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)
