"""Convex shapes that bodies consist of, and points on their surfaces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray, IntArray

Kind: TypeAlias = Literal["ellipsoid", "capsule", "cylinder", "hull"]

CORNERS: FloatArray = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
"""`(8, 3)` corners of the box with half sizes 1."""
CORNERS.setflags(write=False)

_GROUP_STEP = 64
"""Point sets that fill equally many runs of this length are stacked together."""

_RIM_POINTS = 96
"""Points per rim of a cylinder: 0.05 % of the radius short of the circle."""

_SPHERE_POINTS = 300


@dataclass(frozen=True)
class Shape:
    """A convex shape in its own frame.

    Attributes:
        kind: Meaning of `size` and `points`.
        size: `(3,)` [m]: semi-axes of an ellipsoid; radius and half length along z of a capsule (between the centres of
            its end spheres) or cylinder; unused for a hull.
        points: `(V, 3)` vertices of a hull [m]; None otherwise.
    """

    kind: Kind
    size: tuple[float, float, float] = (0.0, 0.0, 0.0)
    points: FloatArray | None = None

    @property
    def ellipsoids(self) -> list[tuple[float, tuple[float, float, float]]]:
        """Ellipsoids whose convex hull is the shape: offset along z and semi-axes [m]; none for a hull."""
        a, b, c = self.size
        match self.kind:
            case "ellipsoid":
                return [(0.0, (a, b, c))]
            case "capsule":
                return [(-b, (a, a, a)), (b, (a, a, a))]
            case "cylinder":
                return [(-b, (a, a, 0.0)), (b, (a, a, 0.0))]
            case "hull":
                return []

    def surface_points(self) -> FloatArray:
        """`(V, 3)` points [m] whose convex hull is approximately the shape."""
        a, b, c = self.size
        match self.kind:
            case "ellipsoid":
                return _unit_sphere() * (a, b, c)
            case "capsule":
                sphere_points, end = a * _unit_sphere(), np.array([0.0, 0.0, b])
                return np.concatenate([sphere_points - end, sphere_points + end])
            case "cylinder":
                angles = np.linspace(0.0, 2.0 * np.pi, _RIM_POINTS, endpoint=False)
                rim = np.column_stack([a * np.cos(angles), a * np.sin(angles), np.full(_RIM_POINTS, b)])
                return np.concatenate([rim, rim * (1.0, 1.0, -1.0)])
            case "hull":
                assert self.points is not None
                return self.points


def sphere(radius_m: float) -> Shape:
    """A sphere around the origin."""
    return Shape("ellipsoid", (radius_m, radius_m, radius_m))


def ellipsoid(semi_axes_m: ArrayLike) -> Shape:
    """An ellipsoid around the origin with `(3,)` semi-axes."""
    a, b, c = (float(v) for v in np.asarray(semi_axes_m))
    return Shape("ellipsoid", (a, b, c))


def capsule(radius_m: float, half_length_m: float) -> Shape:
    """A capsule along z; the half length reaches from its middle to the centre of each end sphere."""
    return Shape("capsule", (radius_m, half_length_m, 0.0))


def cylinder(radius_m: float, half_length_m: float) -> Shape:
    """A cylinder along z."""
    return Shape("cylinder", (radius_m, half_length_m, 0.0))


def cuboid(half_sizes_m: ArrayLike) -> Shape:
    """A box around the origin with `(3,)` half sizes."""
    return hull(CORNERS * np.asarray(half_sizes_m, dtype=np.float64))


def hull(points: ArrayLike) -> Shape:
    """The convex hull of `(V, 3)` vertices, V >= 1.

    Raises:
        ParameterError: No vertices, or vertices without three coordinates.
    """
    vertices = np.array(points, dtype=np.float64)
    if vertices.ndim != 2 or vertices.shape[0] < 1 or vertices.shape[1] != 3:
        raise ParameterError(f"a hull needs vertices of shape (V, 3), V >= 1, got {vertices.shape}")
    vertices.setflags(write=False)
    return Shape("hull", points=vertices)


def stack_points(point_sets: Mapping[int, FloatArray]) -> list[tuple[IntArray, FloatArray]]:
    """Stack point sets of similar length: keys `(G,)` and points `(G, V, 3)`, short sets repeated to length V."""
    groups: dict[int, list[int]] = {}
    for key, points in point_sets.items():
        groups.setdefault(-(-len(points) // _GROUP_STEP), []).append(key)
    stacks: list[tuple[IntArray, FloatArray]] = []
    for keys in groups.values():
        longest = np.arange(max(len(point_sets[key]) for key in keys))
        stacks.append(
            (np.array(keys, dtype=np.intp), np.stack([point_sets[key][longest % len(point_sets[key])] for key in keys]))
        )
    return stacks


def _unit_sphere() -> FloatArray:
    """Points spread evenly over the unit sphere (Fibonacci spiral)."""
    index = np.arange(_SPHERE_POINTS)
    height = 1.0 - (2.0 * index + 1.0) / _SPHERE_POINTS
    angle = index * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - height * height)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
