"""Many worlds in one call: n models, each with its own camera, people, clothes and lights, drawn together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.render.backend import geoms_drawn
from pftrack_sim.render.warp import kernels
from pftrack_sim.render.warp.raycaster import cameras_of
from pftrack_sim.render.warp.scene import SceneTable


@dataclass(frozen=True, eq=False)
class Batch:
    """What n worlds look like.

    Attributes:
        images: `(n, H, W, 3)` uint8 RGB.
        ids: `(n, H, W)` int32 geom id in its own world's model, -1 where there is none.
        visible_boxes: `(n, P, 4)` boxes of each person's visible pixels [px]; NaN where there are none.
        visible_pixels: `(n, P)` how many.
    """

    images: NDArray[np.uint8]
    ids: NDArray[np.int32]
    visible_boxes: NDArray[np.float64]
    visible_pixels: NDArray[np.int32]


class ManyWorlds:
    """Draws n worlds at once. Their models may differ: places, people, clothes, lights.

    Args:
        models: One per world; the near and far plane are the first one's.
        person_of_geom: Of each, `(ngeom,)` index of the person a geom belongs to, -1 for everything else.
        width_px: Image width.
        height_px: Image height.

    Raises:
        ParameterError: No worlds, an empty image, or masks that do not fit the models.
    """

    def __init__(
        self,
        models: Sequence[mujoco.MjModel],
        person_of_geom: Sequence[NDArray[np.integer]],
        width_px: int,
        height_px: int,
    ) -> None:
        if not models or width_px < 1 or height_px < 1:
            raise ParameterError(f"many worlds need a world and pixels, got {len(models)} of {width_px} x {height_px}")
        if [len(own) for own in person_of_geom] != [model.ngeom for model in models]:
            raise ParameterError("person_of_geom must name a person or -1 for each geom of each model")
        self._size = int(width_px), int(height_px)
        extent = float(models[0].stat.extent)
        self._near_m = float(models[0].vis.map.znear) * extent
        self._far_m = float(models[0].vis.map.zfar) * extent
        self._table = SceneTable(models, [geoms_drawn(model) for model in models])
        owners = np.concatenate(person_of_geom).astype(np.int32)
        self._people = int(owners.max(initial=-1)) + 1
        self._owners = wp.array(owners, dtype=int)

    def draw(self, datas: Sequence[mujoco.MjData], T_world_camera: ArrayLike, K: Sequence[ArrayLike]) -> Batch:
        """Pictures, ids and visible boxes; the boxes are found on the device.

        Args:
            datas: Positions of each world, up to date.
            T_world_camera: `(n, 4, 4)` camera poses, OpenCV axes.
            K: n `(3, 3)` camera matrices [px].

        Raises:
            ParameterError: Not one of each per world, or a pose or camera matrix that is none.
        """
        table, (width, height) = self._table, self._size
        poses = np.asarray(T_world_camera, dtype=np.float64)
        if not len(datas) == len(poses) == len(K) == table.worlds:
            raise ParameterError(f"{table.worlds} worlds, got {len(datas)} data, {len(poses)} poses, {len(K)} matrices")
        cameras = cameras_of(poses, K, self._size, self._near_m, self._far_m)
        table.relight()
        table.place(datas)
        tree, kept = table.tree(table.visible)
        casters, kept_casters = table.tree(table.casters)
        shape = table.worlds, width * height
        image = wp.zeros((*shape, 3), dtype=wp.uint8)
        ids = wp.full(shape, -1, dtype=int)
        nearness = wp.zeros(shape, dtype=float)
        empty = np.tile(np.array([width, height, -1, -1, 0], dtype=np.int32), (table.worlds, max(self._people, 1), 1))
        found = wp.array(empty, dtype=int)
        scene = [table.geoms, table.looks]
        wp.launch(
            kernels.cast_colour,
            dim=shape,
            inputs=[*scene, table.textures, tree, casters, cameras, True, width, 1],
            outputs=[image],
        )
        wp.launch(kernels.cast_ids, dim=shape, inputs=[*scene, tree, cameras, 0, 0, width], outputs=[ids, nearness])
        wp.launch(kernels.boxes_of, dim=shape, inputs=[ids, self._owners, width], outputs=[found])
        del kept, kept_casters
        extents = np.array(found.numpy(), dtype=np.int32)[:, : self._people]
        corners = extents[..., :4].astype(np.float64)
        visible = np.concatenate([corners[..., :2], corners[..., 2:] - corners[..., :2] + 1.0], axis=-1)
        visible[extents[..., 4] == 0] = boxes.NO_BOX
        codes = np.array(ids.numpy(), dtype=np.int32)
        codes = np.where(codes >= 0, codes - table.geom_start[:, None], -1).astype(np.int32)
        return Batch(
            np.array(image.numpy(), dtype=np.uint8).reshape(table.worlds, height, width, 3),
            codes.reshape(table.worlds, height, width),
            visible,
            extents[..., 4],
        )
