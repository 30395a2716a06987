"""Triangles with texture coordinates: the bricks of which all scenery is made.

A shape is immutable and carries the name of its material; a piece of furniture is a tuple of shapes. Lengths in
metres; z is up. Texture coordinates are u to the right and v upwards, 1 for one whole texture.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]


class Skin(Protocol):
    """Which material a surface shows, and how a face lies on its texture."""

    @property
    def material(self) -> str:
        """Name of the material."""
        ...

    def mapped(self, unit: Array, size_m: ArrayLike) -> Array:
        """`(N, 2)` texture coordinates of `(N, 2)` positions in the unit square of a face.

        `size_m` is the face's width and height, `(2,)` or one per position `(N, 2)`.
        """
        ...


@dataclass(frozen=True, eq=False)
class Shape:
    """Triangles of one material.

    Attributes:
        material: Name of the material.
        points: `(N, 3)` [m].
        normals: `(N, 3)` unit vectors.
        uv: `(N, 2)` texture coordinates.
        faces: `(M, 3)` indices, counter-clockwise seen from outside.
    """

    material: str
    points: Array
    normals: Array
    uv: Array
    faces: NDArray[np.int32]


Piece: TypeAlias = tuple[Shape, ...]


def quad(skin: Skin, corner: ArrayLike, along: ArrayLike, up: ArrayLike, cells: tuple[int, int] = (1, 1)) -> Shape:
    """A parallelogram seen from the side that `along` x `up` points to.

    Args:
        skin: What it shows; the texture's lower left lies at `corner`.
        corner: `(3,)` lower left corner [m].
        along: `(3,)` edge to the right [m].
        up: `(3,)` edge upwards [m].
        cells: Into how many cells it is cut: light is computed per vertex, so pools of light need small cells.
    """
    start, right, rise = (np.asarray(v, dtype=np.float64) for v in (corner, along, up))
    across, rows = cells
    u, v = np.meshgrid(np.linspace(0.0, 1.0, across + 1), np.linspace(0.0, 1.0, rows + 1))
    unit = np.column_stack([u.ravel(), v.ravel()])
    points = start + unit[:, :1] * right + unit[:, 1:] * rise
    normal = _cross(right, rise)
    size = (float(np.linalg.norm(right)), float(np.linalg.norm(rise)))
    return Shape(
        skin.material,
        points,
        np.tile(normal / np.linalg.norm(normal), (len(points), 1)),
        skin.mapped(unit, size),
        _lattice(across, rows),
    )


def _cross(a: Array, b: Array) -> Array:
    # Ten times as fast as numpy's for single vectors, and places are made of thousands of them.
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@cache
def _lattice(across: int, rows: int) -> NDArray[np.int32]:
    first = (np.arange(rows)[:, None] * (across + 1) + np.arange(across)[None, :]).ravel()
    above = first + across + 1
    faces = [np.column_stack([first, first + 1, above + 1]), np.column_stack([first, above + 1, above])]
    return np.concatenate(faces).astype(np.int32)


# The faces of a cube of edge 2 about the origin: lower left corner, along, up.
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
_UNIT = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


@cache
def _cube(faces: tuple[str, ...]) -> tuple[Array, Array, Array, Array, NDArray[np.int32]]:
    """Corners, normals, unit square, and which edges run along and up, of some faces of the cube; the triangles."""
    corner, along, up = (np.array(v, dtype=np.float64) for v in zip(*(_FACES[name] for name in faces), strict=True))
    points = corner[:, None] + _UNIT[:, :1] * along[:, None] + _UNIT[:, 1:] * up[:, None]
    normals = np.repeat(np.cross(along, up) / 4.0, 4, axis=0)
    # Row of 0.5 at the axis that the edge follows: times the size of a box, the length of the edge.
    edges = np.abs(np.stack([along, up], axis=1)) / 2.0
    first = 4 * np.arange(len(faces))[:, None, None]
    triangles = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype(np.int32)
    return points.reshape(-1, 3), normals, np.tile(_UNIT, (len(faces), 1)), edges, triangles


def box(skin: Skin, centre: ArrayLike, size: ArrayLike, faces: tuple[str, ...] = NO_BOTTOM) -> Shape:
    """An upright box.

    Args:
        skin: What every face shows.
        centre: `(3,)` [m].
        size: `(3,)` full edge lengths [m].
        faces: Which faces to draw; the bottom is rarely seen.
    """
    points, normals, unit, edges, triangles = _cube(tuple(faces))
    lengths = np.asarray(size, dtype=np.float64)
    face_sizes = np.repeat(edges @ lengths, 4, axis=0)
    corners = np.asarray(centre, dtype=np.float64) + points * (0.5 * lengths)
    return Shape(skin.material, corners, normals, skin.mapped(unit, face_sizes), triangles)


def cylinder(
    skin: Skin, base: ArrayLike, radius: float, height: float, sides: int = 10, top_radius: float | None = None
) -> Shape:
    """An upright cylinder or cone with a lid; the texture goes round once.

    Args:
        skin: What it shows.
        base: `(3,)` centre of its foot [m].
        radius: At the foot [m].
        height: [m].
        sides: How many flat sides it is cut into; the light on them is smooth.
        top_radius: At the top; None is the same as at the foot.
    """
    top = radius if top_radius is None else top_radius
    turn = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    ring = np.column_stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)])
    lean = np.array([0.0, 0.0, (radius - top) / max(height, 1e-6)])
    outward = (ring + lean) / np.linalg.norm(ring + lean, axis=1, keepdims=True)
    low, high = radius * ring, top * ring + [0.0, 0.0, height]
    unit = np.column_stack([np.tile(turn / (2.0 * np.pi), 2), np.repeat([0.0, 1.0], sides + 1)])
    points = np.concatenate([low, high, high[:-1]]) + np.asarray(base, dtype=np.float64)
    lid = 0.5 + 0.5 * ring[:-1, :2]
    size = (2.0 * np.pi * max(radius, top), height)
    fan = 2 * (sides + 1) + np.column_stack([np.zeros(sides - 2), np.arange(1, sides - 1), np.arange(2, sides)])
    return Shape(
        skin.material,
        points,
        np.concatenate([outward, outward, np.tile([0.0, 0.0, 1.0], (sides, 1))]),
        np.concatenate([skin.mapped(unit, size), skin.mapped(lid, (2.0 * top, 2.0 * top))]),
        np.concatenate([_lattice(sides, 1), fan]).astype(np.int32),
    )


def blob(
    skin: Skin,
    centre: ArrayLike,
    radii: ArrayLike,
    rng: np.random.Generator,
    roughness: float = 0.12,
    segments: int = 10,
) -> Shape:
    """A bumpy ellipsoid: the crown of a tree, a bush. The texture is laid on it back and forth.

    Args:
        skin: What it shows.
        centre: `(3,)` [m].
        radii: `(3,)` half axes [m].
        rng: Draws the bumps.
        roughness: Standard deviation of the radius, as a share of it.
        segments: Cuts around; half as many from top to bottom.
    """
    rings = segments // 2 + 1
    turn = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    rise = np.linspace(-0.5 * np.pi, 0.5 * np.pi, rings + 1)
    angle, height = np.meshgrid(turn, rise)
    bump = 1.0 + roughness * rng.standard_normal((rings + 1, segments + 1))
    bump[:, -1] = bump[:, 0]
    bump[0], bump[-1] = bump[0, 0], bump[-1, 0]
    unit = np.stack([np.cos(height) * np.cos(angle), np.cos(height) * np.sin(angle), np.sin(height)], axis=-1)
    axes = np.asarray(radii, dtype=np.float64)
    normals = unit / axes
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    back_and_forth = np.column_stack(
        [np.tile(np.arange(segments + 1) % 2, rings + 1), np.repeat(np.arange(rings + 1) % 2, segments + 1)]
    ).astype(np.float64)
    return Shape(
        skin.material,
        (np.asarray(centre, dtype=np.float64) + bump[..., None] * unit * axes).reshape(-1, 3),
        normals.reshape(-1, 3),
        skin.mapped(back_and_forth, (1.0, 1.0)),
        _lattice(segments, rings),
    )


def loft(skin: Skin, stations: Sequence[tuple[float, float, float, float, float]]) -> Shape:
    """A hull along x through upright trapezoids, closed at both ends: car bodies, cabins.

    Args:
        skin: What each side shows, whole, from the first station to the last.
        stations: x, lower z, upper z, lower half width, upper half width [m], by growing x.
    """
    x, low, high, wide, narrow = (np.asarray(column, dtype=np.float64) for column in zip(*stations, strict=True))
    share = (x - x[0]) / (x[-1] - x[0])
    right_low, right_high = np.column_stack([x, -wide, low]), np.column_stack([x, -narrow, high])
    left_low, left_high = np.column_stack([x, wide, low]), np.column_stack([x, narrow, high])
    length, height = float(x[-1] - x[0]), float(high.max() - low.min())
    strips = [
        (right_low, right_high, share, (length, height)),
        (left_low[::-1], left_high[::-1], share, (length, height)),
        (right_high, left_high, share, (length, 2.0 * float(narrow.max()))),
    ]
    ends = [
        (left_low[0], right_low[0], right_high[0], left_high[0]),
        (right_low[-1], left_low[-1], left_high[-1], right_high[-1]),
    ]
    shapes = [
        _panel(skin, (near[k], near[k + 1], far[k + 1], far[k]), (along[k], along[k + 1]), size)
        for near, far, along, size in strips
        for k in range(len(x) - 1)
    ]
    shapes += [_panel(skin, corners, (0.0, 1.0), (2.0 * float(wide[0]), height)) for corners in ends]
    return joined(shapes)[0]


def _panel(
    skin: Skin, corners: tuple[Array, Array, Array, Array], span: tuple[float, float], size: tuple[float, float]
) -> Shape:
    points = np.array(corners)
    normal = _cross(points[2] - points[0], points[3] - points[1])
    unit = np.array([[span[0], 0.0], [span[1], 0.0], [span[1], 1.0], [span[0], 1.0]])
    normals = np.tile(normal / max(float(np.linalg.norm(normal)), 1e-9), (4, 1))
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    return Shape(skin.material, points, normals, skin.mapped(unit, size), faces)


def turned(piece: Iterable[Shape], yaw_rad: float) -> Piece:
    """The piece turned about z, counter-clockwise."""
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    matrix = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return tuple(replace(s, points=s.points @ matrix.T, normals=s.normals @ matrix.T) for s in piece)


def tipped(piece: Iterable[Shape]) -> Piece:
    """The piece laid over: its z axis becomes -y, so that an upright wheel's disc faces sideways."""
    matrix = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    return tuple(replace(s, points=s.points @ matrix.T, normals=s.normals @ matrix.T) for s in piece)


def moved(piece: Iterable[Shape], x: float, y: float, z: float = 0.0) -> Piece:
    """The piece somewhere else [m]."""
    return tuple(replace(shape, points=shape.points + np.array([x, y, z])) for shape in piece)


def joined(shapes: Iterable[Shape]) -> Piece:
    """One shape per material, in the order in which materials first appear."""
    groups: dict[str, list[Shape]] = {}
    for shape in shapes:
        groups.setdefault(shape.material, []).append(shape)
    return tuple(_merged(material, group) for material, group in groups.items())


def _merged(material: str, group: Sequence[Shape]) -> Shape:
    if len(group) == 1:
        return group[0]
    starts = np.cumsum([0] + [len(shape.points) for shape in group[:-1]])
    return Shape(
        material,
        np.concatenate([shape.points for shape in group]),
        np.concatenate([shape.normals for shape in group]),
        np.concatenate([shape.uv for shape in group]),
        np.concatenate([shape.faces + start for shape, start in zip(group, starts, strict=True)]).astype(np.int32),
    )
