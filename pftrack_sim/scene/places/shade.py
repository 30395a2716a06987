"""What keeps part of the main light from the ground: foliage, and roofs with windows. It casts shadows and is not seen.

All faces look upwards, and cameras are below them: back faces are not drawn, but cast shadows.
"""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.layout import Bounds
from pftrack_sim.scene.places.materials import texture
from pftrack_sim.scene.places.meshes import TexturedMesh, merged_by_material, quad

_CORNERS = 9  # Of the outline of a crown
_LEAVES = 2  # Clusters of leaves around a crown
_FILLED = 0.84  # Mean area of a crown with its leaves over that of a disc of the mean diameter
_BAR_M, _PANE_M, _BEAM_M = 0.09, 0.8, 0.27  # Bars of a window, their distance, and the beams between rows of windows
_SURROUND_M = 6.0


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
    discs: list[TexturedMesh] = []
    for x, y in rng.uniform((left, low), (right, high), (count, 2)):
        radius = half * rng.uniform(0.6, 1.3)
        discs.append(_disc(x, y, height_m, radius * rng.uniform(0.75, 1.15, _CORNERS)))
        for angle in rng.uniform(0.0, 2.0 * np.pi, _LEAVES):
            away, size = radius * rng.uniform(1.0, 1.4), radius * rng.uniform(0.12, 0.3)
            centre = x + away * np.cos(angle), y + away * np.sin(angle)
            discs.append(_disc(*centre, height_m, size * rng.uniform(0.7, 1.2, 5)))
    return merged_by_material(discs)[0]


def roof_with_windows(
    bounds: Bounds, share: float, patch_m: float, height_m: float, rng: np.random.Generator
) -> TexturedMesh:
    """A roof with rectangular windows, their bars, and no light from beside it.

    A share of the area is closed; the roof reaches beyond it. `patch_m` is the mean length of a window.
    """
    left, low, right, high = bounds
    around = _SURROUND_M
    sheets = [
        _sheet(left - around, low - around, right + around, low, height_m),
        _sheet(left - around, high, right + around, high + around, height_m),
        _sheet(left - around, low, left, high, height_m),
        _sheet(right, low, right + around, high, height_m),
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
                sheets.append(_sheet(x, bottom, min(x + closed, right), top, height_m))
            x += closed
            for bar in np.arange(x, min(x + window, right), _PANE_M):
                sheets.append(_sheet(bar, bottom, bar + _BAR_M, top, height_m))
            x += window
        sheets.append(_sheet(left, top - _BEAM_M, right, top, height_m))
    return merged_by_material(sheets)[0]


def _sheet(left: float, low: float, right: float, high: float, z: float) -> TexturedMesh:
    return quad(texture("stone"), (left, low, z), (right - left, 0.0, 0.0), (0.0, high - low, 0.0))


def _disc(x: float, y: float, z: float, radii: FloatArray) -> TexturedMesh:
    """A star-shaped polygon that faces upwards."""
    cos, sin, normals, uv, faces = _unit_disc(len(radii))
    vertices = np.empty((len(radii) + 1, 3))
    vertices[0] = x, y, z
    vertices[1:, 0], vertices[1:, 1], vertices[1:, 2] = x + radii * cos, y + radii * sin, z
    return TexturedMesh(texture("stone").material, vertices, normals, uv, faces)


@cache
def _unit_disc(corners: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, NDArray[np.int32]]:
    """Cosines and sines of the corners of a disc, and the normals, texture coordinates and faces of its mesh."""
    angle = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    ring = np.arange(1, corners + 1)
    faces = np.column_stack([np.zeros_like(ring), ring, np.roll(ring, -1)]).astype(np.int32)
    uv = texture("stone").coordinates(np.full((corners + 1, 2), 0.5), 1.0)
    return np.cos(angle), np.sin(angle), np.tile([0.0, 0.0, 1.0], (corners + 1, 1)), uv, faces
