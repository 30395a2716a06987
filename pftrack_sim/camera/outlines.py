"""Outline points of shapes, for cameras with lens distortion or rolling shutter.

`extents` gives the box of a body through a pinhole exactly. With distortion or a rolling shutter, the box is the extent
of outline points that are projected one by one. They are the farthest points of each shape in a ring of directions and
points on the chords between these, as a long straight edge may bulge between its ends.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pftrack_sim.camera.shapes import Shape, stack_points
from pftrack_sim.core.types import BoolArray, FloatArray

_DIRECTIONS = 24
"""Directions in which the farthest points of each shape are found."""

_CHORD = np.arange(3) / 3.0
"""Positions along the chord from one farthest point to the next."""

_POINTS = _DIRECTIONS * len(_CHORD)


class Outlines:
    """Outline points of several shapes.

    Args:
        shapes: S shapes.
    """

    def __init__(self, shapes: Sequence[Shape]) -> None:
        self._count = len(shapes)
        self._stacks = stack_points({index: shape.surface_points() for index, shape in enumerate(shapes)})
        angles = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
        self._directions = np.stack([np.cos(angles), np.sin(angles)])

    def find(
        self, positions: FloatArray, rotations: FloatArray, T_world_camera: FloatArray, near_m: float, wanted: BoolArray
    ) -> FloatArray:
        """Find the outlines of shapes as seen from a camera.

        Args:
            positions: `(S, 3)` of the shapes [m], world frame.
            rotations: `(S, 3, 3)` from the frame of each shape to the world frame.
            T_world_camera: `(4, 4)` camera pose.
            near_m: Distance of the near plane.
            wanted: `(S,)` which shapes to find.

        Returns:
            `(N, 72, 3)` points [m] in the frames of the N wanted shapes. Points of a shape that the near plane cuts
            may lie behind the plane.
        """
        R_world_camera, camera = T_world_camera[:3, :3], T_world_camera[:3, 3]
        outlines = np.empty((self._count, _POINTS, 3))
        for indices, stacked in self._stacks:
            kept = wanted[indices]
            shapes, points = indices[kept], stacked[kept]
            local = points @ (R_world_camera.T @ rotations[shapes]).transpose(0, 2, 1)
            local += ((positions[shapes] - camera) @ R_world_camera)[:, None]
            depth = np.maximum(local[..., 2:], near_m)
            reach = (local[..., :2] / depth) @ self._directions
            farthest = points[np.arange(len(shapes))[:, None], reach.argmax(axis=1)]
            following = np.roll(farthest, -1, axis=1)
            chords = farthest[:, :, None] + _CHORD[:, None] * (following - farthest)[:, :, None]
            outlines[shapes] = chords.reshape(len(shapes), _POINTS, 3)
        return outlines[wanted]
