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

from pftrack_sim.render.backend import Layer, PixelRect, Renderer
from pftrack_sim.render.bounds import Bounds

Array = NDArray[np.float64]


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
        self._bounds = Bounds(model)

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
        covers = self._bounds.may_cover(
            data,
            T_world_camera,
            K,
            self._others,
            [self._limbs[person] for person in people],
            [rects[person] for person in people],
            farthest_m[people],
            renderer.near_m,
        )
        if not covers.any():
            return None
        shown = np.zeros(self._masks.shape[1] - 1, dtype=np.bool_)
        shown[self._others[covers]] = True
        return renderer.ids(data, T_world_camera, K, shown=shown, within=_union(list(rects.values())))

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
