"""The ray caster behind the one interface of `render`: pictures and ids of one model from any camera pose."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.camera.pinhole import camera_matrix, focal_and_centre
from pftrack_sim.core.errors import ParameterError, RenderError
from pftrack_sim.core.records import Image
from pftrack_sim.render.backend import PixelRect, Segmentation, geoms_drawn
from pftrack_sim.render.warp import kernels, rays
from pftrack_sim.render.warp.scene import SceneTable


class Raycaster:
    """Draws one model with MuJoCo Warp; see `pftrack_sim.render.backend.Renderer`.

    The same geoms as OpenGL draws, on the same pixel grid, shaded pixel by pixel. The model's multisampling becomes
    n x n rays per pixel of the picture, n the smallest number with n x n >= the samples asked for.

    Args:
        model: What to draw. Its `vis` settings hold for multisampling and the near and far plane.
        width_px: Image width.
        height_px: Image height.

    Raises:
        ParameterError: An empty image.
        RenderError: A geom that cannot be drawn: a height field or a signed distance field.
    """

    def __init__(self, model: mujoco.MjModel, width_px: int, height_px: int) -> None:
        if width_px < 1 or height_px < 1:
            raise ParameterError(f"an image needs a width and height >= 1, got {width_px} x {height_px}")
        self._width, self._height = int(width_px), int(height_px)
        self._table: SceneTable | None = None
        self.rebind(model)

    @property
    def model(self) -> mujoco.MjModel:
        """What is drawn."""
        return self._model

    @property
    def width_px(self) -> int:
        """Image width."""
        return self._width

    @property
    def height_px(self) -> int:
        """Image height."""
        return self._height

    @property
    def near_m(self) -> float:
        """Depth below which nothing is drawn."""
        return self._near_m

    @property
    def far_m(self) -> float:
        """Depth beyond which nothing is drawn."""
        return self._far_m

    @property
    def visible_geoms(self) -> NDArray[np.bool_]:
        """`(ngeom,)` which geoms are drawn at all: those of groups 0, 1 and 2 that are not wholly transparent."""
        return self._visible.copy()

    @property
    def description(self) -> str:
        """What draws, in one line."""
        return f"warp: MuJoCo Warp's ray caster on {wp.get_device().name}, Warp {wp.config.version}"

    def rebind(self, model: mujoco.MjModel) -> None:
        """Draw another model from now on.

        Which geoms are drawn at all, and the near and far plane, are read now; poses and lights when drawing.
        """
        self._table = None
        self._model = model
        extent = float(model.stat.extent)
        self._near_m, self._far_m = float(model.vis.map.znear) * extent, float(model.vis.map.zfar) * extent
        self._visible = geoms_drawn(model)
        self._samples = math.isqrt(max(int(model.vis.quality.offsamples), 1) - 1) + 1
        self._table = SceneTable([model], [self._visible])

    def color(
        self, data: mujoco.MjData, T_world_camera: ArrayLike, K: ArrayLike | float, *, rows: slice | None = None
    ) -> Image:
        """Draw a picture.

        Args:
            data: Positions, up to date (`mj_forward` or `mj_kinematics` and `mj_camlight`).
            T_world_camera: `(4, 4)` camera pose, OpenCV axes.
            K: `(3, 3)` camera matrix [px], or a vertical field of view [rad].
            rows: The rows wanted, by start and stop; None is the whole image.

        Returns:
            A new `(H, W, 3)` uint8 RGB image, or its rows.

        Raises:
            ParameterError: A pose or camera matrix that is none.
            RenderError: Closed.
        """
        table = self._open()
        cameras = cameras_of([T_world_camera], [K], (self._width, self._height), self._near_m, self._far_m)
        table.relight()
        table.place([data])
        tree, kept = table.tree(table.visible)
        casters, kept_casters = table.tree(table.casters)
        image = wp.zeros((1, self._width * self._height, 3), dtype=wp.uint8)
        wp.launch(
            kernels.cast_colour,
            dim=(1, self._width * self._height),
            inputs=[
                table.geoms,
                table.looks,
                table.textures,
                tree,
                casters,
                cameras,
                True,
                self._width,
                self._samples,
            ],
            outputs=[image],
        )
        del kept, kept_casters
        whole = np.array(image.numpy(), dtype=np.uint8).reshape(self._height, self._width, 3)
        return whole if rows is None else whole[rows]

    def ids(
        self,
        data: mujoco.MjData,
        T_world_camera: ArrayLike,
        K: ArrayLike | float,
        *,
        geoms: NDArray[np.bool_] | None = None,
        rect: PixelRect | None = None,
    ) -> Segmentation:
        """Which geom each pixel shows; only the rectangle wanted is cast, and only the geoms shown are searched.

        Args:
            data: Positions, up to date.
            T_world_camera: `(4, 4)` camera pose, OpenCV axes.
            K: `(3, 3)` camera matrix of the whole image [px], or a vertical field of view [rad].
            geoms: `(ngeom,)` the geoms to draw; None draws all that are drawn at all.
            rect: The rectangle wanted; None is the whole image.

        Raises:
            ParameterError: A pose, camera matrix, mask or rectangle that is none.
            RenderError: Closed.
        """
        table = self._open()
        rect = PixelRect(0, 0, self._width, self._height) if rect is None else rect
        if not (
            rect.width > 0
            and rect.height > 0
            and 0 <= rect.left <= self._width - rect.width
            and 0 <= rect.top <= self._height - rect.height
        ):
            raise ParameterError(f"the rectangle must lie in the {self._width} x {self._height} image, got {rect}")
        cameras = cameras_of([T_world_camera], [K], (self._width, self._height), self._near_m, self._far_m)
        table.place([data])
        wanted = self._visible if geoms is None else self._visible & geoms
        tree, kept = table.tree(wanted)
        ids = wp.full((1, rect.width * rect.height), -1, dtype=int)
        nearness = wp.zeros((1, rect.width * rect.height), dtype=float)
        if kept is not None:
            wp.launch(
                kernels.cast_ids,
                dim=(1, rect.width * rect.height),
                inputs=[table.geoms, table.looks, tree, cameras, rect.left, rect.top, rect.width],
                outputs=[ids, nearness],
            )
        shape = rect.height, rect.width
        return Segmentation(
            rect,
            np.array(ids.numpy(), dtype=np.int32).reshape(shape),
            np.array(nearness.numpy(), dtype=np.float32).reshape(shape),
        )

    def close(self) -> None:
        """Free everything; a second call does nothing."""
        self._table = None

    def __enter__(self) -> Raycaster:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _open(self) -> SceneTable:
        if self._table is None:
            raise RenderError("this renderer has been closed")
        return self._table


def cameras_of(poses: Any, matrices: Any, size: tuple[int, int], near_m: float, far_m: float) -> Any:
    """Cameras as kernels take them.

    Raises:
        ParameterError: A pose or camera matrix that is none.
    """
    turns = np.asarray(poses, dtype=np.float64)
    if turns.ndim != 3 or turns.shape[1:] != (4, 4) or not np.isfinite(turns).all():
        raise ParameterError(f"T_world_camera must be a finite (4, 4) matrix, got {turns.tolist()}")
    cameras = rays.Cameras()
    cameras.eye = wp.array(turns[:, :3, 3].astype(np.float32), dtype=wp.vec3)
    cameras.turn = wp.array(turns[:, :3, :3].astype(np.float32), dtype=wp.mat33)
    lenses = np.array([focal_and_centre(camera_matrix(K, *size)) for K in matrices], dtype=np.float32)
    cameras.focal_centre = wp.array(lenses, dtype=wp.vec4)
    cameras.near, cameras.far = near_m, far_m
    return cameras
