"""Amodal boxes and outlines of bodies from the vertices of their parts, without rendering.

Every part is the convex hull of its vertices, so its extent is that of the projected vertices. What lies nearer than
the near plane is cut off, as in the rendered image. Extents are the smallest x/z, y/z and the largest x/z, y/z in
camera axes; NaN where nothing is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.camera.pinhole import Intrinsics, focal_and_centre
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray

CORNERS: FloatArray = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
"""`(8, 3)` corners of the box with half sizes 1."""
CORNERS.setflags(write=False)

_CHORD = np.arange(3) / 3.0  # Positions of outline points along the chord from one farthest vertex to the next

_ANGLES = 2.0 * np.pi * np.arange(24) / 24
_DIRECTIONS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])
"""`(2, 24)` directions in which the farthest vertices of an outline are found."""

_STACK_STEP = 64  # Outlines of parts whose vertices fill equally many runs of this length are found together


class Bodies:
    """The S parts of B bodies, stored so that all boxes come from one kernel.

    Args:
        bodies: `(V, 3)` vertices of each body's parts [m], in the frame of the part; at least one part per body.
        fused: Whether the kernel adds products unrounded; results differ by rounding.

    Raises:
        ParameterError: A body without parts, or a part without vertices.
    """

    def __init__(self, bodies: Sequence[Sequence[FloatArray]], *, fused: bool = True) -> None:
        for index, parts in enumerate(bodies):
            if not parts:
                raise ParameterError(f"body {index} has no parts to project")
            for vertices in parts:
                if vertices.ndim != 2 or vertices.shape[0] < 1 or vertices.shape[1] != 3:
                    raise ParameterError(f"a part needs vertices of shape (V, 3), V >= 1, got {vertices.shape}")
        self._ends = np.cumsum([0, *(len(parts) for parts in bodies)]).astype(np.intp)
        self.starts = self._ends[:-1]
        """`(B,)` index of each body's first part."""
        self.vertices = [np.array(vertices, dtype=np.float64) for parts in bodies for vertices in parts]
        self._joined = np.concatenate(self.vertices)
        self._first = np.cumsum([0, *(len(vertices) for vertices in self.vertices)]).astype(np.intp)
        self._fused = fused

    def boxes(
        self, positions: ArrayLike, rotations: ArrayLike, T_world_camera: ArrayLike, K: ArrayLike, near_m: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Amodal boxes, depth ranges and lowest heights of all bodies.

        Args:
            positions: `(S, 3)` of the parts [m], world frame.
            rotations: `(S, 3, 3)` from the frame of each part to the world frame.
            T_world_camera: `(4, 4)` camera pose.
            K: `(3, 3)` camera matrix [px].
            near_m: Distance of the near plane.

        Returns:
            `(B, 4)` boxes x, y, w, h [px], not clipped to the image, NaN for a body behind the near plane; `(B, 2)`
            smallest and largest depth of each body [m]; `(B,)` height of its lowest point [m].
        """
        from pftrack_sim.camera.extents_kernels import gather_bodies  # numba: imported when it is used

        extents, ranges = self.extents(positions, rotations, T_world_camera, near_m)
        return gather_bodies(extents, ranges, self._ends, focal_and_centre(K))

    def boxes_in_scene(
        self,
        geoms: IntArray,
        positions: FloatArray,
        rotations: FloatArray,
        T_world_camera: FloatArray,
        intrinsics: Intrinsics,
        near_m: float,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """`boxes` of parts that are geoms of a scene, equal to the bit and in less time.

        Args:
            geoms: `(S,)` ids of the parts.
            positions: `(ngeom, 3)` of all geoms [m].
            rotations: `(ngeom, 9)` of all geoms.
            T_world_camera: `(4, 4)` camera pose.
            intrinsics: Focal lengths fx, fy and principal point cx, cy [px].
            near_m: Distance of the near plane.
        """
        from pftrack_sim.camera.extents_kernels import gather_bodies, measure_bodies  # numba: imported when it is used

        *found, cut = measure_bodies(
            self._joined, self._first, self._ends, geoms, positions, rotations, T_world_camera, intrinsics, near_m,
            self._fused,
        )  # fmt: skip
        if cut:
            parts = positions[geoms], rotations[geoms].reshape(-1, 3, 3)
            return gather_bodies(*self.extents(*parts, T_world_camera, near_m), self._ends, intrinsics)
        boxes, depths, lowest = found
        return boxes, depths, lowest

    def some(self, bodies: Sequence[int]) -> Bodies:
        """Some of the bodies, by their indices."""
        starts, ends = self._ends[:-1].tolist(), self._ends[1:].tolist()
        return Bodies([self.vertices[starts[body] : ends[body]] for body in bodies], fused=self._fused)

    def extents(
        self, positions: ArrayLike, rotations: ArrayLike, T_world_camera: ArrayLike, near_m: float
    ) -> tuple[FloatArray, FloatArray]:
        """`(S, 4)` extents in normalized image coordinates, and `(S, 3)` depth ranges and lowest heights [m] of parts.

        The arguments are those of `boxes`.

        Raises:
            ParameterError: `near_m` is not positive.
        """
        from pftrack_sim.camera.extents_kernels import project_parts  # numba: imported when it is used

        if not near_m > 0.0:
            raise ParameterError(f"near_m must be > 0, got {near_m}")
        pose, places = np.asarray(T_world_camera, dtype=np.float64), np.asarray(positions, dtype=np.float64)
        turned = np.asarray(rotations, dtype=np.float64)
        centres, axes = (places - pose[:3, 3]) @ pose[:3, :3], pose[:3, :3].T @ turned
        extents, ranges = project_parts(self._joined, self._first, centres, axes, places, turned, self._fused)
        for part in np.flatnonzero(ranges[:, 0] < near_m):
            beyond = ranges[part, 1] >= near_m
            local = self.vertices[part] @ axes[part].T + centres[part]
            extents[part] = extent_beyond(local, near_m) if beyond else np.nan
        return extents, ranges

    @cached_property
    def _stacks(self) -> list[tuple[IntArray, FloatArray]]:
        return _stack(self.vertices)

    def outlines(
        self, positions: FloatArray, rotations: FloatArray, T_world_camera: FloatArray, near_m: float, wanted: BoolArray
    ) -> FloatArray:
        """Outline points of parts, which a camera with lens distortion or rolling shutter projects one by one.

        They are the farthest vertices in a ring of directions and points on the chords between these, as a long
        straight edge may bulge between its ends. Arguments are those of `boxes` and `(S,)` which parts to find.

        Returns:
            `(N, 72, 3)` points [m] in the frames of the N wanted parts. Those of a part that the near plane cuts may
            lie behind the plane.
        """
        R_world_camera, camera = T_world_camera[:3, :3], T_world_camera[:3, 3]
        outlines = np.empty((len(wanted), len(_ANGLES) * len(_CHORD), 3))
        for indices, stacked in self._stacks:
            kept = wanted[indices]
            parts, points = indices[kept], stacked[kept]
            local = points @ (R_world_camera.T @ rotations[parts]).transpose(0, 2, 1)
            local += ((positions[parts] - camera) @ R_world_camera)[:, None]
            reach = (local[..., :2] / np.maximum(local[..., 2:], near_m)) @ _DIRECTIONS
            farthest = points[np.arange(len(parts))[:, None], reach.argmax(axis=1)]
            steps = np.roll(farthest, -1, axis=1) - farthest
            chords = farthest[:, :, None] + _CHORD[:, None] * steps[:, :, None]
            # Sizes are named, since a stack may have no wanted part.
            outlines[parts] = chords.reshape(len(parts), outlines.shape[1], 3)
        return outlines[wanted]


def _stack(vertices: Sequence[FloatArray]) -> list[tuple[IntArray, FloatArray]]:
    """Stack parts of similar size, with vertices repeated up to the largest number."""
    groups: dict[int, list[int]] = {}
    for part, points in enumerate(vertices):
        groups.setdefault(-(-len(points) // _STACK_STEP), []).append(part)
    stacks: list[tuple[IntArray, FloatArray]] = []
    for parts in groups.values():
        index = np.arange(max(len(vertices[part]) for part in parts))
        stacked = np.stack([vertices[part][index % len(vertices[part])] for part in parts])
        stacks.append((np.array(parts, dtype=np.intp), stacked))
    return stacks


def extent_beyond(points: FloatArray, near_m: float) -> FloatArray:
    """`(4,)` extent of the part of a hull of `(V, 3)` points [m] in camera axes, one at least, beyond the near plane.

    The section with the plane is the hull of its intersections with the segments between vertices on either side.
    """
    ahead, behind = points[points[:, 2] >= near_m], points[points[:, 2] < near_m]
    share = (ahead[:, None, 2] - near_m) / (ahead[:, None, 2] - behind[None, :, 2])
    section = ahead[:, None, :2] + share[..., None] * (behind[None, :, :2] - ahead[:, None, :2])
    coordinates = np.concatenate([ahead[:, :2] / ahead[:, 2:], section.reshape(-1, 2) / near_m])
    return np.concatenate([coordinates.min(axis=0), coordinates.max(axis=0)])
