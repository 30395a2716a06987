"""Amodal and visible silhouettes of people, from segmentations of a rendered image.

People, and the scenery that could lie between the camera and them, are rendered in layers: people whose boxes do not
intersect share a layer, so that each person's amodal silhouette is complete in one layer. Comparing the depth of the
layers pixel by pixel gives the visible silhouettes; every geom is rendered only once.
"""

from __future__ import annotations

import math
from collections.abc import Container, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.extents import CORNERS, Bodies
from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.render.backend import PixelRect, Renderer, Segmentation, bounding_rect
from pftrack_sim.render.culling import Bounds

_SPHERE_POINTS, _RIM_POINTS = 2000, 96
"""Vertices of a sphere and of each rim of a cylinder: 0.1 % of the radius short of the surface."""


@dataclass(frozen=True, eq=False)
class Silhouette:
    """Silhouette of one person.

    Attributes:
        rect: Rectangle of the image that contains it.
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


class GeomPoses(NamedTuple):
    """`(ngeom, 3)` positions [m] and `(ngeom, 9)` rotations of all geoms, named as in `MjData`."""

    geom_xpos: FloatArray
    geom_xmat: FloatArray


class Measured(NamedTuple):
    """What is known of all bodies in a view without an image.

    Attributes:
        boxes: `(B, 4)` amodal boxes [px], NaN for those behind the camera.
        depths_m: `(B, 2)` smallest and largest depth.
        lowest_m: `(B,)` height of the lowest point.
    """

    boxes: FloatArray
    depths_m: FloatArray
    lowest_m: FloatArray


class SilhouetteFinder:
    """Finds the people of one model in rendered images.

    Args:
        model: The model.
        renderer: Renderer bound to the model.
        geoms: Visible geoms of each person.
        boxed: Geoms of each further body, of which only the box is wanted.

    Raises:
        ParameterError: A geom without a finite convex shape (plane, height field).
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        renderer: Renderer,
        geoms: Sequence[IntArray],
        boxed: Sequence[IntArray] = (),
    ) -> None:
        self.renderer, self.people_count = renderer, len(geoms)
        self.bodies = Bodies([[surface_points(model, int(geom)) for geom in ids] for ids in [*geoms, *boxed]])
        """Shapes of the people, then those of the geoms of which only boxes are wanted."""
        self.geoms = np.concatenate([*geoms, *boxed])
        """Geom ids of all parts of `bodies`."""
        # A renderer of colors draws the whole image whatever is asked for: everybody together.
        self.batches = [range(len(geoms))] if renderer.draws_color else [range(1), range(1, len(geoms))]
        """People who are best found together."""
        self._geoms_of = geoms
        self._first = self.bodies.some([0, *range(len(geoms), len(geoms) + len(boxed))])
        self._first_geoms = np.concatenate([geoms[0], *boxed])
        # One more entry than geoms: id -1, no geom, reads the last one.
        self._masks = np.zeros((len(geoms), model.ngeom + 1), dtype=np.bool_)
        for mask, ids in zip(self._masks, geoms, strict=True):
            mask[ids] = True
        self._others = np.flatnonzero(renderer.visible_geoms & ~self._masks[0, :-1])
        """All but the first person."""
        self._bounds = Bounds(model, triangles=True)

    def release(self) -> None:
        """Release the model, once everybody has been found."""
        self._bounds.release()

    def poses(self, data: mujoco.MjData) -> tuple[FloatArray, FloatArray]:
        """`(S, 3)` positions [m] and `(S, 3, 3)` rotations of the parts."""
        return data.geom_xpos[self.geoms], data.geom_xmat[self.geoms].reshape(-1, 3, 3)

    def measure(self, scene: mujoco.MjData | GeomPoses, T_world_camera: FloatArray, K: FloatArray) -> Measured:
        """Measure all bodies, placed as in `scene`, from a `(4, 4)` camera pose with a `(3, 3)` camera matrix [px]."""
        return self._measured(self.bodies, self.geoms, scene, T_world_camera, K)

    def measure_first(self, scene: mujoco.MjData | GeomPoses, T_world_camera: FloatArray, K: FloatArray) -> Measured:
        """The same of the first person, and of the bodies of which only boxes are wanted."""
        return self._measured(self._first, self._first_geoms, scene, T_world_camera, K)

    def _measured(
        self,
        bodies: Bodies,
        geoms: IntArray,
        scene: mujoco.MjData | GeomPoses,
        T_world_camera: FloatArray,
        K: FloatArray,
    ) -> Measured:
        positions, rotations = scene.geom_xpos[geoms], scene.geom_xmat[geoms].reshape(-1, 3, 3)
        return Measured(*bodies.boxes(positions, rotations, T_world_camera, K, self.renderer.near_m))

    def nothing_before_first(
        self, data: mujoco.MjData, T_world_camera: FloatArray, K: FloatArray, measured: Measured
    ) -> bool:
        """Whether the first person is in front of the camera, and nothing else may occlude any part of the person.

        `measured` begins with the first person.
        """
        rect = pixels_around(measured.boxes[0], (self.renderer.width_px, self.renderer.height_px))
        if rect is None:
            return False
        return not self._may_occlude(data, T_world_camera, K, measured, self._others, 0, rect).any()

    def find(
        self,
        data: mujoco.MjData,
        T_world_camera: FloatArray,
        K: FloatArray,
        measured: Measured,
        people: Container[int] | None = None,
    ) -> dict[int, Silhouette]:
        """Find people in a rendered image.

        Args:
            data: Positions.
            T_world_camera: `(4, 4)` camera pose.
            K: `(3, 3)` camera matrix [px].
            measured: What `measure` gives for these; what `measure_first` gives is enough for the first person.
            people: Indices of the people to find; None finds all.

        Returns:
            Silhouettes by person, of those who may have pixels in the image.
        """
        renderer = self.renderer
        rects: dict[int, PixelRect] = {}
        for person, box in enumerate(measured.boxes[: self.people_count]):
            rect = pixels_around(box, (renderer.width_px, renderer.height_px))
            if rect is not None and (people is None or person in people):
                rects[person] = rect
        if not rects:
            return {}
        found = list(rects)
        scenery = np.flatnonzero(renderer.visible_geoms & ~self._masks[found, :-1].any(axis=0))
        view = data, T_world_camera, K, measured, scenery
        may_occlude = np.stack([self._may_occlude(*view, person, rect) for person, rect in rects.items()], axis=1)
        occluders = scenery[may_occlude.any(axis=1)]
        occluded = [found[column] for column in np.flatnonzero(may_occlude.any(axis=0))]
        layers: list[Segmentation] = []
        layer_of: dict[int, Segmentation] = {}
        for index, group in enumerate(_disjoint_groups(rects, occluded)):
            shown = np.logical_or.reduce(self._masks[group, :-1], axis=0)
            wanted = [rects[person] for person in group]
            if index == 0 and occluders.size:
                shown[occluders] = True
                wanted += [rects[person] for person in occluded]
            layer = renderer.ids(data, T_world_camera, K, geoms=shown, rect=bounding_rect(wanted))
            layers.append(layer)
            layer_of.update(dict.fromkeys(group, layer))
        return {person: self._combine(person, rects[person], layer_of[person], layers) for person in found}

    def _may_occlude(
        self,
        data: mujoco.MjData,
        T_world_camera: FloatArray,
        K: FloatArray,
        measured: Measured,
        geoms: IntArray,
        person: int,
        rect: PixelRect,
    ) -> BoolArray:
        """`(N,)` whether each of N geoms may occlude a person with this rectangle."""
        view = T_world_camera, focal_and_centre(K), rect, self.renderer.near_m
        of_person = self._geoms_of[person], float(measured.depths_m[person, 1]), float(measured.lowest_m[person])
        return self._bounds.may_occlude(data, *view, geoms, *of_person)

    def _combine(self, person: int, rect: PixelRect, layer: Segmentation, layers: list[Segmentation]) -> Silhouette:
        """Combine the layer of a person with all others by depth."""
        rows, columns = rect.relative_to(layer.rect).slices
        ids, inverse_depth = layer.ids[rows, columns], layer.inverse_depth[rows, columns]
        amodal = self._masks[person].take(ids)
        top, nearest = ids, inverse_depth
        for other in layers:
            if other is layer or not other.rect.intersects(rect):
                continue
            common = rect.intersection(other.rect)
            there, here = common.relative_to(other.rect).slices, common.relative_to(rect).slices
            other_ids, other_depth = other.ids[there], other.inverse_depth[there]
            # On equal depth the larger id is in front, as in every layer.
            tied_in_front = (other_depth == nearest[here]) & (other_ids > top[here])
            in_front = amodal[here] & ((other_depth > nearest[here]) | tied_in_front)
            if in_front.any():
                if top is ids:
                    top, nearest = ids.copy(), inverse_depth.copy()
                top[here][in_front] = other_ids[in_front]
                nearest[here][in_front] = other_depth[in_front]
        return Silhouette(rect, amodal, amodal & (top == ids), top)


def pixels_around(box: FloatArray, size: tuple[int, int], margin_px: int = 1) -> PixelRect | None:
    """Rectangle of the pixels that a body with a `(4,)` amodal box [px] may touch; None if there are none in the image.

    `size` is the image's width and height [px]; a margin of 1 px covers the rounding of triangles.
    """
    x, y, w, h = box.tolist()
    if not math.isfinite(x + y + w + h):
        return None
    x0, y0 = max(math.floor(x) - margin_px, 0), max(math.floor(y) - margin_px, 0)
    x1, y1 = min(math.ceil(x + w) + margin_px, size[0]), min(math.ceil(y + h) + margin_px, size[1])
    return PixelRect(x0, y0, x1 - x0, y1 - y0) if x0 < x1 and y0 < y1 else None


def _disjoint_groups(rects: dict[int, PixelRect], occluded: list[int]) -> list[list[int]]:
    """Split people, by their rectangles, into groups whose rectangles do not intersect.

    The first has none of the people whom scenery may occlude, as the scenery is rendered with it; it may be empty.
    """
    groups: list[list[int]] = [[]] if occluded else []
    for person in rects:
        for group in groups[1:] if person in occluded else groups:
            if not any(rects[person].intersects(rects[other]) for other in group):
                group.append(person)
                break
        else:
            groups.append([person])
    return groups


def surface_points(model: mujoco.MjModel, geom: int) -> FloatArray:
    """`(V, 3)` vertices of a geom in its own frame [m]; of a curved one, points on its surface.

    Raises:
        ParameterError: A geom type without a finite convex shape (plane, height field).
    """
    kind, size = mujoco.mjtGeom(int(model.geom_type[geom])), np.asarray(model.geom_size[geom])
    match kind:
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return size[0] * _unit_sphere()
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return size * _unit_sphere()
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return np.concatenate([size[0] * _unit_sphere() + (0.0, 0.0, z) for z in (-size[1], size[1])])
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            angles = 2.0 * np.pi * np.arange(_RIM_POINTS) / _RIM_POINTS
            circle = size[0] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
            return np.concatenate([np.column_stack([circle, np.full(_RIM_POINTS, z)]) for z in (-size[1], size[1])])
        case mujoco.mjtGeom.mjGEOM_BOX:
            return CORNERS * size
        case mujoco.mjtGeom.mjGEOM_MESH:
            mesh = int(model.geom_dataid[geom])
            first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            return np.asarray(model.mesh_vert[first : first + count], dtype=np.float64)
        case _:
            raise ParameterError(f"geom {model.geom(geom).name!r} of a person has type {kind.name}, which has no box")


def _unit_sphere() -> FloatArray:
    """`(V, 3)` points spread evenly over the unit sphere (Fibonacci spiral)."""
    index = np.arange(_SPHERE_POINTS)
    height = 1.0 - (2.0 * index + 1.0) / _SPHERE_POINTS
    angle = index * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - height * height)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
