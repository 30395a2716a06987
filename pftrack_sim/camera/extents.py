"""Amodal boxes of bodies in closed form, without rendering.

Every part of a body is convex: the hull of one or two ellipsoids (flat ones at the ends of a cylinder) or of vertices.
A vertical line x/z = t touches an ellipsoid with centre c and M = A A' (A: semi-axes as columns) where the plane
n = (1, 0, -t) is tangent, (n.c)^2 = n'Mn: a quadratic equation in t (projection of the dual quadric: Hartley and
Zisserman, Multiple View Geometry, 2nd ed., section 8.3). Horizontal lines y/z give the same equation.

What lies nearer than the near plane is cut off, as in the rendered image. Extents are the smallest x/z, y/z and the
largest x/z, y/z in camera axes; NaN where nothing is left.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.camera.near_plane import clipped_extent, tangents
from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.camera.shapes import Shape, stack_points
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray


class Bodies:
    """The S parts of B bodies, stored so that all boxes come from a few array operations.

    Args:
        bodies: Shapes of each body's parts, at least one per body.

    Raises:
        ParameterError: A body without parts.
    """

    def __init__(self, bodies: Sequence[Sequence[Shape]]) -> None:
        for index, parts in enumerate(bodies):
            if not parts:
                raise ParameterError(f"body {index} has no parts to project")
        self.shapes: tuple[Shape, ...] = tuple(shape for parts in bodies for shape in parts)
        counts = np.array([len(parts) for parts in bodies], dtype=np.intp)
        self.starts = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.intp)
        """`(B,)` index of each body's first part."""
        ellipsoids = [
            (part, offset, axes) for part, shape in enumerate(self.shapes) for offset, axes in shape.ellipsoids
        ]
        self._part = np.array([part for part, _, _ in ellipsoids], dtype=np.intp)
        self._offset = np.array([offset for _, offset, _ in ellipsoids], dtype=np.float64)
        self._semi_axes = np.array([axes for _, _, axes in ellipsoids], dtype=np.float64).reshape(-1, 3)
        hulls = {part: shape.points for part, shape in enumerate(self.shapes) if shape.points is not None}
        self._hulls = [(parts, np.ascontiguousarray(p.transpose(0, 2, 1))) for parts, p in stack_points(hulls)]

    def boxes(
        self, positions: ArrayLike, rotations: ArrayLike, T_world_camera: ArrayLike, K: ArrayLike, near_m: float
    ) -> tuple[FloatArray, FloatArray]:
        """Amodal boxes and depth ranges of all bodies.

        Args:
            positions: `(S, 3)` of the parts [m], world frame.
            rotations: `(S, 3, 3)` from the frame of each part to the world frame.
            T_world_camera: `(4, 4)` camera pose.
            K: `(3, 3)` camera matrix [px].
            near_m: Distance of the near plane.

        Returns:
            `(B, 4)` boxes x, y, w, h [px], not clipped to the image, NaN for a body behind the near plane; `(B, 2)`
            smallest and largest depth of each body [m].
        """
        fx, fy, cx, cy = focal_and_centre(K)
        extents, depths = self.extents(positions, rotations, T_world_camera, near_m)
        # fmin and fmax ignore the NaN of parts that are cut off completely.
        low = np.fmin.reduceat(extents[:, :2], self.starts) * (fx, fy) + (cx, cy)
        high = np.fmax.reduceat(extents[:, 2:], self.starts) * (fx, fy) + (cx, cy)
        nearest = np.minimum.reduceat(depths[:, 0], self.starts)
        farthest = np.maximum.reduceat(depths[:, 1], self.starts)
        return np.concatenate([low, high - low], axis=1), np.stack([nearest, farthest], axis=1)

    def extents(
        self, positions: ArrayLike, rotations: ArrayLike, T_world_camera: ArrayLike, near_m: float
    ) -> tuple[FloatArray, FloatArray]:
        """`(S, 4)` extents in normalized image coordinates and `(S, 2)` depth ranges [m] of all parts.

        The arguments are those of `boxes`.

        Raises:
            ParameterError: `near_m` is not positive.
        """
        if not near_m > 0.0:
            raise ParameterError(f"near_m must be > 0, got {near_m}")
        pose = np.asarray(T_world_camera, dtype=np.float64)
        centres = (np.asarray(positions, dtype=np.float64) - pose[:3, 3]) @ pose[:3, :3]
        axes = pose[:3, :3].T @ np.asarray(rotations, dtype=np.float64)
        extents = np.empty((len(self.shapes), 4))
        depths = np.empty((len(self.shapes), 2))
        if self._part.size:
            self._set_ellipsoids(centres, axes, extents, depths)
        for parts, vertices in self._hulls:
            local = axes[parts] @ vertices + centres[parts][:, :, None]
            depth = local[:, 2]
            depths[parts, 0], depths[parts, 1] = depth.min(axis=1), depth.max(axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):
                coordinates = local[:, :2] / depth[:, None]
            extents[parts, :2], extents[parts, 2:] = coordinates.min(axis=2), coordinates.max(axis=2)
        for part in np.flatnonzero(depths[:, 0] < near_m):
            beyond = depths[part, 1] >= near_m
            extents[part] = clipped_extent(self.shapes[part], centres[part], axes[part], near_m) if beyond else np.nan
        return extents, depths

    def lowest(self, positions: ArrayLike, rotations: ArrayLike) -> FloatArray:
        """`(B,)` height of each body's lowest point [m], with the first two arguments of `boxes`."""
        centres, axes = np.asarray(positions, dtype=np.float64), np.asarray(rotations, dtype=np.float64)
        lowest = np.full(len(self.shapes), np.inf)
        part = self._part
        if part.size:
            vertical = axes[part, 2]
            scaled = vertical * self._semi_axes
            bottom = centres[part, 2] + vertical[:, 2] * self._offset - np.sqrt(np.einsum("nk,nk->n", scaled, scaled))
            np.minimum.at(lowest, part, bottom)
        for parts, vertices in self._hulls:
            lowest[parts] = centres[parts, 2] + (axes[parts, 2:] @ vertices)[:, 0].min(axis=1)
        return np.minimum.reduceat(lowest, self.starts)

    def _set_ellipsoids(self, centres: FloatArray, axes: FloatArray, extents: FloatArray, depths: FloatArray) -> None:
        """Set extents and depths of the parts made of ellipsoids, as if the near plane cut none."""
        part_axes = axes[self._part]
        centre = centres[self._part] + part_axes[:, :, 2] * self._offset[:, None]
        scaled = part_axes * self._semi_axes[:, None, :]
        low, high = tangents(centre, scaled @ scaled.transpose(0, 2, 1))
        reach = np.sqrt(np.einsum("nk,nk->n", scaled[:, 2], scaled[:, 2]))
        # The ellipsoids of a part are consecutive: reduce each run of equal parts.
        starts = np.flatnonzero(np.diff(self._part, prepend=-1))
        parts = self._part[starts]
        extents[parts, :2] = np.minimum.reduceat(low, starts)
        extents[parts, 2:] = np.maximum.reduceat(high, starts)
        depths[parts, 0] = np.minimum.reduceat(centre[:, 2] - reach, starts)
        depths[parts, 1] = np.maximum.reduceat(centre[:, 2] + reach, starts)
