"""Boxes and silhouettes without images: those of `Bodies` and `SilhouetteFinder`, computed by kernels."""

from __future__ import annotations

from collections.abc import Container, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from pftrack_sim.camera.extents import Bodies, extent_beyond
from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.core.types import FloatArray, IntArray
from pftrack_sim.render.backend import PixelRect, Renderer
from pftrack_sim.render.cpu.id_rasteriser import IdRasteriser
from pftrack_sim.render.cpu.kernels import silhouettes
from pftrack_sim.render.culling import GROUND_CONTACT_M
from pftrack_sim.truth.silhouettes import Silhouette, SilhouetteFinder


class GeometricBodies(Bodies):
    """`Bodies` whose boxes are equal up to rounding, and cost a fifth."""

    def __init__(self, bodies: Sequence[Sequence[FloatArray]]) -> None:
        super().__init__(bodies)
        self._flat = np.concatenate(self.vertices)
        self._first = np.cumsum([0, *(len(vertices) for vertices in self.vertices)]).astype(np.intp)
        self._ends = np.append(self.starts, len(self.vertices))

    def boxes(
        self, positions: ArrayLike, rotations: ArrayLike, T_world_camera: ArrayLike, K: ArrayLike, near_m: float
    ) -> tuple[FloatArray, FloatArray]:
        """See `Bodies.boxes`."""
        return self.measure(positions, rotations, T_world_camera, K, near_m)[:2]

    def measure(
        self, positions: ArrayLike, rotations: ArrayLike, T_world_camera: ArrayLike, K: ArrayLike, near_m: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """`(B, 4)` boxes [px] and `(B, 2)` depth ranges [m] of `Bodies.boxes`, and the `(B,)` heights of `lowest`."""
        pose, turned = np.asarray(T_world_camera, dtype=np.float64), np.asarray(rotations, dtype=np.float64)
        places = np.asarray(positions, dtype=np.float64)
        centres, axes = (places - pose[:3, 3]) @ pose[:3, :3], pose[:3, :3].T @ turned
        extents, ranges = _project(self._flat, self._first, centres, axes, places, turned)
        for part in np.flatnonzero(ranges[:, 0] < near_m):
            beyond = ranges[part, 1] >= near_m
            local = self.vertices[part] @ axes[part].T + centres[part]
            extents[part] = extent_beyond(local, near_m) if beyond else np.nan
        return _gather(extents, ranges, self._ends, focal_and_centre(K))


class GeomPoses(NamedTuple):
    """Copies of the poses of all geoms in an `MjData`, under its names."""

    geom_xpos: FloatArray
    geom_xmat: FloatArray

    @classmethod
    def of(cls, data: mujoco.MjData) -> GeomPoses:
        """Those of this instant."""
        return cls(data.geom_xpos.copy(), data.geom_xmat.copy())


class GeometricFinder(SilhouetteFinder):
    """Finds people person by person: it costs by the triangles of those in view and of what may occlude them."""

    def __init__(
        self,
        model: mujoco.MjModel,
        renderer: Renderer,
        geoms: Sequence[IntArray],
        bodies: Sequence[Sequence[FloatArray]],
        boxed: Sequence[IntArray] = (),
    ) -> None:
        measured = GeometricBodies(bodies)
        super().__init__(model, renderer, geoms, measured, boxed)
        assert isinstance(renderer, IdRasteriser)
        # Those of this model: what is found later may be asked for after the renderer has the next one.
        self._shapes, self._measured = renderer.shapes, measured
        drawn = renderer.visible_geoms
        others = [np.flatnonzero(drawn & ~mask[:-1]) for mask in self._masks]
        self._own, self._own_ends = _joined([np.flatnonzero(drawn & mask[:-1]) for mask in self._masks])
        self._others, self._other_ends = _joined(others)

    def find(
        self,
        data: mujoco.MjData | GeomPoses,
        T_world_camera: FloatArray,
        K: FloatArray,
        people: Container[int] | None = None,
    ) -> tuple[FloatArray, dict[int, Silhouette]]:
        """See `SilhouetteFinder.find`."""
        renderer, (triangles, projected) = self.renderer, self._shapes
        positions, rotations = data.geom_xpos, data.geom_xmat.reshape(-1, 3, 3)
        boxes, depths, lowest = self._measured.measure(
            positions[self.geoms], rotations[self.geoms], T_world_camera, K, renderer.near_m
        )
        wanted = np.array([people is None or person in people for person in range(self.people_count)])
        # Soles penetrate the ground a little without being occluded by it, as in `Bounds.may_occlude`.
        from_above = T_world_camera[2, 3] > lowest
        above_m = np.where(from_above, lowest + GROUND_CONTACT_M, -np.inf)
        rects, ends, amodal, visible, top = silhouettes(
            wanted, boxes, depths[:, 1], above_m, self._own, self._own_ends, self._others, self._other_ends, projected,
            triangles, positions, rotations, T_world_camera, focal_and_centre(K),
            (renderer.width_px, renderer.height_px), renderer.near_m,
        )  # fmt: skip
        found: dict[int, Silhouette] = {}
        for person, (start, end) in enumerate(ends.tolist()):
            if end > start:
                rect = PixelRect(*rects[person].tolist())
                shape, pixels = (rect.height, rect.width), slice(start, end)
                masks = amodal[pixels].reshape(shape), visible[pixels].reshape(shape)
                found[person] = Silhouette(rect, *masks, top[pixels].reshape(shape))
        return boxes, found


def _joined(lists: Sequence[IntArray]) -> tuple[IntArray, IntArray]:
    """Lists behind one another, and the `(N + 1,)` places where they begin and end."""
    return np.concatenate(lists), np.cumsum([0, *(len(one) for one in lists)]).astype(np.intp)


@njit(cache=True, nogil=True, error_model="numpy")
def _project(
    vertices: FloatArray,
    first: IntArray,
    centres: FloatArray,
    axes: FloatArray,
    positions: FloatArray,
    rotations: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """`(S, 4)` extents, and `(S, 3)` depth ranges and lowest heights of parts, as if all lay in front of the camera.

    Centres and axes of the parts are in camera axes, positions and rotations in the world.
    """
    extents, ranges = np.empty((len(centres), 4)), np.empty((len(centres), 3))
    for part in range(len(centres)):
        r, (cx, cy, cz) = axes[part], centres[part]
        up_x, up_y, up_z, height = (
            rotations[part, 2, 0],
            rotations[part, 2, 1],
            rotations[part, 2, 2],
            positions[part, 2],
        )
        left, top, right, bottom, near, far = np.inf, np.inf, -np.inf, -np.inf, np.inf, -np.inf
        lowest = np.inf
        for index in range(first[part], first[part + 1]):
            x, y, z = vertices[index, 0], vertices[index, 1], vertices[index, 2]
            depth = r[2, 0] * x + r[2, 1] * y + r[2, 2] * z + cz
            u = (r[0, 0] * x + r[0, 1] * y + r[0, 2] * z + cx) / depth
            v = (r[1, 0] * x + r[1, 1] * y + r[1, 2] * z + cy) / depth
            left, right, top, bottom = min(left, u), max(right, u), min(top, v), max(bottom, v)
            near, far = min(near, depth), max(far, depth)
            lowest = min(lowest, up_x * x + up_y * y + up_z * z + height)
        extents[part] = left, top, right, bottom
        ranges[part] = near, far, lowest
    return extents, ranges


@njit(cache=True, nogil=True)
def _gather(
    extents: FloatArray, ranges: FloatArray, ends: IntArray, intrinsics: tuple[float, float, float, float]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`(B, 4)` boxes [px], `(B, 2)` depth ranges and `(B,)` lowest heights of bodies from those of their parts."""
    fx, fy, cx, cy = intrinsics
    boxes = np.full((len(ends) - 1, 4), np.nan)
    depths, lowest = np.empty((len(boxes), 2)), np.empty(len(boxes))
    for body in range(len(boxes)):
        parts = slice(ends[body], ends[body + 1])
        depths[body] = ranges[parts, 0].min(), ranges[parts, 1].max()
        lowest[body] = ranges[parts, 2].min()
        left, top, right, bottom = np.inf, np.inf, -np.inf, -np.inf
        for part in range(ends[body], ends[body + 1]):
            if not np.isnan(extents[part, 0]):
                left, top = min(left, extents[part, 0]), min(top, extents[part, 1])
                right, bottom = max(right, extents[part, 2]), max(bottom, extents[part, 3])
        if left <= right:
            x, y = left * fx + cx, top * fy + cy
            boxes[body] = x, y, right * fx + cx - x, bottom * fy + cy - y
    return boxes, depths, lowest
