"""Soft darkness on the ground under feet, which keep the light of sky and walls from it: it is drawn, and no geom."""

from __future__ import annotations

import mujoco
import numpy as np

from pftrack_sim.core.types import BoolArray
from pftrack_sim.scene.layout import CONTACT, PEOPLE_GROUP

_HALF_M = np.array([0.30, 0.19, 0.0005])  # Half length, width and thickness
_ABOVE_GROUND_M = 0.004
_OPACITY = 0.65
_RESTING_M, _GONE_M = 0.05, 0.22  # Heights of a foot's middle on the ground, and where it darkens nothing


class ContactShadows:
    """Those of one model, whose scene has a material for them."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._material = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MATERIAL, CONTACT))
        people: list[int] = np.flatnonzero(np.asarray(model.geom_group) == PEOPLE_GROUP).tolist()
        feet = [geom for geom in people if self._material >= 0 and model.geom(geom).name.endswith("foot")]
        self.feet = np.array(feet, dtype=np.intp)
        """Geoms that darken the ground."""
        forward = np.zeros((len(feet), 3))
        for row, geom in zip(forward, feet, strict=True):
            # A mesh's geom has the axes of its inertia: turn the foot's forward direction, x, back into them.
            mujoco.mju_rotVecQuat(row, (1.0, 0.0, 0.0), model.geom_quat[geom] * (1.0, -1.0, -1.0, -1.0))
        self._forward = forward

    def add(self, data: mujoco.MjData, scene: mujoco.MjvScene, shown: BoolArray) -> None:
        """Add those of the `(F,)` feet that are shown to a scene."""
        places = data.geom_xpos[self.feet[shown]]
        axes = data.geom_xmat[self.feet[shown]].reshape(-1, 3, 3)
        forward = (axes @ self._forward[shown, :, None])[..., 0]
        opacity = _OPACITY * np.clip((_GONE_M - places[:, 2]) / (_GONE_M - _RESTING_M), 0.0, 1.0)
        level = np.zeros((len(places), 3, 3))
        level[:, :2, 0] = forward[:, :2] / np.maximum(np.linalg.norm(forward[:, :2], axis=1), 1e-9)[:, None]
        level[:, 0, 1], level[:, 1, 1], level[:, 2, 2] = -level[:, 1, 0], level[:, 0, 0], 1.0
        for place, turn, share in zip(places, level.reshape(-1, 9), opacity, strict=True):
            geom = scene.geoms[scene.ngeom]
            middle, colour = np.array([place[0], place[1], _ABOVE_GROUND_M]), np.array([0, 0, 0, share], np.float32)
            mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_BOX, _HALF_M, middle, turn, colour)
            geom.matid, geom.castshadow = self._material, 0
            scene.ngeom += 1
