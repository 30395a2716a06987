"""Smooth closed surfaces from rings of points: the one kind of mesh that people are made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A triangle mesh.

    Attributes:
        vertices: `(V, 3)` [m].
        normals: `(V, 3)` unit, outward.
        pixels: `(V, 2)` column and row in the texture.
        faces: `(F, 3)` vertex numbers, counter-clockwise from outside.
    """

    vertices: Array
    normals: Array
    pixels: Array
    faces: NDArray[np.int32]


def angles(count: int) -> Array:
    """`(count,)` directions of a ring's points [rad]: from the back over the right side to the front (0) and on."""
    return -np.pi + 2.0 * np.pi * np.arange(count) / count


def ovals(rows: Array | Sequence[tuple[float, ...]], count: int, *, power: float = 2.0) -> Array:
    """Rings about the z axis.

    Args:
        rows: `(R, 6)`: z, x of the centre, y of the centre, reach to the front, to the back, and to either side [m].
        count: Points on a ring.
        power: Exponent of the superellipse: 2 is an ellipse, more is squarer.

    Returns:
        `(R, count, 3)` points.
    """
    table = np.asarray(rows, dtype=float)
    turn = angles(count)
    cos, sin = np.cos(turn), np.sin(turn)
    forward = np.sign(cos) * np.abs(cos) ** (2.0 / power)
    sideward = np.sign(sin) * np.abs(sin) ** (2.0 / power)
    reach = np.where(forward > 0.0, table[:, 3, None], table[:, 4, None])
    out = np.empty((len(table), count, 3))
    out[..., 0] = table[:, 1, None] + reach * forward
    out[..., 1] = table[:, 2, None] + table[:, 5, None] * sideward
    out[..., 2] = table[:, 0, None]
    return out


def tube(rings: Array, pixels: Array) -> TriangleMesh:
    """The surface through rings; a ring whose points coincide closes it with a pole.

    Args:
        rings: `(R, N, 3)` points [m].
        pixels: `(R, N + 1, 2)` texture pixels; the last column repeats the first point at the other end of the cloth.
    """
    row_count, count = rings.shape[:2]
    vertices = np.concatenate([rings, rings[:, :1]], axis=1)
    grid = np.arange(row_count * (count + 1)).reshape(row_count, count + 1)
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    flat = vertices.reshape(-1, 3)

    # Points that coincide (the seam, a pole) share one normal.
    pole = np.ptp(rings, axis=1).max(axis=1) < 1e-9
    shared = grid.copy()
    shared[:, -1] = shared[:, 0]
    shared[pole] = shared[pole, :1]
    welded = shared.reshape(-1)
    corners = welded[faces]
    keep = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    faces, corners = faces[keep], corners[keep]
    cross = np.cross(flat[corners[:, 1]] - flat[corners[:, 0]], flat[corners[:, 2]] - flat[corners[:, 0]])
    if float((flat[corners[:, 0]] * cross).sum()) < 0.0:
        faces, cross = faces[:, ::-1], -cross
    normals = np.zeros_like(flat)
    for corner in range(3):
        np.add.at(normals, corners[:, corner], cross)
    normals = normals[welded]
    length = np.sqrt((normals * normals).sum(axis=1, keepdims=True))
    normals = np.where(length > 1e-12, normals / np.maximum(length, 1e-12), (0.0, 0.0, 1.0))
    return TriangleMesh(flat, normals, pixels.reshape(-1, 2).astype(float), faces.astype(np.int32))


def around(rings: Array, pitch_m: float, centre_column: float) -> Array:
    """`(R, N + 1)` texture columns that follow the arc from the front.

    All rings share one girth, so that lines woven down the cloth run straight from ring to ring; poles are left out.
    """
    closed = np.concatenate([rings, rings[:, :1]], axis=1)
    step = np.sqrt((np.diff(closed, axis=1) ** 2).sum(axis=2))
    arc = np.concatenate([np.zeros((len(rings), 1)), np.cumsum(step, axis=1)], axis=1)
    girth = arc[:, -1:]
    share = np.where(girth > 1e-9, arc / np.maximum(girth, 1e-9), np.linspace(0.0, 1.0, arc.shape[1]))
    shared_girth = float(np.quantile(girth, 0.7))
    front = rings.shape[1] // 2
    return centre_column + (share - share[:, front : front + 1]) * shared_girth / pitch_m


def joined(shells: Sequence[TriangleMesh]) -> TriangleMesh:
    """Several shells as one mesh."""
    starts = np.cumsum([0, *(len(one.vertices) for one in shells[:-1])])
    return TriangleMesh(
        np.concatenate([one.vertices for one in shells]),
        np.concatenate([one.normals for one in shells]),
        np.concatenate([one.pixels for one in shells]),
        np.concatenate([one.faces + start for one, start in zip(shells, starts, strict=True)]).astype(np.int32),
    )


def mirrored(shell: TriangleMesh) -> TriangleMesh:
    """The same on the other side of the body: y changes its sign."""
    flip = np.array([1.0, -1.0, 1.0])
    return TriangleMesh(shell.vertices * flip, shell.normals * flip, shell.pixels, shell.faces[:, ::-1].copy())
