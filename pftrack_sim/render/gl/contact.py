"""Soft darkness on the ground under feet and around furniture and walls, which keep the light of the sky from it.

It is drawn, and no geom: nothing collides with it, and the truth does not know it.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.render.culling import View
from pftrack_sim.scene.layout import CONTACT, CONTACT_HEIGHT_M, CONTACT_OF_THINGS, PEOPLE_GROUP

_OPACITY, _OPACITY_OF_THINGS = 0.65, 0.5
_RESTING_M, _GONE_M = 0.05, 0.22  # Heights of a foot's middle on the ground, and where it darkens nothing
_SEEN_PX, _PLAIN_PX = 3.0, 6.0  # Length in the image below which nothing is drawn, and above which it is opaque
_LENGTH_M = 0.6


class ContactShadows:
    """Those of one model, in a scene that has a material and a mesh for them.

    Args:
        geoms: Those of the scene that may become contact shadows, from the first; at least one more than `feet`.
    """

    def __init__(self, model: mujoco.MjModel, geoms: Sequence[mujoco.MjvGeom]) -> None:
        material = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MATERIAL, CONTACT))
        mesh, things = (
            int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MESH, name)) for name in (CONTACT, CONTACT_OF_THINGS)
        )
        self.feet = feet_of(model) if mesh >= 0 else np.empty(0, dtype=np.intp)
        """Geoms that darken the ground."""
        self._first = int(things >= 0)
        # The axes of meshes and of their geoms are those of their inertia.
        self._shapes = [
            (kind, model.mesh_pos[kind], _axes(model.mesh_quat[kind])) for kind in (things, mesh) if kind >= 0
        ]
        self._geoms, self._material, self._own = geoms, material, 0
        self._keep(self._first)
        # Views of the scene's memory: to look them up takes longer than to write them.
        self._places = [(geom.pos, geom.mat, geom.rgba) for geom in geoms[self._first : self._first + len(self.feet)]]
        self._mesh_axes = self._shapes[-1][2] if self._shapes else np.eye(3)
        self._forward = np.array([_axes(model.geom_quat[geom])[0] for geom in self.feet]).reshape(-1, 3, 1)

    def place(self, view: View, shown: BoolArray) -> int:
        """Place the geoms of things and of the `(F,)` feet that are shown, and return how many there are."""
        kept = np.flatnonzero(shown)
        xpos = view.geom_xpos[self.feet[kept]]
        lengths_px = _LENGTH_M * view.K[0, 0]
        lengths_px /= np.maximum((xpos - view.T_world_camera[:3, 3]) @ view.T_world_camera[:3, 2], view.near_m)
        opacity = np.minimum((_GONE_M - xpos[:, 2]) / (_GONE_M - _RESTING_M), 1.0)
        opacity *= np.minimum(np.maximum(lengths_px - _SEEN_PX, 0.0) / (_PLAIN_PX - _SEEN_PX), 1.0)
        seen = np.flatnonzero(opacity > 0.0)
        self._keep(self._first + len(seen))
        if not seen.size:
            return self._first
        feet = kept[seen]
        forward = (view.geom_xmat[self.feet[feet]].reshape(-1, 3, 3) @ self._forward[feet])[:, :2, 0]
        forward /= np.maximum(np.hypot(forward[:, 0], forward[:, 1]), 1e-9)[:, None]
        turn = np.zeros((len(seen), 3, 3))
        turn[:, :2, 0], turn[:, 0, 1], turn[:, 1, 1], turn[:, 2, 2] = forward, -forward[:, 1], forward[:, 0], 1.0
        xpos[:, 2] = CONTACT_HEIGHT_M
        rows = zip(xpos[seen], turn @ self._mesh_axes, (_OPACITY * opacity[seen]).tolist(), self._places, strict=False)
        for place, axes, dark, (pos, mat, rgba) in rows:
            pos[:], mat[:], rgba[3] = place, axes, dark
        return self._first + len(seen)

    def _keep(self, count: int) -> None:
        """Make the first geoms of the scene contact shadows: those after the last `count` hold other geoms since."""
        for slot in range(self._own, count):
            kind, place, axes = self._shapes[min(slot, len(self._shapes) - 1)]
            geom, colour = self._geoms[slot], np.array([0.0, 0.0, 0.0, _OPACITY_OF_THINGS], dtype=np.float32)
            mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_MESH, np.zeros(3), place, axes.reshape(-1), colour)
            geom.dataid, geom.matid, geom.texcoord, geom.castshadow = 2 * kind, self._material, 1, 0
        self._own = count


def feet_of(model: mujoco.MjModel) -> IntArray:
    """Geoms of people's feet."""
    people: list[int] = np.flatnonzero(np.asarray(model.geom_group) == PEOPLE_GROUP).tolist()
    return np.array([geom for geom in people if model.geom(geom).name.endswith("foot")], dtype=np.intp)


def _axes(quaternion: FloatArray) -> FloatArray:
    """`(3, 3)` rotation matrix of a quaternion."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)
