"""Texture atlas of a person, and meshes that show its regions.

Cloth, face, hair, skin and shoes of a person share one texture and one material: a renderer switches once per person.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.types import FloatArray, read_only
from pftrack_sim.scene.people.anatomy import Anatomy, Colour
from pftrack_sim.scene.people.cloth_texture import PIXEL_M, cloth_texture
from pftrack_sim.scene.people.head_texture import HEAD_SIZE, paint_head
from pftrack_sim.scene.people.mesh import TriangleMesh, closed_rings, lofted_mesh
from pftrack_sim.scene.people.outfit import Outfit

ATLAS_SIZE = 512  # height and width [px]


class Region(NamedTuple):
    """A rectangle of the atlas [px]."""

    column: int
    row: int
    width: int
    height: int


TOP = Region(0, 0, 512, 232)
BOTTOM = Region(0, 240, 512, 150)
HEAD = Region(0, 398, HEAD_SIZE[1], HEAD_SIZE[0])
SHOES = Region(262, 398, 96, 48)
SKIN = Region(364, 398, 64, 48)
HAIR = Region(262, 452, 64, 58)
CAP = Region(332, 452, 64, 58)


def paint_atlas(anatomy: Anatomy, outfit: Outfit) -> NDArray[np.uint8]:
    """`(ATLAS_SIZE, ATLAS_SIZE, 3)` RGB texture of a person."""
    # The gaps are skin-coloured, so that coarse mipmap levels of small regions blend into a plausible colour.
    row = np.tile(np.array(anatomy.skin, np.uint8), ATLAS_SIZE)
    atlas = np.tile(row, (ATLAS_SIZE, 1)).reshape(ATLAS_SIZE, ATLAS_SIZE, 3)
    cap = outfit.shoes.colour if outfit.shoes.colour != outfit.top.colour else (40, 44, 60)
    for region, image in (
        (TOP, cloth_texture(outfit, "top")),
        (BOTTOM, cloth_texture(outfit, "bottom")),
        (HEAD, paint_head(anatomy)),
        (SHOES, cloth_texture(outfit, "shoes")),
        (HAIR, _hair_texture(anatomy.hair, 0.16)),
        (CAP, _hair_texture(cap, 0.03)),
    ):
        atlas[region.row : region.row + region.height, region.column : region.column + region.width] = image
    atlas[232:240] = atlas[231]
    atlas[390:397] = atlas[389]
    return atlas


def _hair_texture(colour: Colour, contrast: float) -> NDArray[np.uint8]:
    """Vertical streaks of varying brightness."""
    streaks, deviation = _streaks()
    # Hair shines below the crown, and strands are darker towards their ends.
    sheen = np.interp(np.arange(HAIR.height), (0, 10, 20, 34, 58), (0.0, 0.6, 2.2, 0.0, -1.6))[:, None]
    brightness = 1.0 + contrast * (streaks / deviation + sheen)
    return np.clip(np.array(colour, float) * brightness[..., None], 0, 255).astype(np.uint8)


@cache
def _streaks() -> tuple[FloatArray, float]:
    """`(h, w)` noise that is stretched along the hair, read-only, and its standard deviation."""
    noise = np.random.default_rng(5).normal(size=(HAIR.height, HAIR.width))
    streaks = np.asarray(cv2.GaussianBlur(noise, (0, 0), sigmaX=0.8, sigmaY=7.0), dtype=np.float64)
    return read_only(streaks), float(streaks.std())


def cloth_mesh(
    rings: FloatArray,
    region: Region,
    front_column: float,
    top_m: float,
    *,
    length_m: float | None = None,
    first_row: float = 0.0,
) -> TriangleMesh:
    """A mesh that shows cloth; texture columns are proportional to the arc length from the front.

    The front of the body, in `(R, N, 3)` rings [m], shows `front_column` of the region, and the height `top_m` shows
    its row `first_row`. The region's rows are stretched over `length_m`, upwards if it is negative; None keeps the
    scale of the cloth.
    """
    points = closed_rings(rings)
    steps = np.sqrt(((points[:, 1:] - points[:, :-1]) ** 2).sum(axis=2))
    lengths = np.zeros(points.shape[:2])
    steps.cumsum(axis=1, out=lengths[:, 1:])
    # All rings share one girth, the quantile 0.7, so that vertical lines of a pattern run straight from ring to ring.
    girths = np.sort(lengths[:, -1])
    girth_px = np.interp(0.7 * (len(girths) - 1), np.arange(len(girths)), girths) / PIXEL_M
    lengths[lengths[:, -1] < 1e-9] = np.arange(points.shape[1])  # poles
    shares = lengths / lengths[:, -1:]
    row_m = PIXEL_M if length_m is None else length_m / region.height
    columns = front_column + (shares - shares[:, rings.shape[1] // 2, None]) * girth_px
    rows = first_row + (top_m - points[..., 2]) / row_m
    columns, rows = columns.clip(1.0, region.width - 1.0), rows.clip(1.0, region.height - 1.0)
    return lofted_mesh(rings, np.stack([region.column + columns, region.row + rows], axis=-1))


def region_mesh(rings: FloatArray, region: Region, margin_px: float = 3.0) -> TriangleMesh:
    """A mesh of `(R, N, 3)` rings over which a region is stretched, less a margin."""
    start, stop = region.column + margin_px, region.column + region.width - margin_px
    columns = np.linspace(start, stop, rings.shape[1] + 1)
    rows = np.linspace(region.row + margin_px, region.row + region.height - margin_px, len(rings))
    return lofted_mesh(rings, np.stack(np.broadcast_arrays(columns[None], rows[:, None]), axis=-1))


def skin_mesh(rings: FloatArray) -> TriangleMesh:
    """A mesh of bare skin through `(R, N, 3)` rings."""
    return region_mesh(rings, SKIN, 4.0)
