"""Extents in normalized image coordinates of shapes that the near plane cuts.

The extreme coordinates of the part of a convex shape beyond the plane lie on the surface of the shape, where a tangent
touches it beyond the plane, or on the section with the plane.
"""

from __future__ import annotations

import numpy as np

from pftrack_sim.camera.shapes import Shape
from pftrack_sim.core.types import FloatArray


def tangents(centres: FloatArray, M: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Normalized coordinates of the tangents to ellipsoids that are entirely in front of the camera.

    Args:
        centres: `(N, 3)` [m], camera axes.
        M: `(N, 3, 3)` A A' of the semi-axes A [m^2].

    Returns:
        `(N, 2)` smallest and `(N, 2)` largest x/z, y/z; NaN where there is no tangent.
    """
    z = centres[:, 2:]
    quadratic = z * z - M[:, 2, 2, None]
    half_linear = centres[:, :2] * z - M[:, :2, 2]
    constant = centres[:, :2] ** 2 - M[:, (0, 1), (0, 1)]
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(half_linear**2 - quadratic * constant)
        return (half_linear - root) / quadratic, (half_linear + root) / quadratic


def clipped_extent(shape: Shape, centre: FloatArray, axes: FloatArray, near_m: float) -> FloatArray:
    """`(4,)` smallest x/z, y/z and largest x/z, y/z of the part of a shape beyond the near plane.

    Args:
        shape: A shape that the plane cuts.
        centre: `(3,)` its origin [m], camera axes.
        axes: `(3, 3)` its axes in camera axes.
        near_m: Depth of the near plane.
    """
    a, b, c = shape.size
    if shape.kind == "ellipsoid":
        scaled = axes * (a, b, c)
        M = scaled @ scaled.T
        candidates = [_tangents_beyond(centre, M, near_m), _ellipsoid_section(centre, M, near_m)]
    elif shape.kind == "capsule":
        ends = [centre - b * axes[:, 2], centre + b * axes[:, 2]]
        M = a * a * np.eye(3)
        candidates = [*(_tangents_beyond(end, M, near_m) for end in ends), _capsule_section(*ends, a, near_m)]
    else:
        candidates = [_hull_beyond(shape.surface_points() @ axes.T + centre, near_m)]
    coordinates = np.concatenate(candidates)
    return np.concatenate([np.fmin.reduce(coordinates), np.fmax.reduce(coordinates)])


def _tangents_beyond(centre: FloatArray, M: FloatArray, near_m: float) -> FloatArray:
    """`(2, 2)` smallest and largest tangents of an ellipsoid; NaN where one does not touch beyond the plane."""
    coordinates = np.stack(tangents(centre[None], M[None]))[:, 0]
    for axis in (0, 1):
        for index in (0, 1):
            normal = np.zeros(3)
            normal[axis], normal[2] = 1.0, -coordinates[index, axis]
            direction = M @ normal
            square = float(normal @ direction)
            depth = centre[2] - direction[2] * float(normal @ centre) / square if square > 0.0 else centre[2]
            if not depth >= near_m:
                coordinates[index, axis] = np.nan
    return coordinates


def _ellipsoid_section(centre: FloatArray, M: FloatArray, near_m: float) -> FloatArray:
    """`(2, 2)` smallest and largest coordinates of the section of an ellipsoid with the plane; NaN without one."""
    step = near_m - centre[2]
    share = 1.0 - step * step / M[2, 2] if M[2, 2] > 0.0 else 0.0
    if not share >= 0.0:
        return np.full((2, 2), np.nan)
    lean = M[:2, 2] / M[2, 2] if M[2, 2] > 0.0 else np.zeros(2)
    middle = centre[:2] + lean * step
    half = np.sqrt(np.maximum(share * (M[(0, 1), (0, 1)] - lean * M[:2, 2]), 0.0))
    return np.stack([middle - half, middle + half]) / near_m


def _capsule_section(first: FloatArray, second: FloatArray, radius_m: float, near_m: float) -> FloatArray:
    """`(2, 2)` smallest and largest coordinates of the section of a capsule with the plane; NaN without one.

    A capsule is the union of spheres along its axis, each of which the plane cuts in a circle. The circle that reaches
    farthest along x is where the radius shrinks as fast as the centre advances.

    Args:
        first: `(3,)` centre of one end sphere [m], camera axes.
        second: `(3,)` centre of the other.
        radius_m: Radius.
        near_m: Depth of the plane.
    """
    direction = second - first
    section = np.full((2, 2), np.nan)
    for axis in (0, 1):
        across, along = direction[axis], direction[2]
        for index, sign in ((0, -1.0), (1, 1.0)):
            shares = [0.0, 1.0]
            if along != 0.0:
                offset = -sign * radius_m * across * np.sign(along) / np.hypot(across, along)
                shares.append(float(np.clip((near_m - offset - first[2]) / along, 0.0, 1.0)))
            reaches: list[float] = []
            for share in shares:
                centre = first + share * direction
                square = radius_m**2 - (near_m - centre[2]) ** 2
                if square >= 0.0:
                    reaches.append(float(centre[axis] + sign * np.sqrt(square)))
            if reaches:
                section[index, axis] = (max(reaches) if sign > 0 else min(reaches)) / near_m
    return section


def _hull_beyond(points: FloatArray, near_m: float) -> FloatArray:
    """`(2, 2)` smallest and largest coordinates of the part of a hull beyond the plane.

    The section with the plane is the hull of its intersections with the segments between vertices on either side.

    Args:
        points: `(V, 3)` vertices [m], camera axes; at least one beyond the plane.
        near_m: Depth of the plane.
    """
    ahead = points[points[:, 2] >= near_m]
    behind = points[points[:, 2] < near_m]
    share = (ahead[:, None, 2] - near_m) / (ahead[:, None, 2] - behind[None, :, 2])
    section = ahead[:, None, :2] + share[..., None] * (behind[None, :, :2] - ahead[:, None, :2])
    coordinates = np.concatenate([ahead[:, :2] / ahead[:, 2:], section.reshape(-1, 2) / near_m])
    return np.stack([coordinates.min(axis=0), coordinates.max(axis=0)])
