"""Color images and segmentations of one model by MuJoCo Warp's ray caster, from any camera pose."""

# Warp is only partly typed.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from pftrack_sim.camera.pinhole import camera_matrix, focal_and_centre
from pftrack_sim.core.errors import RenderError
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import BoolArray
from pftrack_sim.render.backend import PixelRect, Renderer, Segmentation, checked_poses
from pftrack_sim.render.warp import kernels, rays
from pftrack_sim.render.warp.scene import SceneArrays


class Raycaster(Renderer):
    """Draws one model with MuJoCo Warp; see `pftrack_sim.render.backend.Renderer`.

    It draws the same geoms as OpenGL on the same pixel grid, shaded per pixel. The model's multisampling becomes n x n
    rays per pixel of a color image, n the smallest number with n x n >= the number of samples.

    Args:
        model: What to draw. Its `vis` settings hold for multisampling and the near and far plane.
        width_px: Image width.
        height_px: Image height.

    Raises:
        ParameterError: An empty image.
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
        self._read_model(model)
        self._samples = math.isqrt(max(int(model.vis.quality.offsamples), 1) - 1) + 1
        self._arrays = SceneArrays([model], [self.visible_geoms])

    def unbind(self) -> None:
        """Release the model and its arrays on the device, until the next `rebind`."""
        self._arrays: SceneArrays | None = None

    def color(
        self, data: mujoco.MjData, T_world_camera: ArrayLike, K: ArrayLike | float, *, rows: slice | None = None
    ) -> Image:
        """Draw a new `(H, W, 3)` uint8 RGB image, or only its `rows` (start and stop)."""
        arrays, size = self._bound_arrays(), (self.width_px, self.height_px)
        cameras = make_cameras([T_world_camera], [K], size, self.near_m, self.far_m)
        arrays.update_lights()
        arrays.update_poses([data])
        visible, _owner = arrays.bvh(arrays.visible)
        image = cast_color(arrays, visible, cameras, size, self._samples)[0]
        return image if rows is None else image[rows]

    def ids(
        self,
        data: mujoco.MjData,
        T_world_camera: ArrayLike,
        K: ArrayLike | float,
        *,
        geoms: BoolArray | None = None,
        rect: PixelRect | None = None,
    ) -> Segmentation:
        """Find the geom at each pixel; see `Renderer.ids`. Only the rectangle is cast, and only at the given geoms."""
        arrays = self._bound_arrays()
        geoms, rect = self._geoms_and_rect(geoms, rect)
        cameras = make_cameras([T_world_camera], [K], (self.width_px, self.height_px), self.near_m, self.far_m)
        arrays.update_poses([data])
        bvh, _owner = arrays.bvh(geoms)
        ids, inverse_depth = cast_ids(arrays, bvh, cameras, rect)
        shape = rect.height, rect.width
        return Segmentation(
            rect,
            np.array(ids.numpy(), dtype=np.int32).reshape(shape),
            np.array(inverse_depth.numpy(), dtype=np.float32).reshape(shape),
        )

    def close(self) -> None:
        """Free everything; a second call does nothing."""
        self.unbind()
        self._closed = True

    def _bound_arrays(self) -> SceneArrays:
        if self._arrays is None:
            closed = self._closed
            raise RenderError("this renderer has been closed" if closed else "this renderer has no model: rebind it")
        return self._arrays


def make_cameras(
    T_world_camera: Any, K: Sequence[ArrayLike | float], size: tuple[int, int], near_m: float, far_m: float
) -> Any:
    """Cameras of n worlds: `(n, 4, 4)` poses, and n camera matrices [px] or vertical fields of view [rad]."""
    poses = checked_poses(T_world_camera)
    cameras = rays.Cameras()
    cameras.eye = wp.array(poses[:, :3, 3].astype(np.float32), dtype=wp.vec3)
    cameras.rotation = wp.array(poses[:, :3, :3].astype(np.float32), dtype=wp.mat33)
    lenses = np.array([focal_and_centre(camera_matrix(one, *size)) for one in K], dtype=np.float32)
    cameras.focal_centre = wp.array(lenses, dtype=wp.vec4)
    cameras.near, cameras.far = near_m, far_m
    return cameras


def cast_color(arrays: SceneArrays, visible: Any, cameras: Any, size: tuple[int, int], samples: int) -> Image:
    """`(n, H, W, 3)` uint8 RGB images of `size` width and height [px], with samples x samples rays per pixel."""
    width, height = size
    image = wp.zeros((arrays.worlds, width * height, 3), dtype=wp.uint8)
    casters, _owner = arrays.bvh(arrays.shadow_casters)
    inputs = [arrays.geoms, arrays.appearance, arrays.textures, visible, casters, cameras, width, samples]
    wp.launch(kernels.cast_color, dim=(arrays.worlds, width * height), inputs=inputs, outputs=[image])
    return np.array(image.numpy(), dtype=np.uint8).reshape(arrays.worlds, height, width, 3)


def cast_ids(arrays: SceneArrays, bvh: Any, cameras: Any, rect: PixelRect) -> tuple[Any, Any]:
    """`(n, h * w)` geoms (entries of `arrays`, -1 for none) and inverse depths of a rectangle's pixels."""
    shape = arrays.worlds, rect.width * rect.height
    ids, inverse_depth = wp.full(shape, -1, dtype=int), wp.zeros(shape, dtype=float)
    if bvh.count:
        inputs = [arrays.geoms, arrays.appearance, bvh, cameras, rect.left, rect.top, rect.width]
        wp.launch(kernels.cast_ids, dim=shape, inputs=inputs, outputs=[ids, inverse_depth])
    return ids, inverse_depth
