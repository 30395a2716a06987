"""Who covers whom: everyone's whole outline in pixels, and what of it shows.

People whose boxes do not meet are drawn together, alone in the world; those who may cover each other are drawn in
turn. Whatever of the scenery could come between the camera and someone is drawn once more, without people. Comparing
nearness pixel by pixel then tells what a picture of everything shows, and what is behind it, and each thing was drawn
only once.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.extents import CORNERS
from pftrack_sim.camera.optics import focal_and_centre
from pftrack_sim.render.backend import Layer, PixelRect, Renderer

Array = NDArray[np.float64]

_UNBOUNDED = [int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD)]
"""Geoms without a bounding box to reason with."""

_SLACK_PX, _SLACK_M = 1.0, 1e-4
"""OpenGL computes in single precision: what misses by less may still touch."""


@dataclass(frozen=True, eq=False)
class Silhouette:
    """One person's outline.

    Attributes:
        rect: The part of the image it lies in.
        amodal: `(h, w)` pixels of the whole person.
        visible: `(h, w)` those that show.
        covering: Geom ids on the pixels that do not show.
    """

    rect: PixelRect
    amodal: NDArray[np.bool_]
    visible: NDArray[np.bool_]
    covering: NDArray[np.int32]


class Silhouettes:
    """Finds silhouettes in the frames of one model.

    Args:
        model: The model.
        person_of_geom: `(ngeom,)` index of the person each geom belongs to, -1 for everything else.
        visible_geoms: `(ngeom,)` which geoms are drawn at all.
    """

    def __init__(self, model: mujoco.MjModel, person_of_geom: NDArray[np.intp], visible_geoms: NDArray[np.bool_]):
        people = int(person_of_geom.max(initial=-1)) + 1
        # One more entry than geoms: id -1, no geom, reads the last one.
        self._masks = np.zeros((people, model.ngeom + 1), dtype=np.bool_)
        for person in range(people):
            self._masks[person, :-1] = (person_of_geom == person) & visible_geoms
        self._limbs = [np.flatnonzero(mask) for mask in self._masks]
        self._others = np.flatnonzero((person_of_geom < 0) & visible_geoms)
        self._bounds = np.array(model.geom_aabb, dtype=np.float64).reshape(-1, 2, 3)
        self._corners = self._bounds[:, :1] + CORNERS * self._bounds[:, 1:]
        self._unbounded = np.isin(model.geom_type, _UNBOUNDED)

    def find(
        self,
        renderer: Renderer,
        data: mujoco.MjData,
        T_world_camera: Array,
        K: Array,
        rects: dict[int, PixelRect],
        farthest_m: Array,
    ) -> dict[int, Silhouette]:
        """Silhouettes of the people who may be in the image.

        Args:
            renderer: Draws ids.
            data: Positions.
            T_world_camera: `(4, 4)` camera pose.
            K: `(3, 3)` camera matrix [px].
            rects: By person, the part of the image that holds every pixel of the person.
            farthest_m: `(P,)` depth of each person's farthest point.

        Returns:
            By person, those of `rects`.
        """
        if not rects:
            return {}
        scenery = self._scenery(renderer, data, T_world_camera, K, rects, farthest_m)
        layers: list[Layer] = []
        layer_of: dict[int, Layer] = {}
        for group in _apart(rects):
            shown = np.logical_or.reduce(self._masks[group, :-1], axis=0)
            within = _union([rects[person] for person in group])
            layer = renderer.ids(data, T_world_camera, K, shown=shown, within=within)
            layers.append(layer)
            layer_of.update(dict.fromkeys(group, layer))
        if scenery is not None:
            layers.append(scenery)
        return {
            person: self._silhouette(person, rect, layer_of[person], layers) for person, rect in sorted(rects.items())
        }

    def _scenery(
        self,
        renderer: Renderer,
        data: mujoco.MjData,
        T_world_camera: Array,
        K: Array,
        rects: dict[int, PixelRect],
        farthest_m: Array,
    ) -> Layer | None:
        """What could cover anyone, drawn without people; None when nothing could."""
        people = sorted(rects)
        boxes = np.array([rects[person] for person in people], dtype=np.float64)
        covers = self._before(data, T_world_camera, K, boxes, farthest_m[people], renderer.near_m)
        rows = np.flatnonzero(covers.any(axis=1))
        for column, person in enumerate(people):
            covers[rows, column] &= ~self._behind_a_face(data, T_world_camera, self._others[rows], person)
        candidates = self._others[covers.any(axis=1)]
        if candidates.size == 0:
            return None
        shown = np.zeros(len(self._bounds), dtype=np.bool_)
        shown[candidates] = True
        return renderer.ids(data, T_world_camera, K, shown=shown, within=_union(list(rects.values())))

    def _before(
        self, data: mujoco.MjData, T_world_camera: Array, K: Array, boxes: Array, farthest_m: Array, near_m: float
    ) -> NDArray[np.bool_]:
        """Which other geoms may cover whom: their bounds meet the person's box and begin before the person ends.

        Args:
            data: Positions.
            T_world_camera: `(4, 4)` camera pose.
            K: `(3, 3)` camera matrix [px].
            boxes: `(P, 4)` left, top, width, height [px].
            farthest_m: `(P,)` depth of each person's farthest point.
            near_m: Depth below which nothing is drawn.

        Returns:
            `(N, P)`; false only for what certainly covers nobody.
        """
        fx, fy, cx, cy = focal_and_centre(K)
        view = T_world_camera[:3, :3].T
        axes = view @ data.geom_xmat[self._others].reshape(-1, 3, 3)
        centres = (data.geom_xpos[self._others] - T_world_camera[:3, 3]) @ view.T
        corners = axes @ self._corners[self._others].transpose(0, 2, 1) + centres[:, :, None]
        depth = corners[:, 2]
        nearest = depth.min(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels = corners[:, :2] / depth[:, None]
        low = pixels.min(axis=2) * (fx, fy) + (cx - _SLACK_PX, cy - _SLACK_PX)
        high = pixels.max(axis=2) * (fx, fy) + (cx + _SLACK_PX, cy + _SLACK_PX)
        crossing = nearest < near_m
        low[crossing], high[crossing] = -np.inf, np.inf
        meets = (
            (low[:, None, :] <= boxes[:, :2] + boxes[:, 2:]).all(axis=2)
            & (high[:, None, :] >= boxes[:, :2]).all(axis=2)
            & (nearest[:, None] <= farthest_m + _SLACK_M)
        )
        return (meets & (depth.max(axis=1) >= near_m)[:, None]) | self._unbounded[self._others, None]

    def _behind_a_face(
        self, data: mujoco.MjData, T_world_camera: Array, geoms: NDArray[np.intp], person: int
    ) -> NDArray[np.bool_]:
        """Which geoms have both the camera and the whole person on the far side of one face of their bounds.

        Such a geom covers nothing of the person: the ground under a foot in the air, the wall of a corridor.

        Args:
            data: Positions.
            T_world_camera: `(4, 4)` camera pose.
            geoms: `(N,)` ids.
            person: Who.

        Returns:
            `(N,)`
        """
        limbs = self._limbs[person]
        turns = data.geom_xmat[limbs].reshape(-1, 3, 3)
        points = (self._corners[limbs] @ turns.transpose(0, 2, 1) + data.geom_xpos[limbs, None]).reshape(-1, 3)
        points = np.concatenate([points, T_world_camera[None, :3, 3]])
        axes = data.geom_xmat[geoms].reshape(-1, 3, 3)
        origins = (data.geom_xpos[geoms, None] @ axes)[:, 0] + self._bounds[geoms, 0]
        along = np.tensordot(axes, points, axes=(1, 1)) - origins[:, :, None]
        half = self._bounds[geoms, 1] + _SLACK_M
        beyond = (along.min(axis=2) > half) | (along.max(axis=2) < -half)
        return beyond.any(axis=1) & ~self._unbounded[geoms]

    def _silhouette(self, person: int, rect: PixelRect, own: Layer, layers: list[Layer]) -> Silhouette:
        rows, columns = rect.within(own.rect).slices
        ids, nearness = own.ids[rows, columns], own.nearness[rows, columns]
        amodal = self._masks[person].take(ids)
        top, best = ids, nearness
        for layer in layers:
            if layer is own or not layer.rect.meets(rect):
                continue
            common = _common(rect, layer.rect)
            theirs = common.within(layer.rect).slices
            here = common.within(rect).slices
            other_ids, other = layer.ids[theirs], layer.nearness[theirs]
            closer = amodal[here] & ((other > best[here]) | ((other == best[here]) & (other_ids > top[here])))
            if closer.any():
                if top is ids:
                    top, best = ids.copy(), nearness.copy()
                top[here][closer] = other_ids[closer]
                best[here][closer] = other[closer]
        hidden = amodal & (top != ids)
        return Silhouette(rect, amodal, amodal & ~hidden, top[hidden])


def _apart(rects: dict[int, PixelRect]) -> list[list[int]]:
    """Split people into groups within which no two rectangles meet."""
    groups: list[list[int]] = []
    for person, rect in sorted(rects.items()):
        for group in groups:
            if not any(rect.meets(rects[other]) for other in group):
                group.append(person)
                break
        else:
            groups.append([person])
    return groups


def _union(rects: list[PixelRect]) -> PixelRect:
    """The smallest rectangle around several."""
    left, top = min(r.left for r in rects), min(r.top for r in rects)
    right, bottom = max(r.left + r.width for r in rects), max(r.top + r.height for r in rects)
    return PixelRect(left, top, right - left, bottom - top)


def _common(first: PixelRect, second: PixelRect) -> PixelRect:
    """The pixels two rectangles share; they meet."""
    left, top = max(first.left, second.left), max(first.top, second.top)
    right = min(first.left + first.width, second.left + second.width)
    bottom = min(first.top + first.height, second.top + second.height)
    return PixelRect(left, top, right - left, bottom - top)
