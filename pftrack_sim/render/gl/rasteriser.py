"""MuJoCo's classic OpenGL renderer with any camera pose and matrix: color images and segmentations.

Unlike `mujoco.Renderer`, it takes the camera as an argument instead of from the model, needs no environment variable,
decodes ids by one table look-up, and keeps its OpenGL context when the model changes.
"""

from __future__ import annotations

import weakref
from contextlib import AbstractContextManager

import cv2
import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.camera.pinhole import Intrinsics, camera_matrix, focal_and_centre
from pftrack_sim.core.errors import RenderError
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.render.backend import PixelRect, Renderer, Segmentation, checked_poses
from pftrack_sim.render.gl.context import GLContext, open_context
from pftrack_sim.render.gl.resources import Resources
from pftrack_sim.render.gl.scene import ModelScene

_CODE_BITS = np.uint32(0xFFFFFF)


class Rasteriser(Renderer):
    """Draws one model off-screen with OpenGL; see `pftrack_sim.render.backend.Renderer`.

    Any thread may use it, one at a time. Several can exist in one process; those of one model draw one at a time, too,
    since geoms are hidden in the model while it is drawn.

    Args:
        model: What to draw. Its `vis` settings hold for multisampling, shadow size, near and far plane; its
            off-screen size is ignored.
        width_px: Image width.
        height_px: Image height.
        context: The OpenGL context, closed with the renderer; None opens one with `open_context`.

    Raises:
        ParameterError: An empty image.
        RenderError: No OpenGL library can draw.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        width_px: int,
        height_px: int,
        context: GLContext | None = None,
    ) -> None:
        super().__init__(width_px, height_px)
        self._context = context or open_context(size=(self.width_px, self.height_px))
        self.info = self._context.info
        self.description = f"{self.info.backend}: {self.info.renderer}, {self.info.vendor}, OpenGL {self.info.version}"
        self._scene: ModelScene | None = None
        self._resources: list[Resources] = []
        """One of the last model bound; none before."""
        self._finalizer = weakref.finalize(self, _free, self._context, self._resources)
        self._area = mujoco.MjrRect(0, 0, self.width_px, self.height_px)
        self._pixels = np.empty((self.height_px, self.width_px, 4), dtype=np.uint8)
        self.rebind(model)

    def drawing(self) -> AbstractContextManager[None]:
        """See `Renderer.drawing`; the OpenGL context is current in the block."""
        return self._context.current()

    def rebind(self, model: mujoco.MjModel) -> None:
        """Draw another model from now on. It takes over the textures and meshes of the last one that equal its own."""
        self.unbind()
        with self._context.current():
            if not self._resources or not self._resources[0].replace(model):
                if self._resources:
                    self._resources.pop().free()
                self._resources.append(Resources(model, (self.width_px, self.height_px)))
        self._read_model(model)
        self._scene = ModelScene(model, self.visible_geoms, (self.near_m, self.far_m))

    def unbind(self) -> None:
        """See `Renderer.unbind`. Textures and meshes stay in OpenGL's memory until the next `rebind`."""
        self._scene = None

    def color(
        self, data: mujoco.MjData, T_world_camera: ArrayLike, K: ArrayLike | float, *, rows: slice | None = None
    ) -> Image:
        """Draw a new `(H, W, 3)` uint8 RGB image, or only its `rows` (start and stop).

        Edges of an image of rows may differ from those of the whole image by the rounding of subpixels.
        """
        scene, height = self._bound_scene(), self.height_px
        fx, fy, cx, cy = self._intrinsics(K)
        if rows is not None:
            cy -= rows.start
            height = rows.stop - rows.start
        pixels = self._pixels[:height]
        area = self._area if rows is None else mujoco.MjrRect(0, 0, self.width_px, height)
        drawn = scene.color_scene(data, checked_poses(T_world_camera), (fx, fy, cx, cy), (self.width_px, height))
        with self._context.current():
            scene.sky.update(self._resources[0])
            mujoco.mjr_render(area, drawn, self._resources[0].context)
            mujoco.mjr_readPixels(pixels, None, area, self._resources[0].context)
        # OpenGL counts rows from the bottom.
        image = cv2.cvtColor(pixels, cv2.COLOR_RGBA2RGB)
        return np.asarray(cv2.flip(image, 0, image), dtype=np.uint8)

    def _ids(
        self, data: mujoco.MjData, pose: FloatArray, K: ArrayLike | float, geoms: BoolArray, rect: PixelRect
    ) -> Segmentation:
        """See `Renderer`.

        The whole image is drawn whatever the rectangle: clipped to a smaller view, triangles would be rounded to other
        subpixels, and the rectangle would differ from the same pixels of the whole image.
        """
        scene, size = self._bound_scene(), (self.width_px, self.height_px)
        drawn, geom_of_code = scene.ids_scene(data, pose, self._intrinsics(K), size, geoms)
        pixels = self._pixels.reshape(-1)[: 4 * rect.width * rect.height].reshape(rect.height, rect.width, 4)
        inverse_depth = np.empty((rect.height, rect.width), dtype=np.float32)
        area = mujoco.MjrRect(rect.left, self.height_px - rect.top - rect.height, rect.width, rect.height)
        with self._context.current():
            mujoco.mjr_render(self._area, drawn, self._resources[0].context)
            mujoco.mjr_readPixels(pixels, inverse_depth, area, self._resources[0].context)
        codes = pixels.view("<u4")[:, :, 0] & _CODE_BITS
        return Segmentation(rect, geom_of_code.take(codes)[::-1], inverse_depth[::-1])

    def _reciprocal_depth(self, found: Segmentation) -> NDArray[np.float32]:
        # The buffer runs from 1 at the near plane to 0 at the far one, linear in 1 / depth.
        return 1.0 / self.far_m + found.inverse_depth * (1.0 / self.near_m - 1.0 / self.far_m)

    def close(self) -> None:
        """See `Renderer.close`."""
        self._scene = None
        self._finalizer()

    def _bound_scene(self) -> ModelScene:
        if self._scene is None:
            closed = self._context.closed
            raise RenderError("this renderer has been closed" if closed else "this renderer has no model: rebind it")
        return self._scene

    def _intrinsics(self, K: ArrayLike | float) -> Intrinsics:
        return focal_and_centre(K if np.ndim(K) else camera_matrix(K, self.width_px, self.height_px))


def _free(context: GLContext, resources: list[Resources]) -> None:
    """Free on `close`, garbage collection or the interpreter's exit."""
    if context.usable:
        with context.current():
            while resources:
                resources.pop().free()
    context.close()
