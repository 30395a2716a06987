"""Silhouettes without images: those of `SilhouetteFinder`, computed by kernels."""

from __future__ import annotations

from collections.abc import Container, Sequence

import mujoco
import numpy as np

from pftrack_sim.camera.extents import Bodies
from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.core.types import FloatArray, IntArray
from pftrack_sim.render.backend import PixelRect, Renderer
from pftrack_sim.render.cpu.id_rasteriser import IdRasteriser
from pftrack_sim.render.cpu.kernels import silhouettes
from pftrack_sim.render.culling import GROUND_CONTACT_M
from pftrack_sim.truth.silhouettes import Measured, Silhouette, SilhouetteFinder


class GeometricFinder(SilhouetteFinder):
    """Finds people person by person: it costs by the triangles of those in view and of what may occlude them."""

    def __init__(
        self,
        model: mujoco.MjModel,
        renderer: Renderer,
        geoms: Sequence[IntArray],
        bodies: Bodies,
        boxed: Sequence[IntArray] = (),
    ) -> None:
        super().__init__(model, renderer, geoms, bodies, boxed)
        assert isinstance(renderer, IdRasteriser)
        self.batches = [range(1), range(1, len(geoms))]
        # Those of this model: what is found later may be asked for after the renderer has the next one.
        self._shapes = renderer.shapes
        drawn = renderer.visible_geoms
        self._own, self._own_ends = _joined([np.flatnonzero(drawn & mask[:-1]) for mask in self._masks])
        self._foreign, self._foreign_ends = _joined([np.flatnonzero(drawn & ~mask[:-1]) for mask in self._masks])

    def find(
        self,
        data: mujoco.MjData,
        T_world_camera: FloatArray,
        K: FloatArray,
        measured: Measured,
        people: Container[int] | None = None,
    ) -> dict[int, Silhouette]:
        """See `SilhouetteFinder.find`."""
        renderer, (triangles, projected) = self.renderer, self._shapes
        positions, rotations = data.geom_xpos, data.geom_xmat.reshape(-1, 3, 3)
        boxes, depths, lowest = measured
        wanted = np.array([people is None or person in people for person in range(self.people_count)])
        # Soles penetrate the ground a little without being occluded by it, as in `Bounds.may_occlude`.
        from_above = T_world_camera[2, 3] > lowest
        above_m = np.where(from_above, lowest + GROUND_CONTACT_M, -np.inf)
        rects, ends, amodal, visible, top = silhouettes(
            wanted, boxes, depths[:, 1], above_m, self._own, self._own_ends, self._foreign, self._foreign_ends,
            projected, triangles, positions, rotations, T_world_camera, focal_and_centre(K),
            (renderer.width_px, renderer.height_px), renderer.near_m,
        )  # fmt: skip
        found: dict[int, Silhouette] = {}
        for person, (start, end) in enumerate(ends.tolist()):
            if end > start:
                rect = PixelRect(*rects[person].tolist())
                shape, pixels = (rect.height, rect.width), slice(start, end)
                masks = amodal[pixels].reshape(shape), visible[pixels].reshape(shape)
                found[person] = Silhouette(rect, *masks, top[pixels].reshape(shape))
        return found


def _joined(lists: Sequence[IntArray]) -> tuple[IntArray, IntArray]:
    """Lists behind one another, and the `(N + 1,)` places where they begin and end."""
    return np.concatenate(lists), np.cumsum([0, *(len(one) for one in lists)]).astype(np.intp)
