"""Amodal and visible silhouettes of people: a person drawn alone, then with all that could occlude the person."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.extents import Bodies
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.render.culling import Bounds, PixelRect, View
from pftrack_sim.render.segmentation import Segmentation, Segmenter


@dataclass(frozen=True, eq=False)
class Silhouette:
    """Silhouette of one person in a rectangle of the image.

    Attributes:
        amodal: `(h, w)` pixels of the whole person.
        visible: `(h, w)` pixels that show the person.
        top: `(h, w)` ids of the geoms in front, valid on the amodal pixels.
    """

    rect: PixelRect
    amodal: BoolArray
    visible: BoolArray
    top: NDArray[np.int32]

    def occluding_geoms(self) -> NDArray[np.int32]:
        """Geom id on each amodal pixel that is not visible."""
        return self.top[self.amodal & ~self.visible]


class Measured(NamedTuple):
    """What is known of B bodies in a frame without drawing them.

    Attributes:
        boxes: `(B, 4)` amodal boxes [px], NaN for those behind the camera.
        swept: `(B, 4)` the same over the whole exposure.
        depths_m: `(B, 2)` smallest and largest depth.
        lowest_m: `(B,)` height of the lowest point.
    """

    boxes: FloatArray
    swept: FloatArray
    depths_m: FloatArray
    lowest_m: FloatArray


class Scene(ABC):
    """What a frame shows of the geoms of a model, of whose bounding boxes `bounds` are.

    `view` is scene and camera at the time of the frame; what is far there is drawn by coarser meshes.
    """

    def __init__(self, segmenter: Segmenter, bounds: Bounds, view: View) -> None:
        self.segmenter, self._bounds, self.view = segmenter, bounds, view

    @abstractmethod
    def measure(self, bodies: Bodies, geoms: IntArray) -> Measured:
        """Measure bodies, whose `(S,)` parts are geoms."""

    @abstractmethod
    def add(self, found: Segmentation, geoms: IntArray) -> None:
        """Draw more geoms into a segmentation."""

    def segment(self, rect: PixelRect, geoms: IntArray) -> Segmentation:
        """Segment a rectangle of pixels, in which only some geoms are drawn."""
        found = self.segmenter.nothing(rect)
        self.add(found, geoms)
        return found

    def may_occlude(self, rect: PixelRect, geoms: IntArray, farthest_m: float, lowest_m: float) -> BoolArray:
        """`(N,)` which geoms may occlude a person, see `Bounds.may_occlude`."""
        return self._bounds.may_occlude(self.view, rect, geoms, farthest_m, lowest_m)


class InstantScene(Scene):
    """A frame at an instant through a pinhole."""

    def measure(self, bodies: Bodies, geoms: IntArray) -> Measured:
        """See `Scene`."""
        boxes, depths, lowest = bodies.boxes(*poses_of(self.view, geoms), *self.view[2:])
        return Measured(boxes, boxes, depths, lowest)

    def add(self, found: Segmentation, geoms: IntArray) -> None:
        """See `Scene`."""
        self.segmenter.add(found, self.view, geoms)


class Shapes:
    """Shapes of the people of one model, by the visible geoms of each.

    `parts` are geoms of the first person whose box is wanted, too; none of them for none.

    Attributes:
        bodies: Shapes of the people, then of the parts; `geoms`: geom ids of all their parts.
        first: Shapes of the first person, then of the parts; `first_geoms`: the same of these.
        geoms_of: Visible geoms of each person.
        masks: `(P, ngeom + 1)` which geoms are a person's; the last one is id -1, no geom.
        bounds: Bounding boxes of all geoms.
    """

    def __init__(self, model: mujoco.MjModel, segmenter: Segmenter, geoms: Sequence[IntArray], parts: IntArray) -> None:
        wanted = [*geoms, parts] if parts.size else geoms
        vertices, starts = segmenter.triangles.vertices, segmenter.triangles.vertex_starts
        shapes = [[vertices[starts[geom] : starts[geom + 1]] for geom in ids] for ids in wanted]
        self.bodies, self.geoms = Bodies(shapes), np.concatenate(wanted)
        self.first, self.first_geoms = Bodies([shapes[0], *shapes[len(geoms) :]]), np.append(geoms[0], parts)
        self.geoms_of = geoms
        self.masks = np.zeros((len(geoms), model.ngeom + 1), dtype=np.bool_)
        for mask, ids in zip(self.masks, geoms, strict=True):
            mask[ids] = True
        self.bounds = Bounds(model)


class PeopleInView:
    """People in an image `size` wide and high [px], found when they are first asked for."""

    def __init__(self, shapes: Shapes, scene: Scene, size: tuple[int, int]) -> None:
        self._shapes, self.scene, self._size = shapes, scene, size
        self._found: dict[int, Silhouette | None] = {}

    @cached_property
    def first(self) -> Measured:
        """Measures of the first person, and of the parts."""
        return self.scene.measure(self._shapes.first, self._shapes.first_geoms)

    @cached_property
    def all(self) -> Measured:
        """Measures of all people, and of the parts."""
        return self.scene.measure(self._shapes.bodies, self._shapes.geoms)

    def boxes(self, person: int) -> tuple[FloatArray, FloatArray]:
        """Amodal and swept box `(4,)` of a person [px]; of the first that of the parts, where there are any."""
        known, row = (self.all, person) if person else (self.first, -1)
        return known.boxes[row], known.swept[row]

    def silhouette(self, person: int) -> Silhouette | None:
        """Silhouette of a person; None for one without pixels in the image."""
        if person not in self._found:
            self._found[person] = self._find(person)
        return self._found[person]

    def _find(self, person: int) -> Silhouette | None:
        known, shapes, scene = self.all if person else self.first, self._shapes, self.scene
        rect = _pixels_around(known.boxes[person], self._size)
        if rect is None:
            return None
        layer = scene.segment(rect, shapes.geoms_of[person])
        amodal, own = layer.ids >= 0, shapes.masks[person]
        others = np.flatnonzero(scene.segmenter.drawn & ~own[:-1])
        farthest_m, lowest_m = float(known.depths_m[person, 1]), float(known.lowest_m[person])
        occluders = others[scene.may_occlude(rect, others, farthest_m, lowest_m)]
        if not occluders.size:
            return Silhouette(rect, amodal, amodal, layer.ids)
        scene.add(layer, occluders)
        return Silhouette(rect, amodal, amodal & own.take(layer.ids), layer.ids)


def poses_of(scene: mujoco.MjData | View, geoms: IntArray) -> tuple[FloatArray, FloatArray]:
    """`(N, 3)` positions [m] and `(N, 3, 3)` rotations of some geoms."""
    return scene.geom_xpos[geoms], scene.geom_xmat[geoms].reshape(-1, 3, 3)


def _pixels_around(box: FloatArray, size: tuple[int, int]) -> PixelRect | None:
    """Rectangle of the pixels that a body with a `(4,)` amodal box [px] may touch; None if there are none in the image.

    A margin of 1 px covers the rounding of triangles.
    """
    x, y, w, h = box.tolist()
    if not math.isfinite(x + y + w + h):
        return None
    x0, y0 = max(math.floor(x) - 1, 0), max(math.floor(y) - 1, 0)
    x1, y1 = min(math.ceil(x + w) + 1, size[0]), min(math.ceil(y + h) + 1, size[1])
    return PixelRect(x0, y0, x1 - x0, y1 - y0) if x0 < x1 and y0 < y1 else None
