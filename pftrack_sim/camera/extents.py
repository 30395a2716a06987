"""Amodal boxes and outlines of bodies from the vertices of their parts, without rendering.

Every part is the convex hull of its vertices, so its extent is that of the projected vertices. What lies nearer than
the near plane is cut off, as in the rendered image. Extents are the smallest x/z, y/z and the largest x/z, y/z in
camera axes; NaN where nothing is left.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray

CORNERS: FloatArray = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
"""`(8, 3)` corners of the box with half sizes 1."""
CORNERS.setflags(write=False)

_CHORD = np.arange(3) / 3.0  # Positions of outline points along the chord from one farthest vertex to the next

_ANGLES = 2.0 * np.pi * np.arange(24) / 24
_DIRECTIONS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])
"""`(2, 24)` directions in which the farthest vertices of an outline are found."""

_STACK_STEP = 64  # Parts whose vertices fill equally many runs of this length are projected together


class Bodies:
    """The S parts of B bodies, stored so that all boxes come from a few array operations.

    Args:
        bodies: `(V, 3)` vertices of each body's parts [m], in the frame of the part; at least one part per body.

    Raises:
        ParameterError: A body without parts, or a part without vertices.
    """

    def __init__(self, bodies: Sequence[Sequence[FloatArray]]) -> None:
        for index, parts in enumerate(bodies):
            if not parts:
                raise ParameterError(f"body {index} has no parts to project")
            for vertices in parts:
                if vertices.ndim != 2 or vertices.shape[0] < 1 or vertices.shape[1] != 3:
                    raise ParameterError(f"a part needs vertices of shape (V, 3), V >= 1, got {vertices.shape}")
        counts = np.array([len(parts) for parts in bodies], dtype=np.intp)
        self.starts = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.intp)
        """`(B,)` index of each body's first part."""
        self.vertices = [np.array(vertices, dtype=np.float64) for parts in bodies for vertices in parts]
        # Parts of similar size: indices (G,), vertices (G, V, 3), and these as (G, 3, V).
        self._stacks = _stack(self.vertices)
        self._transposed = [(parts, np.ascontiguousarray(v.transpose(0, 2, 1))) for parts, v in self._stacks]

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
        extents = np.empty((len(self.vertices), 4))
        depths = np.empty((len(self.vertices), 2))
        with np.errstate(divide="ignore", invalid="ignore"):
            for parts, vertices in self._transposed:
                local = axes[parts] @ vertices
                local += centres[parts][:, :, None]
                depth, coordinates = local[:, 2], local[:, :2]
                depths[parts, 0], depths[parts, 1] = depth.min(axis=1), depth.max(axis=1)
                coordinates /= depth[:, None]
                extents[parts, :2], extents[parts, 2:] = coordinates.min(axis=2), coordinates.max(axis=2)
        for part in np.flatnonzero(depths[:, 0] < near_m):
            beyond = depths[part, 1] >= near_m
            local = self.vertices[part] @ axes[part].T + centres[part]
            extents[part] = extent_beyond(local, near_m) if beyond else np.nan
        return extents, depths

    def lowest(self, positions: ArrayLike, rotations: ArrayLike) -> FloatArray:
        """`(B,)` height of each body's lowest point [m], with the first two arguments of `boxes`."""
        centres, axes = np.asarray(positions, dtype=np.float64), np.asarray(rotations, dtype=np.float64)
        lowest = np.empty(len(self.vertices))
        for parts, vertices in self._transposed:
            lowest[parts] = centres[parts, 2] + (axes[parts, 2:] @ vertices)[:, 0].min(axis=1)
        return np.minimum.reduceat(lowest, self.starts)

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
