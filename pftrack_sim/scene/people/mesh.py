"""Triangle meshes lofted through rings of points: the surfaces of all body parts.

A ring's points run from the back over the right side to the front and on. A ring whose points coincide closes the
surface with a pole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.data_files import asset_table
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray, read_only


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A triangle mesh with texture coordinates.

    Attributes:
        vertices: `(V, 3)` [m].
        normals: `(V, 3)` unit, outward.
        pixels: `(V, 2)` column and row in the texture.
        faces: `(F, 3)` vertex indices, counter-clockwise seen from outside.
        coarse: `(C, 3)` the same of meshes for the distance, of about every second ring and point, and every fourth.
    """

    vertices: FloatArray
    normals: FloatArray
    pixels: FloatArray
    faces: NDArray[np.int32]
    coarse: tuple[NDArray[np.int32], ...]


def load_profile(name: str) -> FloatArray:
    """The table of `profile` for a part of the body, from `assets/people.toml`."""
    return _profile(name).copy()


@cache
def _profile(name: str) -> FloatArray:
    return profile(**asset_table("people")["profiles"][name])


def profile(
    *, z: ArrayLike, x: ArrayLike, front: ArrayLike, back: ArrayLike, side: ArrayLike, y: ArrayLike = 0.0
) -> FloatArray:
    """`(R, 6)` table of `R` cross-sections for `superellipse_rings`: z, x, y, front, back, side.

    `x`, `y`, `z` is the centre; `front`, `back` and `side` are half-axes. A scalar holds for all cross-sections.
    """
    return np.stack(np.broadcast_arrays(*(np.asarray(column, float) for column in (z, x, y, front, back, side))), 1)


def ring_angles(count: int) -> FloatArray:
    """`(count,)` directions of a ring's points [rad], from the back (-pi) to the front (0) and on."""
    return -np.pi + 2.0 * np.pi * np.arange(count) / count


def superellipse_rings(table: FloatArray, count: int, *, power: float = 2.0) -> FloatArray:
    """`(R, count, 3)` points of superelliptic rings about the z axis.

    `table` is that of `profile`, `(R, 6)`. A `power` of 2 gives ellipses, more gives squarer rings.
    """
    forward, sideward = _superellipse(count, power)
    z, x, y, front, back, side = (column[:, None] for column in table.T)
    rings = np.empty((len(table), count, 3))
    rings[..., 0] = x + np.where(forward > 0.0, front, back) * forward
    rings[..., 1] = y + side * sideward
    rings[..., 2] = z
    return rings


@cache
def _superellipse(count: int, power: float) -> tuple[FloatArray, FloatArray]:
    """`superellipse` at `ring_angles`; read-only."""
    forward, sideward = superellipse(ring_angles(count), power)
    return read_only(forward), read_only(sideward)


def superellipse(angle: FloatArray, power: float) -> tuple[FloatArray, FloatArray]:
    """Coordinates forward and sideward of points of a superellipse with half-axes 1, by their directions [rad]."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.sign(cos) * np.abs(cos) ** (2.0 / power), np.sign(sin) * np.abs(sin) ** (2.0 / power)


def lofted_mesh(rings: FloatArray, pixels: FloatArray) -> TriangleMesh:
    """The surface through consecutive `(R, N, 3)` rings [m], with `(R, N + 1, 2)` pixels of the texture.

    A normal is the mean of those of the adjacent triangles, weighted by their areas; points that coincide (at the seam,
    at a pole) share one. The last column of pixels belongs to the first point, at the texture's other edge.
    """
    vertices = closed_rings(rings)
    is_pole = (rings.max(axis=1) - rings.min(axis=1)).max(axis=1) < 1e-9
    faces, coarse = _faces(rings.shape[1], tuple(is_pole.tolist()))
    # Corners of the quads, coordinate by coordinate: each is cut into the triangles a, b, c and a, c, d.
    grid = np.ascontiguousarray(vertices.transpose(2, 0, 1))
    a, b, c, d = grid[:, :-1, :-1], grid[:, :-1, 1:], grid[:, 1:, 1:], grid[:, 1:, :-1]
    diagonal = c - a
    quads, first = _cross(diagonal, d - b), _cross(b - a, diagonal)
    if np.vdot(a, quads) < 0.0:  # negative volume: the rings run clockwise
        quads, first, faces, coarse = -quads, -first, faces[:, ::-1], _turned(coarse)
    sums = np.zeros(grid.shape)
    sums[:, :-1, :-1] += quads
    sums[:, :-1, 1:] += first
    sums[:, 1:, 1:] += quads
    sums[:, 1:, :-1] += quads - first
    sums[..., 0] += sums[..., -1]
    sums[..., -1] = sums[..., 0]
    sums[:, is_pole] = sums[:, is_pole, :-1].sum(axis=2, keepdims=True)
    normals = sums.reshape(3, -1).T
    lengths = np.sqrt((normals**2).sum(axis=1, keepdims=True))
    normals = np.where(lengths > 1e-12, normals / np.maximum(lengths, 1e-12), (0.0, 0.0, 1.0))
    return TriangleMesh(vertices.reshape(-1, 3), normals, pixels.reshape(-1, 2), faces, coarse)


def closed_rings(rings: FloatArray) -> FloatArray:
    """`(R, N + 1, 3)` points of `(R, N, 3)` rings with the first of each repeated."""
    return np.concatenate([rings, rings[:, :1]], axis=1)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products of `(3, ...)` vectors; `np.cross` takes three times as long for a few hundred."""
    product = a[[1, 2, 0]] * b[[2, 0, 1]]
    product -= a[[2, 0, 1]] * b[[1, 2, 0]]
    return product


@lru_cache(maxsize=64)
def _faces(count: int, is_pole: tuple[bool, ...]) -> tuple[NDArray[np.int32], tuple[NDArray[np.int32], ...]]:
    """`(F, 3)` vertices of the triangles between rings of `count + 1` points, but for those without area; read-only.

    Then the same between half as many rings of half as many points, and a quarter as many of a quarter.
    """
    rings = len(is_pole)
    grid = np.arange(rings * (count + 1), dtype=np.int32).reshape(rings, count + 1)
    wide, coarse = ~np.array(is_pole), list[NDArray[np.int32]]()
    for every in (2, 4):
        rows = np.linspace(0, rings - 1, max(rings // every, 2) + 1).round().astype(int)
        columns = np.linspace(0, count, max(2 * -(-count // (2 * every)), 4) + 1).round().astype(int)
        coarse.append(_triangles(grid[np.ix_(rows, columns)], wide[rows]))
    return _triangles(grid, wide), tuple(coarse)


def _triangles(grid: NDArray[np.int32], wide: BoolArray) -> NDArray[np.int32]:
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    lower, upper = np.stack([a, b, c], axis=-1)[wide[:-1]], np.stack([a, c, d], axis=-1)[wide[1:]]
    return read_only(np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)]))


def merged(meshes: Sequence[TriangleMesh]) -> TriangleMesh:
    """Several meshes as one."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    return TriangleMesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.pixels for mesh in meshes]),
        _joined([mesh.faces for mesh in meshes], starts),
        tuple(_joined(faces, starts) for faces in zip(*(mesh.coarse for mesh in meshes), strict=True)),
    )


def _joined(faces: Sequence[NDArray[np.int32]], starts: IntArray) -> NDArray[np.int32]:
    """Triangles of several meshes, whose vertices begin at `(N,)` places among all."""
    return np.concatenate([one + start for one, start in zip(faces, starts, strict=True)]).astype(np.int32)


def mirrored(mesh: TriangleMesh) -> TriangleMesh:
    """The mesh of the same part on the other side of the body (y negated)."""
    flip = np.array([1.0, -1.0, 1.0])
    faces = mesh.faces[:, ::-1].copy()
    return TriangleMesh(mesh.vertices * flip, mesh.normals * flip, mesh.pixels, faces, _turned(mesh.coarse))


def _turned(coarse: Sequence[NDArray[np.int32]]) -> tuple[NDArray[np.int32], ...]:
    """The triangles seen from their other side."""
    return tuple(faces[:, ::-1].copy() for faces in coarse)
