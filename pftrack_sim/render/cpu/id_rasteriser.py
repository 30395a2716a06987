"""A renderer of segmentations alone, on the processor and without any OpenGL library."""

from __future__ import annotations

from typing import NoReturn

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.camera.pinhole import camera_matrix, focal_and_centre
from pftrack_sim.core.errors import RenderError
from pftrack_sim.core.types import BoolArray
from pftrack_sim.render.backend import PixelRect, Renderer, Segmentation, checked_poses
from pftrack_sim.render.cpu.kernels import Projected, begin, draw, scratch
from pftrack_sim.render.cpu.triangles import Triangles, model_triangles


class IdRasteriser(Renderer):
    """Draws the ids and depths of a model's geoms, no colours; see `pftrack_sim.render.backend.Renderer`.

    A pixel shows the triangle at its centre, as in OpenGL, from which it differs by the rounding of edges only. The
    inverse depth is 1 / depth [1/m]. It costs by the triangles and pixels of the geoms asked for, not by the image.
    """

    description = "ids and depths on the processor, no colours"
    draws_color = False

    def __init__(self, model: mujoco.MjModel, width_px: int, height_px: int) -> None:
        super().__init__(width_px, height_px)
        self.rebind(model)

    def rebind(self, model: mujoco.MjModel, *, exclusive: bool = False) -> None:
        """See `Renderer.rebind`."""
        self._read_model(model)
        triangles = model_triangles(model, self.visible_geoms)
        self._shapes: tuple[Triangles, Projected] | None = triangles, scratch(triangles)

    def unbind(self) -> None:
        """See `Renderer.unbind`."""
        self._shapes = None

    close = unbind

    @property
    def shapes(self) -> tuple[Triangles, Projected]:
        """Triangles of the model, and arrays for one view of them; raises `RenderError` without a model."""
        if self._shapes is None:
            raise RenderError("this renderer has no model: rebind it")
        return self._shapes

    def color(
        self, data: mujoco.MjData, T_world_camera: ArrayLike, K: ArrayLike | float, *, rows: slice | None = None
    ) -> NoReturn:
        """Raise `RenderError`: there are no colours."""
        raise RenderError("this renderer draws no colours: it was opened for the truth without images")

    def ids(
        self,
        data: mujoco.MjData,
        T_world_camera: ArrayLike,
        K: ArrayLike | float,
        *,
        geoms: BoolArray | None = None,
        rect: PixelRect | None = None,
    ) -> Segmentation:
        """Find the geom at each pixel; see `Renderer.ids`."""
        triangles, projected = self.shapes
        geoms, rect = self._geoms_and_rect(geoms, rect)
        ids = np.full((rect.height, rect.width), -1, dtype=np.int32)
        inverse_depth = np.zeros((rect.height, rect.width), dtype=np.float32)
        fx, fy, cx, cy = focal_and_centre(camera_matrix(K, self.width_px, self.height_px))
        pose, positions, rotations = checked_poses(T_world_camera), data.geom_xpos, data.geom_xmat.reshape(-1, 3, 3)
        begin(projected, positions, pose)
        draw(
            np.flatnonzero(geoms), projected, triangles, positions, rotations, pose,
            (fx, fy, cx - rect.left, cy - rect.top), (self.near_m, np.inf, -np.inf), ids, inverse_depth,
        )  # fmt: skip
        return Segmentation(rect, ids, inverse_depth)
