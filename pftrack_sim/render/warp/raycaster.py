"""Color images of one model by MuJoCo Warp's ray caster, from any camera pose."""

# Warp is only partly typed.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.core.errors import RenderError
from pftrack_sim.core.records import Image
from pftrack_sim.render.renderer import Renderer, checked_poses, clip_depths_m, geoms_drawn
from pftrack_sim.render.warp import kernels, rays
from pftrack_sim.render.warp.scene import SceneArrays


class Raycaster(Renderer):
    """Draws one model with MuJoCo Warp; see `pftrack_sim.render.renderer.Renderer`.

    It draws the same geoms as OpenGL on the same pixel grid, shaded per pixel. The model's multisampling becomes n x n
    rays per pixel of a color image, n the smallest number with n x n >= the number of samples.

    Args:
        model: What to draw. Its `vis` settings hold for multisampling and the near and far plane.

    Raises:
        RenderError: A geom that cannot be drawn: a height field or a signed distance field.
    """

    def __init__(self, model: mujoco.MjModel, width_px: int, height_px: int) -> None:
        super().__init__(width_px, height_px)
        self.description = f"warp: MuJoCo Warp's ray caster on {wp.get_device().name}, Warp {wp.config.version}"
        self._closed = False
        self.rebind(model)

    def rebind(self, model: mujoco.MjModel) -> None:
        """Draw another model from now on."""
        self.unbind()
        self._clip_m = clip_depths_m(model)
        # The fewest rays across and down a pixel that are no fewer than the samples.
        self._samples = math.isqrt(max(int(model.vis.quality.offsamples), 1) - 1) + 1
        self._arrays = SceneArrays(model, geoms_drawn(model))

    def unbind(self) -> None:
        """Release the model and its arrays on the device, until the next `rebind`."""
        self._arrays: SceneArrays | None = None

    def color(
        self, data: mujoco.MjData, T_world_camera: ArrayLike, K: ArrayLike, *, rows: slice | None = None
    ) -> Image:
        """Draw a new `(H, W, 3)` uint8 RGB image, or only its `rows` (start and stop)."""
        if self._arrays is None:
            closed = self._closed
            raise RenderError("this renderer has been closed" if closed else "this renderer has no model: rebind it")
        arrays, camera, width = self._arrays, self._camera(T_world_camera, K), self.width_px
        arrays.update_lights()
        arrays.update_poses(data)
        image = wp.zeros((width * self.height_px, 3), dtype=wp.uint8)
        visible, _visible_owner = arrays.bvh(arrays.visible)
        casters, _casters_owner = arrays.bvh(arrays.shadow_casters)
        inputs = [arrays.geoms, arrays.appearance, arrays.textures, visible, casters, camera, width, self._samples]
        wp.launch(kernels.cast_color, dim=width * self.height_px, inputs=inputs, outputs=[image])
        drawn = np.array(image.numpy(), dtype=np.uint8).reshape(self.height_px, width, 3)
        return drawn if rows is None else drawn[rows]

    def close(self) -> None:
        """Free everything; a second call does nothing."""
        self.unbind()
        self._closed = True

    def _camera(self, T_world_camera: ArrayLike, K: ArrayLike) -> Any:
        """A camera at a `(4, 4)` pose, with a camera matrix [px]."""
        pose = checked_poses(T_world_camera)
        camera = rays.Camera()
        camera.eye, camera.rotation = wp.vec3(*pose[:3, 3].tolist()), wp.mat33(*pose[:3, :3].ravel().tolist())
        camera.focal_centre = wp.vec4(*focal_and_centre(K))
        camera.near, camera.far = self._clip_m
        return camera
