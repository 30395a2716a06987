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
from numpy.typing import ArrayLike, NDArray

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

    def rebind(self, model: mujoco.MjModel, *, exclusive: bool = False) -> None:
        """Draw another model from now on."""
        self.unbind()
        self._read_model(model)
        self._samples = samples_across(model)
        self._arrays = SceneArrays([model], [self.visible_geoms])

    def unbind(self) -> None:
        """Release the model and its arrays on the device, until the next `rebind`."""
        self._arrays: SceneArrays | None = None

    def color(
        self, data: mujoco.MjData, T_world_camera: ArrayLike, K: ArrayLike | float, *, rows: slice | None = None
    ) -> Image:
        """Draw a new `(H, W, 3)` uint8 RGB image, or only its `rows` (start and stop)."""
        arrays, size = self._bound_arrays(), (self.width_px, self.height_px)
        cameras = make_cameras([T_world_camera], [K], size, [(self.near_m, self.far_m)])
        arrays.update_lights()
        arrays.update_poses([data])
        image = cast_color(arrays, cameras, size, self._samples)[0]
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
        cameras = make_cameras([T_world_camera], [K], (self.width_px, self.height_px), [(self.near_m, self.far_m)])
        arrays.update_poses([data])
        ids, inverse_depth = cast_ids(arrays, geoms, cameras, [rect])
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


def samples_across(model: mujoco.MjModel) -> int:
    """Rays across and down each pixel of a colour image: the fewest that are no fewer than the model's samples."""
    return math.isqrt(max(int(model.vis.quality.offsamples), 1) - 1) + 1


def make_cameras(
    T_world_camera: Any, K: Sequence[ArrayLike | float], size: tuple[int, int], clip_depths_m: ArrayLike
) -> Any:
    """Cameras of n worlds.

    Args:
        T_world_camera: `(n, 4, 4)` poses.
        K: n camera matrices [px] or vertical fields of view [rad].
        size: Width and height of all images [px].
        clip_depths_m: `(n, 2)` depths of the near and the far plane.
    """
    poses = checked_poses(T_world_camera)
    cameras = rays.Cameras()
    cameras.eye = wp.array(poses[:, :3, 3].astype(np.float32), dtype=wp.vec3)
    cameras.rotation = wp.array(poses[:, :3, :3].astype(np.float32), dtype=wp.mat33)
    lenses = np.array([focal_and_centre(camera_matrix(one, *size)) for one in K], dtype=np.float32)
    cameras.focal_centre = wp.array(lenses, dtype=wp.vec4)
    planes = np.asarray(clip_depths_m, dtype=np.float32)
    cameras.near = wp.array(np.ascontiguousarray(planes[:, 0]), dtype=float)
    cameras.far = wp.array(np.ascontiguousarray(planes[:, 1]), dtype=float)
    return cameras


def cast_color(
    arrays: SceneArrays, cameras: Any, size: tuple[int, int], samples: int, worlds: Sequence[int] | None = None
) -> Image:
    """Colour images of some worlds, None for all.

    Args:
        arrays: All worlds.
        cameras: Those of all worlds.
        size: Width and height [px].
        samples: Rays across and down each pixel.
        worlds: m worlds.

    Returns:
        `(m, H, W, 3)` uint8 RGB.
    """
    (width, height), drawn = size, _numbers(arrays, worlds)
    image = wp.zeros((len(drawn), width * height, 3), dtype=wp.uint8)
    among = True if worlds is None else np.isin(arrays.world_of_geom, drawn)
    visible, _visible_owner = arrays.bvh(arrays.visible & among)
    casters, _casters_owner = arrays.bvh(arrays.shadow_casters & among)
    chosen = wp.array(drawn, dtype=int)
    inputs = [arrays.geoms, arrays.appearance, arrays.textures, visible, casters, cameras, chosen, width, samples]
    wp.launch(kernels.cast_color, dim=(len(drawn), width * height), inputs=inputs, outputs=[image])
    return np.array(image.numpy(), dtype=np.uint8).reshape(len(drawn), height, width, 3)


def cast_ids(
    arrays: SceneArrays,
    geoms: BoolArray,
    cameras: Any,
    rects: Sequence[PixelRect],
    worlds: Sequence[int] | None = None,
) -> tuple[Any, Any]:
    """Geoms at the pixels of a rectangle in each of some worlds, None for all.

    Args:
        arrays: All worlds.
        geoms: Which geoms of all worlds are cast at.
        cameras: Those of all worlds.
        rects: m rectangles.
        worlds: m worlds.

    Returns:
        `(m, pixels)` geoms, which are entries of `arrays`, -1 for none, and inverse depths, on the device; row by row,
        and -1 and 0 behind the last pixel of smaller rectangles.
    """
    drawn = _numbers(arrays, worlds)
    shape = len(drawn), max(rect.width * rect.height for rect in rects)
    ids, inverse_depth = wp.full(shape, -1, dtype=int), wp.zeros(shape, dtype=float)
    bvh, _owner = arrays.bvh(geoms)
    if bvh.count:
        areas = wp.array(np.array(rects, dtype=np.int32), dtype=wp.vec4i)
        inputs = [arrays.geoms, arrays.appearance, bvh, cameras, wp.array(drawn, dtype=int), areas]
        wp.launch(kernels.cast_ids, dim=shape, inputs=inputs, outputs=[ids, inverse_depth])
        wp.synchronize_device()  # The hierarchy is freed on return: a GPU must have cast all rays.
    return ids, inverse_depth


def _numbers(arrays: SceneArrays, worlds: Sequence[int] | None) -> NDArray[np.int32]:
    return np.array(range(arrays.worlds) if worlds is None else worlds, dtype=np.int32)
