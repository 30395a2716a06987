"""Triangle meshes with texture coordinates, from which all props are built.

A mesh is immutable and has one material; a prop is a tuple of meshes. Lengths in metres, z up. Texture coordinates: u
to the right, v upwards, 1 for one whole texture.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.types import FloatArray, read_only
from pftrack_sim.scene.places.materials import Texture
from pftrack_sim.scene.scene_spec import mesh_file


@dataclass(frozen=True, eq=False)
class TexturedMesh:
    """Triangles of one material.

    Attributes:
        vertices: `(N, 3)` [m].
        normals: `(N, 3)` unit vectors.
        uv: `(N, 2)` texture coordinates.
        faces: `(M, 3)` vertex indices, counter-clockwise seen from outside.
    """

    material: str
    vertices: FloatArray
    normals: FloatArray
    uv: FloatArray
    faces: NDArray[np.int32]

    @cached_property
    def file(self) -> bytes:
        """Its `mesh_file`."""
        # Images are stored from the top; v counts from the bottom.
        return mesh_file(self.vertices, self.normals, self.uv * (1.0, -1.0), self.faces)


Prop: TypeAlias = tuple[TexturedMesh, ...]


def quad(
    texture: Texture, corner: ArrayLike, right: ArrayLike, up: ArrayLike, cells: tuple[int, int] = (1, 1)
) -> TexturedMesh:
    """A parallelogram visible from the side that `right` x `up` points to.

    Args:
        texture: Its lower left lies at `corner`.
        corner: `(3,)` lower left corner [m].
        right: `(3,)` edge to the right [m].
        up: `(3,)` edge upwards [m].
        cells: Subdivision along both edges. Light is computed per vertex: pools of light need small cells.
    """
    start, right, up = (np.asarray(v, dtype=np.float64) for v in (corner, right, up))
    columns, rows = cells
    unit = _grid_points(columns, rows)
    vertices = start + unit[:, :1] * right + unit[:, 1:] * up
    normal = _cross(right, up)
    normals = np.empty_like(vertices)
    normals[:] = normal / np.linalg.norm(normal)
    uv = texture.coordinates(unit, (float(np.linalg.norm(right)), float(np.linalg.norm(up))))
    return TexturedMesh(texture.material, vertices, normals, uv, _grid_triangles(columns, rows))


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    # For single vectors ten times as fast as np.cross; a place has thousands of faces.
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@cache
def _grid_points(columns: int, rows: int) -> FloatArray:
    """`((columns + 1) (rows + 1), 2)` corners of the cells of the unit square; read-only."""
    u, v = np.meshgrid(np.linspace(0.0, 1.0, columns + 1), np.linspace(0.0, 1.0, rows + 1))
    return read_only(np.column_stack([u.ravel(), v.ravel()]))


@cache
def _grid_triangles(columns: int, rows: int) -> NDArray[np.int32]:
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)[None, :]).ravel()
    above = first + columns + 1
    faces = [np.column_stack([first, first + 1, above + 1]), np.column_stack([first, above + 1, above])]
    return np.concatenate(faces).astype(np.int32)


# Faces of a cube of edge 2 about the origin: lower left corner, edge to the right, edge upwards.
_FACES = {
    "+x": ((1, -1, -1), (0, 2, 0), (0, 0, 2)),
    "-x": ((-1, 1, -1), (0, -2, 0), (0, 0, 2)),
    "+y": ((1, 1, -1), (-2, 0, 0), (0, 0, 2)),
    "-y": ((-1, -1, -1), (2, 0, 0), (0, 0, 2)),
    "+z": ((-1, -1, 1), (2, 0, 0), (0, 2, 0)),
    "-z": ((-1, 1, -1), (2, 0, 0), (0, -2, 0)),
}
ALL_FACES = tuple(_FACES)
NO_BOTTOM = ALL_FACES[:5]
SIDES = ALL_FACES[:4]
_UNIT_SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


@cache
def _cube(faces: tuple[str, ...]) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, NDArray[np.int32]]:
    """Vertices, normals, unit square positions, edge axes and triangles of some faces of the cube.

    Edge axes, `(faces, 2, 3)`: multiplied by the size of a box they give the width and height of each face.
    """
    corner, right, up = (np.array(v, dtype=np.float64) for v in zip(*(_FACES[name] for name in faces), strict=True))
    vertices = corner[:, None] + _UNIT_SQUARE[:, :1] * right[:, None] + _UNIT_SQUARE[:, 1:] * up[:, None]
    normals = np.repeat(np.cross(right, up) / 4.0, 4, axis=0)
    edges = np.abs(np.stack([right, up], axis=1)) / 2.0
    first = 4 * np.arange(len(faces))[:, None, None]
    triangles = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype(np.int32)
    return vertices.reshape(-1, 3), normals, np.tile(_UNIT_SQUARE, (len(faces), 1)), edges, triangles


def box(texture: Texture, centre: ArrayLike, size: ArrayLike, faces: tuple[str, ...] = NO_BOTTOM) -> TexturedMesh:
    """A box along the axes with the texture on each of some faces; centre and edge lengths are `(3,)` [m]."""
    vertices, normals, unit, edges, triangles = _cube(faces)
    lengths = np.asarray(size, dtype=np.float64)
    corners = np.asarray(centre, dtype=np.float64) + vertices * (0.5 * lengths)
    uv = texture.coordinates(unit, np.repeat(edges @ lengths, 4, axis=0))
    return TexturedMesh(texture.material, corners, normals, uv, triangles)


def cylinder(
    texture: Texture, base: ArrayLike, radius: float, height: float, sides: int = 10, top_radius: float | None = None
) -> TexturedMesh:
    """An upright cylinder or truncated cone with a lid, shaded smoothly; the texture goes round once.

    `base` `(3,)` is the centre of the lower end [m]; radii and height are in metres.
    """
    top = radius if top_radius is None else top_radius
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    slope = np.array([0.0, 0.0, (radius - top) / max(height, 1e-6)])
    outward = (ring + slope) / np.linalg.norm(ring + slope, axis=1, keepdims=True)
    low, high = radius * ring, top * ring + [0.0, 0.0, height]
    unit = np.column_stack([np.tile(angle / (2.0 * np.pi), 2), np.repeat([0.0, 1.0], sides + 1)])
    lid = 0.5 + 0.5 * ring[:-1, :2]
    size = (2.0 * np.pi * max(radius, top), height)
    fan = 2 * (sides + 1) + np.column_stack([np.zeros(sides - 2), np.arange(1, sides - 1), np.arange(2, sides)])
    return TexturedMesh(
        texture.material,
        np.concatenate([low, high, high[:-1]]) + np.asarray(base, dtype=np.float64),
        np.concatenate([outward, outward, np.tile([0.0, 0.0, 1.0], (sides, 1))]),
        np.concatenate([texture.coordinates(unit, size), texture.coordinates(lid, (2.0 * top, 2.0 * top))]),
        np.concatenate([_grid_triangles(sides, 1), fan]).astype(np.int32),
    )


def rough_ellipsoid(
    texture: Texture,
    centre: ArrayLike,
    radii: ArrayLike,
    rng: np.random.Generator,
    roughness: float = 0.12,
    segments: int = 10,
) -> TexturedMesh:
    """An ellipsoid with random bumps: the crown of a tree, a bush. Neighbouring cells mirror the texture.

    `centre` and half axes `radii` are `(3,)` [m]. `roughness` is the standard deviation of the radius, relative to it.
    There are `segments` cells around, and half as many from bottom to top; each shows the texture once.
    """
    rings = segments // 2 + 1
    bump = 1.0 + roughness * rng.standard_normal((rings + 1, segments + 1))
    bump[:, -1] = bump[:, 0]
    bump[0], bump[-1] = bump[0, 0], bump[-1, 0]
    axes = np.asarray(radii, dtype=np.float64)
    unit = _sphere(segments)
    normals = unit / axes
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    odd = np.indices((rings + 1, segments + 1)).astype(np.float64)[::-1] % 2.0
    return TexturedMesh(
        texture.material,
        (np.asarray(centre, dtype=np.float64) + bump[..., None] * unit * axes).reshape(-1, 3),
        normals.reshape(-1, 3),
        texture.coordinates(odd.reshape(2, -1).T, (1.0, 1.0)),
        _grid_triangles(segments, rings),
    )


def ellipsoid(texture: Texture, centre: ArrayLike, radii: ArrayLike, segments: int = 20) -> TexturedMesh:
    """A smooth ellipsoid; the texture goes round it once. `centre` and half axes `radii` are `(3,)` [m]."""
    smooth = rough_ellipsoid(texture, centre, radii, np.random.default_rng(0), 0.0, segments)
    axes = np.asarray(radii, dtype=np.float64)
    uv = texture.coordinates(_grid_points(segments, segments // 2 + 1), 2.0 * np.pi * axes[[0, 2]] * (1.0, 0.5))
    return TexturedMesh(smooth.material, smooth.vertices, smooth.normals, uv, smooth.faces)


def tufts(
    texture: Texture, centre: ArrayLike, radii: ArrayLike, rng: np.random.Generator, count: int, size_m: float
) -> TexturedMesh:
    """Triangles of leaves, tilted at random, all over an ellipsoid: they make the outline of a crown ragged.

    Each is `size_m` long and shows a part of the texture. They are lit as the ellipsoid is.
    """
    axes = np.asarray(radii, dtype=np.float64)
    outward = rng.standard_normal((count, 3))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    normals = outward / axes
    facing = normals / np.linalg.norm(normals, axis=1, keepdims=True) + 0.5 * rng.standard_normal((count, 3))
    facing /= np.linalg.norm(facing, axis=1, keepdims=True)
    right = np.cross(facing, rng.standard_normal((count, 3)))
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    angle = np.array([0.5, 0.5 + 2.0 / 3.0, 0.5 + 4.0 / 3.0]) * np.pi
    reach = 0.6 * size_m * rng.uniform(0.6, 1.2, (count, 3, 1))
    flat = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corners = flat[:, :1] * right[:, None] + flat[:, 1:] * np.cross(facing, right)[:, None]
    middles = np.asarray(centre, dtype=np.float64) + rng.uniform(0.85, 0.99, (count, 1)) * outward * axes
    unit = rng.uniform(0.3, 0.7, (count, 1, 2)) + 0.28 * flat
    soft = normals + 0.3 * np.linalg.norm(normals, axis=1, keepdims=True) * rng.standard_normal((count, 3))
    return TexturedMesh(
        texture.material,
        (middles[:, None] + reach * corners).reshape(-1, 3),
        np.repeat(soft / np.linalg.norm(soft, axis=1, keepdims=True), 3, axis=0),
        texture.coordinates(unit.reshape(-1, 2), (1.0, 1.0)),
        np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
    )


@cache
def _sphere(segments: int) -> FloatArray:
    """`(rings + 1, segments + 1, 3)` unit vectors, from bottom to top; read-only."""
    rings = segments // 2 + 1
    azimuth, elevation = np.meshgrid(
        np.linspace(0.0, 2.0 * np.pi, segments + 1), np.linspace(-0.5 * np.pi, 0.5 * np.pi, rings + 1)
    )
    level = np.cos(elevation)
    return read_only(np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1))


def loft(texture: Texture, sections: Sequence[tuple[float, float, float, float, float]]) -> TexturedMesh:
    """A hull along x through upright trapezoids, closed at both ends: car bodies, cabins.

    Sections are x, lower z, upper z, lower half width, upper half width [m], by growing x. Each side shows the texture
    once.
    """
    x, low, high, wide, narrow = (np.asarray(column, dtype=np.float64) for column in zip(*sections, strict=True))
    u = (x - x[0]) / (x[-1] - x[0])
    right_low, right_high = np.column_stack([x, -wide, low]), np.column_stack([x, -narrow, high])
    left_low, left_high = np.column_stack([x, wide, low]), np.column_stack([x, narrow, high])
    length, height = float(x[-1] - x[0]), float(high.max() - low.min())
    strips = [
        (right_low, right_high, (length, height)),
        (left_low[::-1], left_high[::-1], (length, height)),
        (right_high, left_high, (length, 2.0 * float(narrow.max()))),
    ]
    ends = [
        (left_low[0], right_low[0], right_high[0], left_high[0]),
        (right_low[-1], left_low[-1], left_high[-1], right_high[-1]),
    ]
    panels = [
        _panel(texture, (near[k], near[k + 1], far[k + 1], far[k]), (u[k], u[k + 1]), size)
        for near, far, size in strips
        for k in range(len(x) - 1)
    ]
    panels += [_panel(texture, corners, (0.0, 1.0), (2.0 * float(wide[0]), height)) for corners in ends]
    return merged_by_material(panels)[0]


def _panel(
    texture: Texture,
    corners: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    u: tuple[float, float],
    size: tuple[float, float],
) -> TexturedMesh:
    """A quadrilateral that shows the texture from `u[0]` to `u[1]`."""
    vertices = np.array(corners)
    normal = _cross(vertices[2] - vertices[0], vertices[3] - vertices[1])
    unit = np.array([[u[0], 0.0], [u[1], 0.0], [u[1], 1.0], [u[0], 1.0]])
    normals = np.tile(normal / max(float(np.linalg.norm(normal)), 1e-9), (4, 1))
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    return TexturedMesh(texture.material, vertices, normals, texture.coordinates(unit, size), faces)


def translated(prop: Iterable[TexturedMesh], x: float, y: float, z: float = 0.0) -> Prop:
    """The prop displaced by x, y, z [m]."""
    offset = np.array([x, y, z])
    return tuple(TexturedMesh(m.material, m.vertices + offset, m.normals, m.uv, m.faces) for m in prop)


def rotated(prop: Iterable[TexturedMesh], yaw_rad: float) -> Prop:
    """The prop rotated about z, counter-clockwise."""
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    return _rotated(prop, np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]))


def laid_on_side(prop: Iterable[TexturedMesh]) -> Prop:
    """The prop rotated about x so that its z axis becomes -y."""
    return _rotated(prop, np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]))


def _rotated(prop: Iterable[TexturedMesh], matrix: FloatArray) -> Prop:
    turn = matrix.T
    return tuple(TexturedMesh(m.material, m.vertices @ turn, m.normals @ turn, m.uv, m.faces) for m in prop)


def merged_by_material(meshes: Iterable[TexturedMesh], *, frozen: bool = False) -> Prop:
    """One mesh per material, in the order in which materials first appear; read-only if `frozen`, to be shared."""
    groups: dict[str, list[TexturedMesh]] = {}
    for mesh in meshes:
        groups.setdefault(mesh.material, []).append(mesh)
    merged = tuple(_merged(group) for group in groups.values())
    if frozen:
        for array in (array for mesh in merged for array in (mesh.vertices, mesh.normals, mesh.uv, mesh.faces)):
            read_only(array)
    return merged


def _merged(group: Sequence[TexturedMesh]) -> TexturedMesh:
    if len(group) == 1:
        return group[0]
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in group[:-1]])
    return TexturedMesh(
        group[0].material,
        np.concatenate([mesh.vertices for mesh in group]),
        np.concatenate([mesh.normals for mesh in group]),
        np.concatenate([mesh.uv for mesh in group]),
        np.concatenate([mesh.faces + start for mesh, start in zip(group, starts, strict=True)]).astype(np.int32),
    )
