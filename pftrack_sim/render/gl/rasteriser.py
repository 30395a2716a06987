"""MuJoCo's classic OpenGL renderer with any camera pose and matrix.

Unlike `mujoco.Renderer`, it takes the camera as an argument instead of from the model, needs no environment variable,
leaves out what is not in view, and keeps its textures and meshes when the model changes.
"""

from __future__ import annotations

import math
import weakref

import cv2
import mujoco
import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import RenderError
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray, IntArray
from pftrack_sim.render.culling import Bounds, PixelRect, ShadowMap, View
from pftrack_sim.render.gl.contact import ContactShadows, feet_of
from pftrack_sim.render.gl.context import GLContext, open_context
from pftrack_sim.render.gl.resources import Resources
from pftrack_sim.render.renderer import (
    Renderer,
    checked_poses,
    clip_depths_m,
    geoms_drawn,
    sky_material,
)
from pftrack_sim.render.triangles import Detail

_FIRST, _LAST, _NEVER = 0, 1, 5  # Groups of geoms while they are drawn: one after the other, and not at all
_STATIC_AND_DYNAMIC = int(mujoco.mjtCatBit.mjCAT_STATIC) | int(mujoco.mjtCatBit.mjCAT_DYNAMIC)
_SPARE_GEOMS = 64
_BACKDROP_M = 8.0  # Radius from which a geom is drawn after the smaller ones, which are mostly before it
_DIRECTIONAL = int(mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
_LIGHT_M = 40.0  # Distance of a directional light from what it shines on: nothing that casts shadows is beyond it
_AHEAD = 0.95  # Middle of a shadow map before the camera, as a share of half its width
_NO_PERTURBATION = mujoco.MjvPerturb()


class Rasteriser(Renderer):
    """Draws one model off-screen with OpenGL; see `pftrack_sim.render.renderer.Renderer`.

    Any thread may use it, one at a time. Several can exist in one process; those of one model draw one at a time, too,
    since geoms are hidden in the model while it is drawn.

    Args:
        model: What to draw. Its `vis` settings hold for multisampling, shadow size, near and far plane; its
            off-screen size is ignored.
        context: The OpenGL context; None takes that of the thread.

    Raises:
        RenderError: No OpenGL library can draw.
    """

    def __init__(self, model: mujoco.MjModel, width_px: int, height_px: int, context: GLContext | None = None) -> None:
        super().__init__(width_px, height_px)
        self._context = context or open_context()
        self.info = self._context.info
        self.description = f"{self.info.backend}: {self.info.renderer}, {self.info.vendor}, OpenGL {self.info.version}"
        self._scene: _Scene | None = None
        self._resources: list[Resources] = []
        """One of the last model bound; none before."""
        self._finalizer = weakref.finalize(self, _free, self._context, self._resources)
        self._finalizer.atexit = False
        self._pixels = np.empty((self.height_px, self.width_px, 4), dtype=np.uint8)
        self.rebind(model)

    def rebind(self, model: mujoco.MjModel) -> None:
        """Draw another model from now on. It takes over the textures and meshes of the last one that equal its own."""
        self.unbind()
        with self._context.current():
            if not self._resources or not self._resources[0].replace(model):
                if self._resources:
                    self._resources.pop().free()
                self._resources.append(Resources(model, (self.width_px, self.height_px)))
        self._scene = _Scene(model, self._resources[0])

    def unbind(self) -> None:
        """See `Renderer.unbind`. Textures and meshes stay in OpenGL's memory until the next `rebind`."""
        self._scene = None

    def color(
        self, data: mujoco.MjData, T_world_camera: ArrayLike, K: ArrayLike, *, rows: slice | None = None
    ) -> Image:
        """See `Renderer`. Edges of an image of rows may differ from the whole image by the rounding of subpixels."""
        if self._scene is None:
            problem = "has no model: rebind it" if self._finalizer.alive else "has been closed"
            raise RenderError(f"this renderer {problem}")
        matrix, height = np.array(K, dtype=np.float64), self.height_px
        if rows is not None:
            matrix[1, 2] -= rows.start
            height = rows.stop - rows.start
        pixels, area = self._pixels[:height], mujoco.MjrRect(0, 0, self.width_px, height)
        scene = self._scene.composed(data, checked_poses(T_world_camera), matrix, (self.width_px, height))
        with self._context.current():
            resources = self._resources[0]
            self._scene.update_sky()
            # Another renderer's may be bound in the context.
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, resources.context)
            mujoco.mjr_render(area, scene, resources.context)
            mujoco.mjr_readPixels(pixels, None, area, resources.context)
        # OpenGL counts rows from the bottom.
        image = cv2.cvtColor(pixels, cv2.COLOR_RGBA2RGB)
        return np.asarray(cv2.flip(image, 0, image), dtype=np.uint8)

    def close(self) -> None:
        """See `Renderer.close`."""
        self._scene = None
        self._finalizer()


def _free(context: GLContext, resources: list[Resources]) -> None:
    """Free on `close` or garbage collection."""
    while resources:
        context.free_soon(resources.pop().free)


class _Scene:
    """MuJoCo's scene of one model: geoms in view, camera, lights, and the brightness of the sky."""

    def __init__(self, model: mujoco.MjModel, resources: Resources) -> None:
        self._model, self._resources = model, resources
        self._geoms = np.flatnonzero(geoms_drawn(model))
        self._groups = model.geom_group.copy()
        self._clip_m = clip_depths_m(model)
        self._bounds, self._detail = Bounds(model), Detail(model)
        backdrop = (model.geom_rbound > _BACKDROP_M) | (model.geom_rbound == 0.0)  # A plane has no radius
        self._turns = np.where(backdrop, _LAST, _FIRST)
        self._options = _geoms_only(_FIRST), _geoms_only(_LAST)
        self._scene = mujoco.MjvScene(model, model.ngeom + len(feet_of(model)) + _SPARE_GEOMS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = False
        self._contact = ContactShadows(model, self._scene.geoms)
        self._eyes = tuple(self._scene.camera)  # MuJoCo draws the average of two eyes: both get the same camera
        self._sky_material = sky_material(model)
        skies = np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX)
        self._sky = int(skies[0]) if self._sky_material >= 0 and skies.size else -1
        self._sky_brightness = 1.0

    def composed(
        self, data: mujoco.MjData, T_world_camera: FloatArray, K: FloatArray, size: tuple[int, int]
    ) -> mujoco.MjvScene:
        """What an image of `size` width and height [px] shows.

        Geoms are hidden and ordered by their group in the model and simplified by their mesh, which are restored at
        once: MuJoCo passes all others to OpenGL, and software OpenGL transforms every vertex of them.
        """
        model, scene = self._model, self._scene
        view = View(data.geom_xpos, data.geom_xmat, T_world_camera, K, self._clip_m[0])
        lights = np.flatnonzero(model.light_active & model.light_castshadow)
        maps = {int(light): shadow_map(model, data.light_xdir[light], T_world_camera)
                for light in lights if model.light_type[light] == _DIRECTIONAL}  # fmt: skip
        shown = self._shown(view, PixelRect(0, 0, *size), lights, maps)
        turns = np.full(model.ngeom, _NEVER)
        turns[shown] = self._turns[shown]
        # `mjv_updateScene` places the camera last, so that whatever depends on it (the headlight, the tiles of an
        # infinite plane) would come from the camera of the previous frame.
        self._place_camera(view, size)
        scene.ngeom = self._contact.place(view, turns[self._contact.feet] != _NEVER)
        model.geom_group[:] = turns
        model.geom_dataid[shown] = self._detail.meshes.ravel()[self._detail.shapes(view, shown)]
        for options in self._options:
            mujoco.mjv_addGeoms(model, data, options, _NO_PERTURBATION, _STATIC_AND_DYNAMIC, scene)
        model.geom_group[:], model.geom_dataid[:] = self._groups, self._detail.meshes[0]
        mujoco.mjv_makeLights(model, data, scene)
        for light in scene.lights[: scene.nlight]:
            if light.id in maps:
                light.pos[:] = maps[light.id].centre - _LIGHT_M * maps[light.id].direction
        return scene

    def _shown(self, view: View, rect: PixelRect, lights: IntArray, maps: dict[int, ShadowMap]) -> IntArray:
        """Geoms that may change a pixel, where some lights cast shadows: all casters, where a lamp has no map."""
        model, geoms = self._model, self._geoms
        if (model.mat_reflectance > 0.0).any():
            return geoms
        shown = self._bounds.in_view(view, rect, geoms)
        if lights.size:
            casters = np.flatnonzero(~shown & model.geom_castshadow[geoms])
            if len(maps) == len(lights):
                reaching = [self._bounds.may_shade(view, rect, geoms[casters], one) for one in maps.values()]
                casters = casters[np.logical_or.reduce(reaching)]
            shown[casters] = True
        return geoms[shown]

    def _place_camera(self, view: View, size: tuple[int, int]) -> None:
        pose, (fx, fy, cx, cy), (near, far) = view.T_world_camera, view.intrinsics, self._clip_m
        left, right = -cx / fx * near, (size[0] - cx) / fx * near
        for eye in self._eyes:
            eye.pos[:], eye.forward[:], eye.up[:] = pose[:3, 3], pose[:3, 2], -pose[:3, 1]
            eye.frustum_center, eye.frustum_width = 0.5 * (left + right), 0.5 * (right - left)
            # OpenGL's y points up.
            eye.frustum_bottom, eye.frustum_top = -(size[1] - cy) / fy * near, cy / fy * near
            eye.frustum_near, eye.frustum_far = near, far
            eye.orthographic = 0

    def update_sky(self) -> None:
        """Keep OpenGL's sky texture, which is drawn without lighting, as bright as the model's sky material.

        The OpenGL context must be current.
        """
        model, texture = self._model, self._sky
        if texture < 0 or (brightness := float(model.mat_emission[self._sky_material])) == self._sky_brightness:
            return
        start = int(model.tex_adr[texture])
        size = int(model.tex_width[texture]) * int(model.tex_height[texture]) * int(model.tex_nchannel[texture])
        texels = model.tex_data[start : start + size]
        original = texels.copy()
        levels = np.clip(np.round(np.arange(256) * brightness), 0.0, 255.0).astype(np.uint8)
        texels[:] = cv2.LUT(original, levels).reshape(-1)
        self._resources.upload_texture(model, texture)
        texels[:] = original
        self._sky_brightness = brightness


def shadow_map(model: mujoco.MjModel, direction: FloatArray, T_world_camera: FloatArray) -> ShadowMap:
    """Where a distant light casts shadows: on the ground before the camera, in whole pixels of the map.

    `direction` is the `(3,)` unit vector in which the light travels, `T_world_camera` the `(4, 4)` camera pose. The
    size is that of the model's `vis.map.shadowclip`: edges of shadows would swim if it changed, or if the map moved by
    fractions of its pixels.
    """
    half_width_m = float(model.vis.map.shadowclip) * float(model.stat.extent)
    pixel_m = 2.0 * half_width_m / max(int(model.vis.quality.shadowsize), 1)
    x, y, z = direction.tolist()
    level = max(math.hypot(y, z), 1e-9)
    # MuJoCo's axes of the map: up is across the world's x axis.
    right, up = np.array([level * level, -x * y, -x * z]) / level, np.array([0.0, -z, y]) / level
    ahead_x, ahead_y, _ = T_world_camera[:3, 2].tolist()
    reach_m = _AHEAD * half_width_m / max(math.hypot(ahead_x, ahead_y), 1e-9)
    middle = T_world_camera[:3, 3] * (1.0, 1.0, 0.0) + (reach_m * ahead_x, reach_m * ahead_y, 0.0)
    across, along = (pixel_m * round(float(middle @ axis) / pixel_m) for axis in (right, up))
    centre = across * right + along * up + float(middle @ direction) * direction
    return ShadowMap(direction, right, up, centre, half_width_m)


def _geoms_only(group: int) -> mujoco.MjvOption:
    """Options that draw geoms of a group, and no sites, joints or other decoration."""
    options = mujoco.MjvOption()
    for kind in ("geom", "site", "joint", "tendon", "actuator", "flex", "skin"):
        getattr(options, f"{kind}group")[:] = 0
    options.geomgroup[group] = 1
    return options
