"""Points around the outlines of bodies, for cameras that bend straight lines or read row by row.

`extents` gives a body's box through a pinhole exactly. Through a lens, and with every row at its own time, the box is
the extent of the outline's points, each sent its own way. Points are taken where each part reaches farthest in a ring
of directions, and on the chords between these, since a long straight edge may bulge between its ends.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.extents import Shape

Array = NDArray[np.float64]

DIRECTIONS = 24
"""In which each part's farthest points are found."""

_CHORD = np.arange(3) / 3.0
"""Places on the chord from one farthest point to the next."""

POINTS = DIRECTIONS * len(_CHORD)
"""Points per part."""

_SURFACE_POINTS = 300
"""Points on an ellipsoid."""

_GROUP_STEP = 64


class Outlines:
    """Outline points of the parts of several bodies.

    Args:
        shapes: One for each part.
    """

    def __init__(self, shapes: Sequence[Shape]) -> None:
        clouds = [_surface(shape) for shape in shapes]
        groups: dict[int, list[int]] = {}
        for index, cloud in enumerate(clouds):
            groups.setdefault(-(-len(cloud) // _GROUP_STEP), []).append(index)
        self._count = len(shapes)
        self._groups: list[tuple[NDArray[np.intp], Array]] = []
        for indices in groups.values():
            longest = max(len(clouds[index]) for index in indices)
            # Short clouds are filled up with their first point.
            filled = [clouds[index][np.arange(longest) % len(clouds[index])] for index in indices]
            self._groups.append((np.array(indices, dtype=np.intp), np.stack(filled)))
        angles = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        self._directions = np.stack([np.cos(angles), np.sin(angles)])

    def find(
        self, positions: Array, rotations: Array, T_world_camera: Array, near_m: float, wanted: NDArray[np.bool_]
    ) -> Array:
        """Where the parts' outlines are, seen from a camera.

        Args:
            positions: `(S, 3)` of every part [m], world frame.
            rotations: `(S, 3, 3)` of every part; maps its own axes to the world's.
            T_world_camera: `(4, 4)` camera pose.
            near_m: Depth below which nothing is seen.
            wanted: `(S,)` which parts are asked for.

        Returns:
            `(N, POINTS, 3)` points in the own axes of each part that is asked for [m]. Of a part that the near plane
            cuts, points behind the plane may be among them.
        """
        turn, eye = T_world_camera[:3, :3], T_world_camera[:3, 3]
        found = np.empty((self._count, POINTS, 3))
        for every, clouds in self._groups:
            asked = wanted[every]
            parts, points = every[asked], clouds[asked]
            local = points @ (turn.T @ rotations[parts]).transpose(0, 2, 1)
            local += ((positions[parts] - eye) @ turn)[:, None]
            depth = np.maximum(local[..., 2:], near_m)
            reach = (local[..., :2] / depth) @ self._directions
            farthest = points[np.arange(len(parts))[:, None], reach.argmax(axis=1)]
            following = np.roll(farthest, -1, axis=1)
            chords = farthest[:, :, None] + _CHORD[:, None] * (following - farthest)[:, :, None]
            found[parts] = chords.reshape(len(parts), POINTS, 3)
        return found[wanted]


def _surface(shape: Shape) -> Array:
    """`(V, 3)` points whose hull is the shape, or nearly so."""
    a, b, c = shape.size
    match shape.kind:
        case "ellipsoid":
            return _ball() * (a, b, c)
        case "capsule":
            ball, end = a * _ball(), np.array([0.0, 0.0, b])
            return np.concatenate([ball - end, ball + end])
        case "cylinder":
            angles = np.linspace(0.0, 2.0 * np.pi, 96, endpoint=False)
            rim = np.column_stack([a * np.cos(angles), a * np.sin(angles), np.full(96, b)])
            return np.concatenate([rim, rim * (1.0, 1.0, -1.0)])
        case "hull":
            assert shape.points is not None
            return shape.points


def _ball() -> Array:
    """Points spread evenly over the unit sphere: a Fibonacci spiral."""
    index = np.arange(_SURFACE_POINTS)
    height = 1.0 - (2.0 * index + 1.0) / _SURFACE_POINTS
    angle = index * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - height * height)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
