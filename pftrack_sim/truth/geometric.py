"""Boxes and silhouettes without images: those of `Bodies` and `SilhouetteFinder`, computed by kernels."""

from __future__ import annotations

from collections.abc import Container, Sequence

import mujoco
import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from pftrack_sim.camera.extents import Bodies, extent_beyond
from pftrack_sim.core.types import FloatArray, IntArray
from pftrack_sim.render.backend import Renderer, Segmentation
from pftrack_sim.render.cpu.id_rasteriser import IdRasteriser
from pftrack_sim.render.culling import GROUND_CONTACT_M
from pftrack_sim.truth.silhouettes import Silhouette, SilhouetteFinder, pixels_around


class GeometricBodies(Bodies):
    """`Bodies` whose extents are equal up to rounding, and cost a fifth."""

    def __init__(self, bodies: Sequence[Sequence[FloatArray]]) -> None:
        super().__init__(bodies)
        self._flat = np.concatenate(self.vertices)
        self._first = np.cumsum([0, *(len(vertices) for vertices in self.vertices)]).astype(np.intp)

    def extents(
        self, positions: ArrayLike, rotations: ArrayLike, T_world_camera: ArrayLike, near_m: float
    ) -> tuple[FloatArray, FloatArray]:
        """See `Bodies.extents`."""
        pose = np.asarray(T_world_camera, dtype=np.float64)
        centres = (np.asarray(positions, dtype=np.float64) - pose[:3, 3]) @ pose[:3, :3]
        axes = pose[:3, :3].T @ np.asarray(rotations, dtype=np.float64)
        extents, depths = _project(self._flat, self._first, centres, axes)
        for part in np.flatnonzero(depths[:, 0] < near_m):
            beyond = depths[part, 1] >= near_m
            local = self.vertices[part] @ axes[part].T + centres[part]
            extents[part] = extent_beyond(local, near_m) if beyond else np.nan
        return extents, depths

    def lowest(self, positions: ArrayLike, rotations: ArrayLike) -> FloatArray:
        """See `Bodies.lowest`."""
        centres, axes = np.asarray(positions, dtype=np.float64), np.asarray(rotations, dtype=np.float64)
        _, depths = _project(self._flat, self._first, centres, axes)
        return np.minimum.reduceat(depths[:, 0], self.starts)


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
        super().__init__(model, renderer, geoms, GeometricBodies(bodies), boxed)
        assert isinstance(renderer, IdRasteriser)
        self._rasteriser = renderer
        drawn = renderer.visible_geoms
        self._others = [np.flatnonzero(drawn & ~mask[:-1]) for mask in self._masks]

    def find(
        self, data: mujoco.MjData, T_world_camera: FloatArray, K: FloatArray, people: Container[int] | None = None
    ) -> tuple[FloatArray, dict[int, Silhouette]]:
        """See `SilhouetteFinder.find`."""
        renderer, poses = self._rasteriser, self.poses(data)
        boxes, depths = self.bodies.boxes(*poses, T_world_camera, K, renderer.near_m)
        lowest = self.bodies.lowest(*poses)
        size = renderer.width_px, renderer.height_px
        found: dict[int, Silhouette] = {}
        for person, box in enumerate(boxes[: self.people_count]):
            rect = pixels_around(box, size)
            if rect is None or (people is not None and person not in people):
                continue
            alone = renderer.ids(data, T_world_camera, K, geoms=self._masks[person, :-1], rect=rect)
            amodal = alone.ids >= 0
            if not amodal.any():
                continue
            layers = Segmentation(rect, alone.ids.copy(), alone.inverse_depth)
            # Soles penetrate the ground a little without being occluded by it, as in `Bounds.may_occlude`.
            from_above = T_world_camera[2, 3] > lowest[person]
            renderer.draw_into(
                layers,
                data,
                T_world_camera,
                K,
                self._others[person],
                farthest_m=float(depths[person, 1]),
                above_m=float(lowest[person]) + GROUND_CONTACT_M if from_above else -np.inf,
            )
            found[person] = Silhouette(rect, amodal, amodal & (layers.ids == alone.ids), layers.ids)
        return boxes, found


@njit(cache=True, nogil=True, error_model="numpy")
def _project(
    vertices: FloatArray, first: IntArray, centres: FloatArray, axes: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """`(S, 4)` extents and `(S, 2)` depth ranges of parts, as if all lay in front of the camera."""
    extents, depths = np.empty((len(centres), 4)), np.empty((len(centres), 2))
    for part in range(len(centres)):
        r, (cx, cy, cz) = axes[part], centres[part]
        left, top, right, bottom, near, far = np.inf, np.inf, -np.inf, -np.inf, np.inf, -np.inf
        for index in range(first[part], first[part + 1]):
            x, y, z = vertices[index, 0], vertices[index, 1], vertices[index, 2]
            depth = r[2, 0] * x + r[2, 1] * y + r[2, 2] * z + cz
            u = (r[0, 0] * x + r[0, 1] * y + r[0, 2] * z + cx) / depth
            v = (r[1, 0] * x + r[1, 1] * y + r[1, 2] * z + cy) / depth
            left, right, top, bottom = min(left, u), max(right, u), min(top, v), max(bottom, v)
            near, far = min(near, depth), max(far, depth)
        extents[part] = left, top, right, bottom
        depths[part] = near, far
    return extents, depths
