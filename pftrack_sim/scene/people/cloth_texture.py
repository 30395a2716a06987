"""Textures of garments: patterns to scale, with folds, hems, seams and buttons.

Columns of a texture go around the body (front in the middle), rows go down.
"""

from __future__ import annotations

from functools import cache, lru_cache
from typing import TYPE_CHECKING, Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.people.outfit import Garment, Outfit, Pattern

if TYPE_CHECKING:
    from pftrack_sim.scene.people.texture_kernels import Details

GarmentName: TypeAlias = Literal["top", "bottom", "shoes"]

PIXEL_M = 0.00215  # size of a cloth pixel on the body
_SIZES: dict[GarmentName, tuple[int, int]] = {"top": (232, 512), "bottom": (150, 512), "shoes": (48, 96)}
_FOLD_DEPTH: dict[GarmentName, float] = {"top": 0.075, "bottom": 0.085, "shoes": 0.04}
_PRINT_PX = 42.0  # Radius of a print


def cloth_texture(outfit: Outfit, name: GarmentName) -> NDArray[np.uint8]:
    """`(h, w, 3)` RGB texture of one garment."""
    from pftrack_sim.scene.people.texture_kernels import dye  # numba: imported when it is used

    garment: Garment = getattr(outfit, name)
    down, around = _pixels(name)
    rng = np.random.default_rng(garment.texture_seed)
    rows, columns, shares = _accent_shares(garment.pattern, down, around, garment.scale_m / PIXEL_M, rng)
    colours = np.array([garment.colour, garment.accent], float)
    folds = _folds(name, garment.texture_seed % 8)
    return dye(colours, rows, columns, shares, folds, _details(name, name == "top" and outfit.open_front))


@cache
def _pixels(name: GarmentName) -> tuple[FloatArray, FloatArray]:
    """Rows from the top `(h,)` and columns from the front `(w,)` of a garment's texture [px]; read-only."""
    height, width = _SIZES[name]
    return _frozen(np.arange(height, dtype=float)), _frozen(np.arange(width, dtype=float) - 0.5 * width)


@cache
def _details(name: GarmentName, buttoned: bool) -> Details:
    """Hems, seams, buttons, belt, soles and laces; read-only."""
    from pftrack_sim.scene.people.texture_kernels import Details  # numba: imported when it is used

    (height, width), (down, around) = _SIZES[name], _pixels(name)
    row_factors, column_factors = np.ones(height), np.ones(width)
    spot_rows, spot_columns = np.zeros(height, np.bool_), np.zeros(width, np.bool_)
    spot_share, spot_colour, accent_row = 0.5, (215.0, 212.0, 204.0), height
    match name:
        case "top":
            row_factors[-5:] = row_factors[:3] = 0.80
            if buttoned:
                column_factors[np.abs(around) < 1.6] = 0.62
                spot_rows, spot_columns = (down % 34 < 4.4) & (down > 6), np.abs(around - 5.0) < 2.2
        case "bottom":
            # Side seams and a belt.
            column_factors[np.abs(np.abs(around) - 0.25 * width) < 1.2] = 0.82
            row_factors[:5] = 0.45
        case "shoes":
            accent_row = int(0.80 * height)
            row_factors[int(0.78 * height) : accent_row] = 0.6
            spot_rows, spot_columns = (down < 0.5 * height) & (down % 7 < 2), np.abs(around) < 9
            spot_share, spot_colour = 0.6, (210.0, 208.0, 202.0)
    for array in (row_factors, column_factors, spot_rows, spot_columns):
        array.setflags(write=False)
    colour = _frozen(np.array(spot_colour))
    return Details(row_factors, column_factors, spot_rows, spot_columns, spot_share, colour, accent_row)


@lru_cache(maxsize=24)
def _folds(name: GarmentName, seed: int) -> FloatArray:
    """`(h, w)` factors of a smooth shading of mean 1, stretched along the hang of the cloth; read-only."""
    height, width = _SIZES[name]
    coarse = 4
    small = (-(-height // coarse), width // coarse)
    rng = np.random.default_rng(seed)
    field = np.zeros((height, width))
    for size_px, weight in ((10.0, 1.0), (22.0, 1.2)):
        # Tiling makes the noise periodic around the body: no visible seam at the back.
        noise = np.tile(rng.normal(size=small), (1, 3))
        blurred = cv2.GaussianBlur(noise, (0, 0), sigmaX=0.55 * size_px / coarse, sigmaY=size_px / coarse)
        fine = cv2.resize(blurred, (3 * width, small[0] * coarse), interpolation=cv2.INTER_CUBIC)
        field += weight * fine[:height, width : 2 * width] / blurred.std()
    field = 1.0 + _FOLD_DEPTH[name] * ((field - field.mean()) / field.std())
    field.setflags(write=False)
    return field


def _inside(distance_px: FloatArray) -> FloatArray:
    """1 inside (negative signed distance), 0 outside, blended over one pixel."""
    return np.clip(0.5 - distance_px, 0.0, 1.0)


def _bands(position_px: FloatArray, repeat_px: float, half_px: float) -> FloatArray:
    """Periodic bands of half width `half_px`."""
    return _inside(np.abs((position_px % repeat_px) - 0.5 * repeat_px) - half_px)


def _accent_shares(
    pattern: Pattern, down: FloatArray, around: FloatArray, repeat_px: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Shares of the accent colour in [0, 1] by rows from the top `(h,)` and columns from the front `(w,)` [px].

    Returns:
        `(h,)` and `(w,)` shares to be added; `(h, w)` shares that hold instead, or an empty array.
    """
    rows, columns, shares = np.zeros_like(down), np.zeros_like(around), np.empty((0, 0))
    match pattern:
        case "plain":
            pass
        case "stripes":
            rows = _bands(down, repeat_px, 0.22 * repeat_px)
        case "pinstripes":
            columns = 0.8 * _bands(around, 0.35 * repeat_px, 1.0)
        case "checks":
            half = 0.25 * repeat_px
            rows, columns = 0.5 * _bands(down, repeat_px, half), 0.5 * _bands(around, repeat_px, half)
        case "print":
            # A lobed disc with a ring cut out of it, on the chest; nothing of it is farther out.
            near, wide = np.abs(down - 74.0) < _PRINT_PX + 2.0, np.abs(around) < _PRINT_PX + 2.0
            x, y = around[None, wide] / _PRINT_PX, (down[near, None] - 74.0) / _PRINT_PX
            angle, radius = np.arctan2(y, x), np.hypot(x, y)
            lobes, phase, depth = int(rng.integers(3, 8)), rng.uniform(0, 6.28), rng.uniform(0.0, 0.45)
            disc = radius - (1.0 - depth * (0.5 + 0.5 * np.cos(lobes * angle + phase)))
            ring = np.abs(radius - rng.uniform(0.3, 0.55)) - 0.08
            shares = np.zeros((len(down), len(around)))
            shares[np.ix_(near, wide)] = np.clip(_inside(40.0 * disc) - _inside(40.0 * ring), 0.0, 1.0)
        case "block":
            # A broad band across the chest, or shoulders of another colour.
            top, bottom = (55.0, 108.0) if rng.random() < 0.5 else (-5.0, 70.0)
            rows = _inside(np.abs(down - 0.5 * (top + bottom)) - 0.5 * (bottom - top))
        case "dots":
            step = 0.8 * repeat_px
            odd = np.floor(down / step)[:, None] % 2
            x = (around + 0.5 * step * odd) % step - 0.5 * step
            y = down[:, None] % step - 0.5 * step
            shares = _inside(np.hypot(x, y) - 0.27 * step)
    return rows, columns, shares


def _frozen(array: FloatArray) -> FloatArray:
    array.setflags(write=False)
    return array
