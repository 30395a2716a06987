"""A pool of worlds that are drawn together, each through a renderer of its own.

Worlds come and go at different times. They are kept in groups: a world with a new model rebuilds the arrays of its
group alone.
"""

# Warp is only partly typed.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, TypeVar

import mujoco
import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import RenderError
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import BoolArray
from pftrack_sim.render.backend import PixelRect, Renderer, Segmentation
from pftrack_sim.render.warp.assets import Assets, SharedAssets
from pftrack_sim.render.warp.raycaster import cast_color, cast_ids, make_cameras, samples_across
from pftrack_sim.render.warp.rendezvous import Rendezvous
from pftrack_sim.render.warp.scene import Poses, SceneArrays

GROUP_SIZE = 32
"""Worlds of a group: enough rays of small images to occupy a GPU, few enough models to copy at a reset."""

Result = TypeVar("Result")
_Reply: TypeAlias = "Image | Segmentation"


class WorldPool:
    """Draws many worlds in few calls; colours, ids and depths are those of `Raycaster`.

    `renderer` gives the renderer of one world. Within `run`, all worlds that wait for a drawing are drawn together;
    elsewhere each drawing is made at once.
    """

    def __init__(self) -> None:
        self._rendezvous = Rendezvous[_Request, _Reply](_draw)
        self._shared = SharedAssets()
        self._groups: list[_Group] = []

    def renderer(self, model: mujoco.MjModel, width_px: int, height_px: int) -> PooledRaycaster:
        """A renderer of one world; `unbind` and `close` take its model out of the pool."""
        return PooledRaycaster(self, model, width_px, height_px)

    def run(self, tasks: Sequence[Callable[[], Result]]) -> list[Result]:
        """Run tasks that draw worlds of the pool, in turns in this thread, and return their results.

        Where all that are not finished wait for a drawing, these are made together. An error of one ends all.
        """
        return self._rendezvous.run(tasks)

    def enter(self, model: mujoco.MjModel, visible: BoolArray, clip_depths_m: tuple[float, float]) -> _World:
        """Keep a model in the first group that has room."""
        group = next((group for group in self._groups if len(group.worlds) < GROUP_SIZE), None)
        if group is None:
            group = _Group()
            self._groups.append(group)
        world = _World(group, model, visible, clip_depths_m, Assets(model, self._shared))
        group.change([*group.worlds, world])
        return world

    def leave(self, world: _World) -> None:
        """Release a model and what no other world shares with it."""
        group = world.group
        group.change([other for other in group.worlds if other is not world])
        if not group.worlds:
            self._groups.remove(group)

    def ask(self, request: _Request) -> Any:
        """The colour image or the segmentation that a world asks for."""
        return self._rendezvous.ask(request)


class PooledRaycaster(Renderer):
    """Draws one world of a pool; see `pftrack_sim.render.backend.Renderer`, and `Raycaster` for the pixels.

    Args:
        pool: The pool.
        model: What to draw.
        width_px: Image width.
        height_px: Image height.

    Raises:
        ParameterError: An empty image.
    """

    def __init__(self, pool: WorldPool, model: mujoco.MjModel, width_px: int, height_px: int) -> None:
        super().__init__(width_px, height_px)
        self.description = f"warp: many worlds together on {wp.get_device().name}, Warp {wp.config.version}"
        self._pool = pool
        self._world: _World | None = None
        self._closed = False
        self.rebind(model)

    def rebind(self, model: mujoco.MjModel, *, exclusive: bool = False) -> None:
        """Draw another model from now on."""
        self.unbind()
        self._read_model(model)
        self._world = self._pool.enter(model, self.visible_geoms, (self.near_m, self.far_m))

    def unbind(self) -> None:
        """Release the model and its arrays on the device, until the next `rebind`."""
        if self._world is not None:
            self._pool.leave(self._world)
        self._world = None

    def color(
        self, data: mujoco.MjData, T_world_camera: ArrayLike, K: ArrayLike | float, *, rows: slice | None = None
    ) -> Image:
        """Draw a new `(H, W, 3)` uint8 RGB image, or only its `rows` (start and stop)."""
        size = self.width_px, self.height_px
        image = self._pool.ask(_Request(self._bound(), data, T_world_camera, K, size))
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
        """Find the geom at each pixel; see `Renderer.ids`."""
        world, size = self._bound(), (self.width_px, self.height_px)
        geoms, rect = self._geoms_and_rect(geoms, rect)
        return self._pool.ask(_Request(world, data, T_world_camera, K, size, rect, geoms))

    def close(self) -> None:
        """Free everything; a second call does nothing."""
        self.unbind()
        self._closed = True

    def _bound(self) -> _World:
        if self._world is None:
            closed = self._closed
            raise RenderError("this renderer has been closed" if closed else "this renderer has no model: rebind it")
        return self._world


class _World:
    """A model in the pool."""

    def __init__(
        self,
        group: _Group,
        model: mujoco.MjModel,
        visible: BoolArray,
        clip_depths_m: tuple[float, float],
        assets: Assets,
    ) -> None:
        self.group, self.model, self.visible, self.assets = group, model, visible, assets
        self.clip_depths_m, self.samples = clip_depths_m, samples_across(model)
        # Stands for poses where the world is not drawn but others of its group are.
        sizes = (model.ngeom, 3), (model.ngeom, 9), (model.nlight, 3), (model.nlight, 3)
        self.nowhere = Poses(*(np.zeros(size) for size in sizes))


@dataclass(frozen=True, eq=False)
class _Request:
    """A drawing that a world waits for.

    Attributes:
        world: The world.
        data: Its poses, which do not change while it waits.
        T_world_camera: `(4, 4)` camera pose.
        K: `(3, 3)` camera matrix [px] or vertical field of view [rad].
        size: Width and height of the whole image [px].
        rect: Rectangle of the segmentation; None asks for a colour image.
        geoms: `(ngeom,)` geoms of the segmentation.
    """

    world: _World
    data: mujoco.MjData
    T_world_camera: ArrayLike
    K: ArrayLike | float
    size: tuple[int, int]
    rect: PixelRect | None = None
    geoms: BoolArray | None = None

    @property
    def rays_across(self) -> int:
        """Rays across and down each pixel of a colour image; 0 for a segmentation."""
        return self.world.samples if self.rect is None else 0


def _draw(requests: Sequence[_Request]) -> list[_Reply]:
    """Draw what worlds wait for, each group of worlds and kind of drawing in one call."""
    alike: defaultdict[tuple[_Group, tuple[int, int], int], list[int]] = defaultdict(list)
    for index, request in enumerate(requests):
        alike[request.world.group, request.size, request.rays_across].append(index)
    replies: dict[int, _Reply] = {}
    for (group, _size, _rays), chosen in alike.items():
        replies.update(zip(chosen, group.draw([requests[index] for index in chosen]), strict=True))
    return [replies[index] for index in range(len(requests))]


class _Group:
    """Some worlds whose models are concatenated on the device."""

    def __init__(self) -> None:
        self.worlds: list[_World] = []
        self._arrays: SceneArrays | None = None

    def change(self, worlds: list[_World]) -> None:
        """Hold these worlds from now on."""
        self.worlds, self._arrays = worlds, None

    def draw(self, requests: Sequence[_Request]) -> list[_Reply]:
        """Draw requests of the same kind and image size, of different worlds."""
        if self._arrays is None:
            models, visible = [one.model for one in self.worlds], [one.visible for one in self.worlds]
            self._arrays = SceneArrays(models, visible, [one.assets for one in self.worlds])
        arrays, first = self._arrays, requests[0]
        by_world = {id(request.world): request for request in requests}
        asked = [by_world.get(id(world)) for world in self.worlds]
        arrays.update_poses(
            [world.nowhere if one is None else one.data for world, one in zip(self.worlds, asked, strict=True)]
        )
        # Cameras of worlds that are not drawn are not looked at.
        views = [first if one is None else one for one in asked]
        planes = [world.clip_depths_m for world in self.worlds]
        cameras = make_cameras([one.T_world_camera for one in views], [one.K for one in views], first.size, planes)
        drawn = [self.worlds.index(request.world) for request in requests]
        if first.rays_across:
            arrays.update_lights()
            return list(cast_color(arrays, cameras, first.size, first.rays_across, drawn))
        masks = [
            np.zeros(world.model.ngeom, dtype=np.bool_) if one is None or one.geoms is None else one.geoms
            for world, one in zip(self.worlds, asked, strict=True)
        ]
        rects = [request.rect for request in requests if request.rect is not None]
        found = cast_ids(arrays, np.concatenate(masks), cameras, rects, drawn)
        ids, depths = (np.asarray(values.numpy()) for values in found)
        return [
            _segmentation(rect, own - np.int32(arrays.geom_start[world]), depth)
            for rect, own, depth, world in zip(rects, ids, depths, drawn, strict=True)
        ]


def _segmentation(rect: PixelRect, ids: Any, inverse_depth: Any) -> Segmentation:
    """Segmentation of a world from its row of the cast; there ids without a geom are below 0."""
    shape, count = (rect.height, rect.width), rect.height * rect.width
    own = np.maximum(ids[:count], -1).astype(np.int32)
    return Segmentation(rect, own.reshape(shape), np.array(inverse_depth[:count], dtype=np.float32).reshape(shape))
