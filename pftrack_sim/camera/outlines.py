"""Outline points of bodies, for cameras with lens distortion or rolling shutter.

With distortion or a rolling shutter, the box of a body is the extent of outline points that are projected one by one.
They are the farthest vertices of each part in a ring of directions and points on the chords between these, as a long
straight edge may bulge between its ends.
"""

from __future__ import annotations

import numpy as np

from pftrack_sim.camera.extents import Bodies
from pftrack_sim.core.types import BoolArray, FloatArray

_CHORD = np.arange(3) / 3.0
"""Positions along the chord from one farthest vertex to the next."""

_ANGLES = 2.0 * np.pi * np.arange(24) / 24
_DIRECTIONS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])
"""`(2, 24)` directions in which the farthest vertices are found."""

_POINTS = len(_ANGLES) * len(_CHORD)


def outline_points(
    bodies: Bodies,
    positions: FloatArray,
    rotations: FloatArray,
    T_world_camera: FloatArray,
    near_m: float,
    wanted: BoolArray,
) -> FloatArray:
    """Find the outlines of parts as seen from a camera.

    Args:
        bodies: Bodies with S parts.
        positions: `(S, 3)` of the parts [m], world frame.
        rotations: `(S, 3, 3)` from the frame of each part to the world frame.
        T_world_camera: `(4, 4)` camera pose.
        near_m: Distance of the near plane.
        wanted: `(S,)` which parts to find.

    Returns:
        `(N, 72, 3)` points [m] in the frames of the N wanted parts. Those of a part that the near plane cuts may lie
        behind the plane.
    """
    R_world_camera, camera = T_world_camera[:3, :3], T_world_camera[:3, 3]
    outlines = np.empty((len(wanted), _POINTS, 3))
    for indices, stacked in bodies.stacks:
        kept = wanted[indices]
        parts, points = indices[kept], stacked[kept]
        local = points @ (R_world_camera.T @ rotations[parts]).transpose(0, 2, 1)
        local += ((positions[parts] - camera) @ R_world_camera)[:, None]
        depth = np.maximum(local[..., 2:], near_m)
        reach = (local[..., :2] / depth) @ _DIRECTIONS
        farthest = points[np.arange(len(parts))[:, None], reach.argmax(axis=1)]
        following = np.roll(farthest, -1, axis=1)
        chords = farthest[:, :, None] + _CHORD[:, None] * (following - farthest)[:, :, None]
        outlines[parts] = chords.reshape(len(parts), _POINTS, 3)
    return outlines[wanted]
