"""Batched ray casting: n worlds with different models, cameras, people and lights drawn in one call."""

# Warp is only partly typed.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.render.backend import PixelRect, clip_depths_m, geoms_drawn
from pftrack_sim.render.warp import kernels
from pftrack_sim.render.warp.assets import Assets, SharedAssets
from pftrack_sim.render.warp.raycaster import cast_color, cast_ids, make_cameras
from pftrack_sim.render.warp.scene import SceneArrays


@dataclass(frozen=True, eq=False)
class Batch:
    """Images and visible boxes of n worlds with up to P people.

    Attributes:
        images: `(n, H, W, 3)` uint8 RGB.
        ids: `(n, H, W)` int32 geom ids in each world's model, -1 where there is none.
        visible_boxes: `(n, P, 4)` boxes of each person's visible pixels [px]; NaN where there are none.
        visible_pixels: `(n, P)` number of visible pixels.
    """

    images: NDArray[np.uint8]
    ids: NDArray[np.int32]
    visible_boxes: FloatArray
    visible_pixels: NDArray[np.int32]


class ManyWorlds:
    """Draws n worlds at once. Their models may differ in places, people, clothes and lights.

    Args:
        models: One per world.
        person_of_geom: For each model, the `(ngeom,)` index of the person a geom belongs to, -1 for other geoms.
        width_px: Image width.
        height_px: Image height.

    Raises:
        ParameterError: No worlds, an empty image, or indices that do not fit the models.
    """

    def __init__(
        self,
        models: Sequence[mujoco.MjModel],
        person_of_geom: Sequence[NDArray[np.integer]],
        width_px: int,
        height_px: int,
    ) -> None:
        if not models or width_px < 1 or height_px < 1:
            raise ParameterError(f"worlds and pixels are needed, got {len(models)} worlds of {width_px} x {height_px}")
        if [len(own) for own in person_of_geom] != [model.ngeom for model in models]:
            raise ParameterError("person_of_geom must name a person or -1 for each geom of each model")
        self._size = int(width_px), int(height_px)
        self._clip_depths_m = [clip_depths_m(model) for model in models]
        shared = SharedAssets()
        assets = [Assets(model, shared) for model in models]
        self._arrays = SceneArrays(models, [geoms_drawn(model) for model in models], assets)
        person = np.concatenate(person_of_geom).astype(np.int32)
        self._people = int(person.max(initial=-1)) + 1
        self._person_of_geom = wp.array(person, dtype=int)

    def draw(self, datas: Sequence[mujoco.MjData], T_world_camera: ArrayLike, K: Sequence[ArrayLike]) -> Batch:
        """Draw images and ids, and find the visible boxes on the device.

        Args:
            datas: Up-to-date poses of each world.
            T_world_camera: `(n, 4, 4)` camera poses (x right, y down, z forward).
            K: n `(3, 3)` camera matrices [px].

        Raises:
            ParameterError: Not one of each per world, or an invalid pose or camera matrix.
        """
        arrays, size = self._arrays, self._size
        poses = np.asarray(T_world_camera, dtype=np.float64)
        if not len(datas) == len(poses) == len(K) == arrays.worlds:
            raise ParameterError(
                f"{arrays.worlds} worlds, got {len(datas)} data, {len(poses)} poses, {len(K)} matrices"
            )
        cameras = make_cameras(poses, K, size, self._clip_depths_m)
        arrays.update_lights()
        arrays.update_poses(datas)
        images = cast_color(arrays, cameras, size, samples=1)
        ids_on_device, _ = cast_ids(arrays, arrays.visible, cameras, [PixelRect(0, 0, *size)] * arrays.worlds)
        empty = np.array([*size, -1, -1, 0], dtype=np.int32)
        extents_on_device = wp.array(np.tile(empty, (arrays.worlds, max(self._people, 1), 1)), dtype=int)
        wp.launch(
            kernels.person_extents,
            dim=ids_on_device.shape,
            inputs=[ids_on_device, self._person_of_geom, size[0]],
            outputs=[extents_on_device],
        )
        extents = np.array(extents_on_device.numpy(), dtype=np.int32)[:, : self._people]
        corners = extents[..., :4].astype(np.float64)
        visible_boxes = np.concatenate([corners[..., :2], corners[..., 2:] - corners[..., :2] + 1.0], axis=-1)
        visible_boxes[extents[..., 4] == 0] = boxes.NO_BOX
        ids = np.array(ids_on_device.numpy(), dtype=np.int32)
        ids = np.where(ids >= 0, ids - arrays.geom_start[:, None], -1).astype(np.int32)
        return Batch(images, ids.reshape(images.shape[:3]), visible_boxes, extents[..., 4])
