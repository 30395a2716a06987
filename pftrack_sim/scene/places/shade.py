"""What keeps light from the ground: foliage and roofs with windows, which cast shadows and are not seen, and furniture.

All faces of foliage and roofs look upwards, and cameras are below them: back faces are not drawn, but cast shadows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.types import FloatArray, IntArray
from pftrack_sim.scene.layout import CONTACT, CONTACT_OF_THINGS_HEIGHT_M, Bounds, Footprint
from pftrack_sim.scene.places.materials import texture
from pftrack_sim.scene.places.meshes import TexturedMesh

_CORNERS = 9  # Of the outline of a crown
_LEAVES = 2  # Clusters of leaves around a crown
_LEAF_CORNERS = 5
_FILLED = 0.84  # Mean area of a crown with its leaves over that of a disc of the mean diameter
_BAR_M, _PANE_M, _BEAM_M = 0.09, 0.8, 0.27  # Bars of a window, their distance, and the beams between rows of windows
_SURROUND_M = 6.0
_DARK_M = 0.45  # Distance from a wall at which the ground is as light as elsewhere; half of it from what is low


def foliage(bounds: Bounds, share: float, patch_m: float, height_m: float, rng: np.random.Generator) -> TexturedMesh:
    """Crowns of trees at a height, in random places: ragged discs with clusters of leaves around them.

    They keep the light from a share of an area (crowns that fall at random may overlap: a Boolean model); `patch_m` is
    the mean diameter of a crown.
    """
    half = 0.5 * patch_m
    left, low, right, high = bounds[0] - half, bounds[1] - half, bounds[2] + half, bounds[3] + half
    # Of a Boolean model with intensity n and mean area a the covered share is 1 - exp(-n a).
    area = _FILLED * np.pi * half**2
    count = int(rng.poisson(-math.log(1.0 - min(share, 0.97)) * (right - left) * (high - low) / area))
    centres = rng.uniform((left, low), (right, high), (count, 2))
    # The numbers of one crown and its leaves in a row: radius, corners, and place and corners of the leaves.
    draws = rng.random((count, 1 + _CORNERS + _LEAVES * (1 + 2 + _LEAF_CORNERS)))
    radius, corners = half * _between(draws[:, :1], 0.6, 1.3), draws[:, 1 : 1 + _CORNERS]
    angles, leaves = np.split(draws[:, 1 + _CORNERS :], [_LEAVES], axis=1)
    leaves = leaves.reshape(count, _LEAVES, 2 + _LEAF_CORNERS)
    angles = _between(angles, 0.0, 2.0 * np.pi)
    away, size = radius * _between(leaves[..., 0], 1.0, 1.4), radius * _between(leaves[..., 1], 0.12, 0.3)
    beside = np.stack([away * np.cos(angles), away * np.sin(angles)], axis=-1)
    radii = size[..., None] * _between(leaves[..., 2:], 0.7, 1.2)
    crowns = _discs(centres[:, None], height_m, (radius * _between(corners, 0.75, 1.15))[:, None])
    vertices = np.concatenate([crowns, _discs(centres[:, None] + beside, height_m, radii)], axis=1).reshape(-1, 3)
    fans = [_fan(_CORNERS), *(_fan(_LEAF_CORNERS) + 1 + _CORNERS + k * (1 + _LEAF_CORNERS) for k in range(_LEAVES))]
    return _from_below(vertices, np.concatenate(fans), count, (0.5, 0.5))


def roof_with_windows(
    bounds: Bounds, share: float, patch_m: float, height_m: float, rng: np.random.Generator
) -> TexturedMesh:
    """A roof with rectangular windows, their bars, and no light from beside it.

    A share of the area is closed; the roof reaches beyond it. `patch_m` is the mean length of a window.
    """
    left, low, right, high = bounds
    around = _SURROUND_M
    sheets = [
        (left - around, low - around, right + around, low),
        (left - around, high, right + around, high + around),
        (left - around, low, left, high),
        (right, low, right + around, high),
    ]
    rows = np.linspace(low, high, 1 + max(1, round((high - low) / (1.5 * patch_m))))
    panes = (1.0 - _BAR_M / _PANE_M) * (1.0 - _BEAM_M / (rows[1] - rows[0]))
    open_share = min((1.0 - share) / panes, 1.0)
    for bottom, top in pairwise(rows):
        x = left
        while x < right:
            window = patch_m * rng.uniform(0.6, 1.4)
            closed = window * (1.0 / open_share - 1.0) * rng.uniform(0.7, 1.3)
            if closed > 0.0:
                sheets.append((x, bottom, min(x + closed, right), top))
            x += closed
            for bar in np.arange(x, min(x + window, right), _PANE_M):
                sheets.append((bar, bottom, bar + _BAR_M, top))
            x += window
        sheets.append((left, top - _BEAM_M, right, top))
    edges = np.array(sheets)[:, None]
    u, v = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]).T
    vertices = np.empty((len(sheets), 4, 3))
    vertices[..., 0] = edges[..., 0] + u * (edges[..., 2] - edges[..., 0])
    vertices[..., 1] = edges[..., 1] + v * (edges[..., 3] - edges[..., 1])
    vertices[..., 2] = height_m
    return _from_below(vertices.reshape(-1, 3), np.array([[0, 1, 3], [0, 3, 2]]), len(sheets), np.stack([u, v], axis=1))


def ground_contact(footprints: Sequence[Footprint], ground_m: Sequence[float]) -> TexturedMesh:
    """Darkness on the ground around things, which keep the light of sky and walls from it.

    Its texture is opaque in the middle and clear at the edge. `ground_m` are the heights of the ground below each.
    """
    reach = np.array([_DARK_M * min(1.0, 0.5 + 0.5 * thing.height_m) for thing in footprints])[:, None]
    half, turn = np.array([thing.half_m for thing in footprints]), np.array([thing.yaw_rad for thing in footprints])
    x, y = (np.concatenate([-side - reach, -side, side, side + reach], axis=1) for side in np.split(half, 2, axis=1))
    x, y = np.broadcast_arrays(x[:, None, :], y[:, :, None])
    cosine, sine, centre = np.cos(turn), np.sin(turn), np.array([thing.centre_m for thing in footprints])
    vertices = np.empty((*x.shape, 3))
    vertices[..., 0] = centre[:, 0, None, None] + cosine[:, None, None] * x - sine[:, None, None] * y
    vertices[..., 1] = centre[:, 1, None, None] + sine[:, None, None] * x + cosine[:, None, None] * y
    vertices[..., 2] = np.asarray(ground_m)[:, None, None] + CONTACT_OF_THINGS_HEIGHT_M
    steps = np.array([0.0, 0.5, 0.5, 1.0])
    unit = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    corner = (np.arange(3) + 4 * np.arange(3)[:, None]).reshape(-1, 1, 1)
    faces = (corner + np.array([[0, 1, 5], [0, 5, 4]])).reshape(-1, 3)
    count = len(footprints)
    return TexturedMesh(
        CONTACT,
        vertices.reshape(-1, 3),
        np.tile([0.0, 0.0, 1.0], (16 * count, 1)),
        np.tile(unit, (count, 1)),
        (16 * np.arange(count)[:, None, None] + faces).reshape(-1, 3).astype(np.int32),
    )


def _between(shares: FloatArray, low: float, high: float) -> FloatArray:
    """Numbers drawn from [0, 1) as `Generator.uniform` makes them numbers from `low` to `high`."""
    return low + (high - low) * shares


def _discs(centres_m: FloatArray, z_m: float, radii_m: FloatArray) -> FloatArray:
    """`(N, K (C + 1), 3)` middles and corners of star-shaped polygons, by `(N, K, 2)` middles and `(N, K, C)` radii."""
    angle = np.linspace(0.0, 2.0 * np.pi, radii_m.shape[-1], endpoint=False)
    vertices = np.empty((*radii_m.shape[:2], radii_m.shape[-1] + 1, 3))
    vertices[:, :, 0, :2] = centres_m
    vertices[:, :, 1:, 0] = centres_m[..., :1] + radii_m * np.cos(angle)
    vertices[:, :, 1:, 1] = centres_m[..., 1:] + radii_m * np.sin(angle)
    vertices[..., 2] = z_m
    return vertices.reshape(len(vertices), -1, 3)


def _fan(corners: int) -> IntArray:
    """`(C, 3)` faces of a disc, whose middle is its first vertex."""
    ring = np.arange(1, corners + 1)
    return np.column_stack([np.zeros_like(ring), ring, np.roll(ring, -1)])


def _from_below(vertices: FloatArray, faces: IntArray, count: int, unit: ArrayLike) -> TexturedMesh:
    """A mesh of `count` equal parts that look upwards, with the faces and places in the texture of one part."""
    surface, each = texture("stone"), len(vertices) // max(count, 1)
    part = surface.coordinates(np.broadcast_to(np.asarray(unit, dtype=np.float64), (each, 2)), 1.0)
    triangles = (each * np.arange(count)[:, None, None] + faces).reshape(-1, 3).astype(np.int32)
    normals = np.tile([0.0, 0.0, 1.0], (len(vertices), 1))
    return TexturedMesh(surface.material, vertices, normals, np.tile(part, (count, 1)), triangles)
