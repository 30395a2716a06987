"""Who covers whom: everyone's whole outline in pixels, and what of it shows.

Everyone, and whatever of the scenery could come between the camera and someone, is drawn in layers: those who cannot
cover each other together, the others apart. So everybody's whole outline is in one layer. Comparing nearness between
the layers, pixel by pixel, then tells what a picture of everything shows; and each thing was drawn only once.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.render.backend import PixelRect, Renderer, Segmentation, bounding_rect
from pftrack_sim.render.culling import Bounds

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Silhouette:
    """One person's outline.

    Attributes:
        rect: The part of the image it lies in.
        amodal: `(h, w)` pixels of the whole person.
        visible: `(h, w)` those that show.
        top: `(h, w)` geom ids of what shows on the person's pixels; anything elsewhere.
    """

    rect: PixelRect
    amodal: NDArray[np.bool_]
    visible: NDArray[np.bool_]
    top: NDArray[np.int32]

    def covering(self) -> NDArray[np.int32]:
        """Geom ids on the person's pixels that do not show."""
        return self.top[self.amodal & ~self.visible]


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
        lowest_m: Array,
    ) -> dict[int, Silhouette]:
        """Silhouettes of the people who may be in the image.

        Args:
            renderer: Draws ids.
            data: Positions.
            T_world_camera: `(4, 4)` camera pose.
            K: `(3, 3)` camera matrix [px].
            rects: By person, the part of the image that holds every pixel of the person.
            farthest_m: `(P,)` depth of each person's farthest point.
            lowest_m: `(P,)` height of each person's lowest point.

        Returns:
            By person, those of `rects`.
        """
        if not rects:
            return {}
        people = sorted(rects)
        covers = self._bounds.may_occlude(
            data,
            T_world_camera,
            K,
            self._others,
            [self._limbs[person] for person in people],
            [rects[person] for person in people],
            farthest_m[people],
            lowest_m[people],
            renderer.near_m,
        )
        scenery = self._others[covers.any(axis=1)]
        covered = [people[column] for column in np.flatnonzero(covers.any(axis=0))]
        layers: list[Segmentation] = []
        layer_of: dict[int, Segmentation] = {}
        for index, group in enumerate(_apart(rects, covered)):
            shown = np.logical_or.reduce(self._masks[group, :-1], axis=0)
            wanted = [rects[person] for person in group]
            if index == 0 and scenery.size:
                shown[scenery] = True
                wanted += [rects[person] for person in covered]
            layer = renderer.ids(data, T_world_camera, K, geoms=shown, rect=bounding_rect(wanted))
            layers.append(layer)
            layer_of.update(dict.fromkeys(group, layer))
        return {person: self._silhouette(person, rects[person], layer_of[person], layers) for person in people}

    def _silhouette(self, person: int, rect: PixelRect, own: Segmentation, layers: list[Segmentation]) -> Silhouette:
        rows, columns = rect.relative_to(own.rect).slices
        ids, nearness = own.ids[rows, columns], own.inverse_depth[rows, columns]
        amodal = self._masks[person].take(ids)
        top, best = ids, nearness
        for layer in layers:
            if layer is own or not layer.rect.intersects(rect):
                continue
            common = rect.intersection(layer.rect)
            theirs = common.relative_to(layer.rect).slices
            here = common.relative_to(rect).slices
            other_ids, other = layer.ids[theirs], layer.inverse_depth[theirs]
            closer = amodal[here] & ((other > best[here]) | ((other == best[here]) & (other_ids > top[here])))
            if closer.any():
                if top is ids:
                    top, best = ids.copy(), nearness.copy()
                top[here][closer] = other_ids[closer]
                best[here][closer] = other[closer]
        hidden = amodal & (top != ids)
        return Silhouette(rect, amodal, amodal & ~hidden, top)


def pixels_around(box: Array, size: tuple[int, int], margin_px: int = 1) -> PixelRect | None:
    """The pixels of an image that a body may touch; None when there are none.

    Args:
        box: `(4,)` its amodal box [px].
        size: Width and height of the image [px].
        margin_px: Pixels around the box that the body could still touch: one, for a rounded triangle.
    """
    if not np.isfinite(box).all():
        return None
    left, top = np.floor(box[:2]) - margin_px
    right, bottom = np.ceil(box[:2] + box[2:]) + margin_px
    x0, y0 = int(max(left, 0.0)), int(max(top, 0.0))
    x1, y1 = int(min(right, size[0])), int(min(bottom, size[1]))
    return PixelRect(x0, y0, x1 - x0, y1 - y0) if x0 < x1 and y0 < y1 else None


def _apart(rects: dict[int, PixelRect], covered: list[int]) -> list[list[int]]:
    """Split people into groups within which nobody covers anybody.

    Args:
        rects: By person, where in the image it is.
        covered: The people whom scenery may cover.

    Returns:
        Groups of people whose rectangles do not meet; the first has none of the covered, for scenery to be drawn with,
        and may be empty if there are covered people.
    """
    groups: list[list[int]] = [[]] if covered else []
    for person in sorted(rects):
        for group in groups[1:] if person in covered else groups:
            if not any(rects[person].intersects(rects[other]) for other in group):
                group.append(person)
                break
        else:
            groups.append([person])
    return groups
