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
from pftrack_sim.core.types import FloatArray


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A triangle mesh with texture coordinates.

    Attributes:
        vertices: `(V, 3)` [m].
        normals: `(V, 3)` unit, outward.
        pixels: `(V, 2)` column and row in the texture.
        faces: `(F, 3)` vertex indices, counter-clockwise seen from outside.
    """

    vertices: FloatArray
    normals: FloatArray
    pixels: FloatArray
    faces: NDArray[np.int32]


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
    """`(count,)` coordinates forward and sideward of the points of a superellipse with half-axes 1; read-only."""
    angle = ring_angles(count)
    cos, sin = np.cos(angle), np.sin(angle)
    forward = np.sign(cos) * np.abs(cos) ** (2.0 / power)
    sideward = np.sign(sin) * np.abs(sin) ** (2.0 / power)
    for array in (forward, sideward):
        array.setflags(write=False)
    return forward, sideward


def lofted_mesh(rings: FloatArray, pixels: FloatArray) -> TriangleMesh:
    """The surface through consecutive `(R, N, 3)` rings [m], with `(R, N + 1, 2)` pixels of the texture.

    The last column of pixels belongs to the first point, at the texture's other edge.
    """
    from pftrack_sim.scene.people.mesh_kernels import closed_rings, vertex_normals  # numba: imported when it is used

    vertices, is_pole = closed_rings(rings)
    faces, corners, welded = _triangles(*rings.shape[:2], tuple(np.flatnonzero(is_pole).tolist()))
    normals, clockwise = vertex_normals(vertices, corners, welded)
    return TriangleMesh(vertices, normals, pixels.reshape(-1, 2).astype(float), faces[:, ::-1] if clockwise else faces)


@lru_cache(maxsize=64)
def _triangles(
    ring_count: int, count: int, poles: tuple[int, ...]
) -> tuple[NDArray[np.int32], NDArray[np.intp], NDArray[np.intp]]:
    """Faces `(F, 3)`, the same with one index for coinciding points, and that index of each vertex `(V,)`; read-only.

    Coinciding points (at the seam, at a pole) share one normal; triangles without area are left out.
    """
    grid = np.arange(ring_count * (count + 1), dtype=np.intp).reshape(ring_count, count + 1)
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    shared = grid.copy()
    shared[:, -1] = shared[:, 0]
    shared[list(poles)] = shared[list(poles), :1]
    welded = shared.reshape(-1)
    corners = welded[faces]
    keep = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    found = faces[keep].astype(np.int32), corners[keep], welded
    for array in found:
        array.setflags(write=False)
    return found


def merged(meshes: Sequence[TriangleMesh]) -> TriangleMesh:
    """Several meshes as one."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    return TriangleMesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.pixels for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]).astype(np.int32),
    )


def mirrored(mesh: TriangleMesh) -> TriangleMesh:
    """The mesh of the same part on the other side of the body (y negated)."""
    flip = np.array([1.0, -1.0, 1.0])
    return TriangleMesh(mesh.vertices * flip, mesh.normals * flip, mesh.pixels, mesh.faces[:, ::-1].copy())
