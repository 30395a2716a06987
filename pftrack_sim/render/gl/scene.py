"""One model as MuJoCo's classic renderer takes it: geoms in view, camera, lights, and the brightness of the sky."""

from __future__ import annotations

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.pinhole import Intrinsics, frustum
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.render.backend import DRAWN_GROUPS, PixelRect, sky_material
from pftrack_sim.render.culling import Bounds
from pftrack_sim.render.gl.resources import Resources
from pftrack_sim.scene.layout import SCENERY_GROUP

_NEVER_DRAWN_GROUP = 5
_STATIC_AND_DYNAMIC = int(mujoco.mjtCatBit.mjCAT_STATIC) | int(mujoco.mjtCatBit.mjCAT_DYNAMIC)
_SPARE_GEOMS = 64
_NO_PERTURBATION = mujoco.MjvPerturb()


class ModelScene:
    """MuJoCo scenes of one model, for color images and for segmentations.

    Of `(ngeom,)` geoms those that are `visible` are drawn at all; `clip_m` are the depths of the near and far plane.
    Geoms are hidden by their group in the model, which is restored at once.
    """

    def __init__(self, model: mujoco.MjModel, visible: BoolArray, clip_m: tuple[float, float]) -> None:
        self._model = model
        self._visible = np.flatnonzero(visible)
        self._clip_m = clip_m
        self._options = _geoms_only()
        self._bounds = Bounds(model)
        self._color = mujoco.MjvScene(model, model.ngeom + _SPARE_GEOMS)
        self._color.flags[mujoco.mjtRndFlag.mjRND_FOG] = False
        self._groups = model.geom_group.copy()
        self._ids = mujoco.MjvScene(model, model.ngeom + _SPARE_GEOMS)
        self._ids.flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = True
        self._ids.flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = True
        self._views = {scene: _View(scene) for scene in (self._color, self._ids)}
        self.sky = Sky(model)

    def color_scene(
        self, data: mujoco.MjData, T_world_camera: FloatArray, intrinsics: Intrinsics, size: tuple[int, int]
    ) -> mujoco.MjvScene:
        """What a color image of `size` width and height [px] shows.

        Geoms out of view are left out where that changes no pixel: MuJoCo passes everything to OpenGL, and software
        OpenGL transforms every vertex of it.
        """
        model, hidden = self._model, self._hidden(data, T_world_camera, intrinsics, size)
        model.geom_group[hidden] = _NEVER_DRAWN_GROUP
        self._compose(self._color, data, T_world_camera, intrinsics, size)
        model.geom_group[hidden] = self._groups[hidden]
        mujoco.mjv_makeLights(model, data, self._color)
        return self._color

    def _hidden(
        self, data: mujoco.MjData, T_world_camera: FloatArray, intrinsics: Intrinsics, size: tuple[int, int]
    ) -> IntArray:
        """Visible geoms that change no pixel of a color image; none that casts a shadow, where a light casts any."""
        model, geoms = self._model, self._visible
        if (model.mat_reflectance > 0.0).any():
            return geoms[:0]
        rect = PixelRect(0, 0, *size)
        shown = self._bounds.in_view(data, T_world_camera, intrinsics, rect, self._clip_m[0], geoms)
        if (model.light_active & model.light_castshadow).any():
            shown |= model.geom_castshadow[geoms]
        return geoms[~shown]

    def ids_scene(
        self,
        data: mujoco.MjData,
        T_world_camera: FloatArray,
        intrinsics: Intrinsics,
        size: tuple[int, int],
        geoms: BoolArray,
    ) -> tuple[mujoco.MjvScene, NDArray[np.int32]]:
        """What a segmentation shows, and the geom id of each colour code: -1 of code 0."""
        self._model.geom_group[:] = np.where(geoms, SCENERY_GROUP, _NEVER_DRAWN_GROUP)
        self._compose(self._ids, data, T_world_camera, intrinsics, size)
        self._model.geom_group[:] = self._groups
        order = np.flatnonzero(geoms)
        if self._ids.ngeom != order.size:
            # MuJoCo left some geoms out or added others.
            order = np.array([geom.objid for geom in list(self._ids.geoms)[: self._ids.ngeom]], dtype=np.intp)
        return self._ids, np.concatenate([[-1], order]).astype(np.int32)

    def _compose(
        self,
        scene: mujoco.MjvScene,
        data: mujoco.MjData,
        T_world_camera: FloatArray,
        intrinsics: Intrinsics,
        size: tuple[int, int],
    ) -> None:
        """Place the camera, then add what it sees.

        `mjv_updateScene` places the camera last, so that whatever depends on it (the headlight, the tiles of an
        infinite plane) would come from the camera of the previous frame.
        """
        self._views[scene].place(T_world_camera, intrinsics, size, self._clip_m)
        scene.ngeom = 0
        mujoco.mjv_addGeoms(self._model, data, self._options, _NO_PERTURBATION, _STATIC_AND_DYNAMIC, scene)


class _View:
    """The camera of one scene: MuJoCo draws the average of a left and a right eye, and both get the same camera."""

    def __init__(self, scene: mujoco.MjvScene) -> None:
        self._eyes = tuple(scene.camera)
        self._pose: bytes | None = None
        self._lens: tuple[Intrinsics, tuple[int, int]] | None = None

    def place(
        self, T_world_camera: FloatArray, intrinsics: Intrinsics, size: tuple[int, int], clip_m: tuple[float, float]
    ) -> None:
        """Set what differs from the last view."""
        pose, lens = T_world_camera.tobytes(), (intrinsics, size)
        if pose != self._pose:
            self._pose = pose
            position, forward, up = T_world_camera[:3, 3], T_world_camera[:3, 2], -T_world_camera[:3, 1]
            for eye in self._eyes:
                eye.pos[:], eye.forward[:], eye.up[:] = position, forward, up
        if lens != self._lens:
            self._lens = lens
            view = frustum(intrinsics, *size, *clip_m)
            for eye in self._eyes:
                eye.frustum_center = 0.5 * (view.left + view.right)
                eye.frustum_width = 0.5 * (view.right - view.left)
                eye.frustum_bottom, eye.frustum_top = view.bottom, view.top
                eye.frustum_near, eye.frustum_far = view.near, view.far
                eye.orthographic = 0


class Sky:
    """Keeps OpenGL's sky texture as bright as the model's sky material.

    OpenGL draws a sky without lighting, so its texture itself is made brighter or darker.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._material = sky_material(model)
        skies = np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX)
        self._texture = int(skies[0]) if self._material >= 0 and skies.size else -1
        self._uploaded = 1.0

    def update(self, resources: Resources) -> None:
        """Upload the texture again if the brightness has changed; the OpenGL context must be current."""
        model, texture = self._model, self._texture
        if texture < 0 or (brightness := float(model.mat_emission[self._material])) == self._uploaded:
            return
        start = int(model.tex_adr[texture])
        size = int(model.tex_width[texture]) * int(model.tex_height[texture]) * int(model.tex_nchannel[texture])
        texels = model.tex_data[start : start + size]
        original = texels.copy()
        levels = np.clip(np.round(np.arange(256) * brightness), 0.0, 255.0).astype(np.uint8)
        texels[:] = cv2.LUT(original, levels).reshape(-1)
        resources.upload_texture(model, texture)
        texels[:] = original
        self._uploaded = brightness


def _geoms_only() -> mujoco.MjvOption:
    """Options that draw geoms of the drawn groups, and no sites, joints or other decoration."""
    options = mujoco.MjvOption()
    for kind in ("geom", "site", "joint", "tendon", "actuator", "flex", "skin"):
        getattr(options, f"{kind}group")[:] = 0
    options.geomgroup[list(DRAWN_GROUPS)] = 1
    return options
