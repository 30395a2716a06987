"""Textures of garments: patterns to scale, with folds, hems, seams and buttons.

Columns of a texture go around the body (front in the middle), rows go down.
"""

from __future__ import annotations

from functools import cache, lru_cache
from typing import Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.records import Image
from pftrack_sim.core.types import BoolArray, FloatArray, read_only
from pftrack_sim.scene.people.anatomy import Colour
from pftrack_sim.scene.people.outfit import Garment, Outfit, Pattern

GarmentName: TypeAlias = Literal["top", "bottom", "shoes"]

PIXEL_M = 0.00215  # size of a cloth pixel on the body
_SIZES: dict[GarmentName, tuple[int, int]] = {"top": (232, 512), "bottom": (150, 512), "shoes": (48, 96)}
_FOLD_DEPTH: dict[GarmentName, float] = {"top": 0.07, "bottom": 0.07, "shoes": 0.03}
_PRINT_PX = 42.0  # Radius of a print
_MIDDLE_PX = 64  # Half width of what is opened, or carries a pocket


def cloth_texture(outfit: Outfit, name: GarmentName) -> Image:
    """`(h, w, 3)` RGB texture of one garment."""
    garment: Garment = getattr(outfit, name)
    # Channel by channel, (3, h, w): arrays with a last axis of three are slow.
    colour, accent = (np.array(rgb, np.float32)[:, None, None] for rgb in (garment.colour, garment.accent))
    height, width = _SIZES[name]
    down, around = np.arange(height, dtype=float), np.arange(width, dtype=float) - 0.5 * width
    rng = np.random.default_rng(garment.texture_seed)
    shares = _accent_shares(garment.pattern, down[:, None], around, garment.scale_m / PIXEL_M, rng)
    shading = _shading(name, garment.texture_seed % 8)
    cut = "shoes" if name == "shoes" else outfit.cut if name == "top" else "shirt"
    middle = slice(width // 2 - _MIDDLE_PX, width // 2 + _MIDDLE_PX)
    if cut == "jacket" and garment.texture_seed % 2:  # Open, over a shirt of the accent's colour
        cut, seam = "open", _seam()
        shares = np.broadcast_to(shares * (garment.pattern != "print"), shading.shape).copy()
        shares[:, middle][seam < 0.0] = 1.0
    dyed = (colour + (accent - colour) * shares.astype(np.float32)) * shading
    if cut == "open":
        dyed[..., middle][:, np.abs(_seam()) < 2.5] *= 0.62
    elif cut == "jacket":
        dyed[..., np.abs(around) < 1.6] *= 0.62
    elif cut == "hood":
        dyed[..., middle][:, np.abs(_pocket()) < 1.5] *= 0.72
    image = np.asarray(cv2.convertScaleAbs(cv2.merge([*dyed])), np.uint8)
    if cut == "shoes":
        image[int(0.80 * height) :] = garment.accent
        _sew(image, (down < 0.5 * height) & (down % 7 < 2), np.abs(around) < 9, 0.6, (210, 208, 202))  # laces
    elif cut == "jacket":
        _sew(image, (down % 34 < 4.4) & (down > 6), np.abs(around - 5.0) < 2.2, 0.5, (215, 212, 204))
    elif cut == "hood":
        _sew(image, (down > 20) & (down < 62), np.abs(np.abs(around) - 13.0) < 1.6, 0.6, (225, 222, 214))  # cords
    return image


@cache
def _seam() -> FloatArray:
    """`(h, w)` distance beyond the edge of an open jacket, in its middle columns [px]."""
    edge = np.interp(np.arange(_SIZES["top"][0]), (0, 60, 232), (34.0, 15.0, 22.0))
    return np.abs(np.arange(-_MIDDLE_PX, _MIDDLE_PX)) - edge[:, None]


@cache
def _pocket() -> FloatArray:
    """`(h, w)` distance beyond the edge of a pocket before the belly, in the middle columns [px]."""
    down, around = np.arange(_SIZES["top"][0]), np.arange(-_MIDDLE_PX, _MIDDLE_PX)
    return np.maximum(np.abs(down - 166.0)[:, None] - 23.0, np.abs(around) - 60.0)


def _sew(image: Image, rows: BoolArray, columns: BoolArray, share: float, colour: Colour) -> None:
    """Blend a share of a colour into the pixels at these `(h,)` rows and `(w,)` columns."""
    pixels = np.ix_(rows, columns)
    blended: FloatArray = (1.0 - share) * image[pixels] + share * np.array(colour)
    image[pixels] = blended.round()


@lru_cache(maxsize=24)
def _shading(name: GarmentName, seed: int) -> NDArray[np.float32]:
    """`(h, w)` brightness of a garment by its folds, by what keeps light from it, and by hems and belt; read-only."""
    height, width = _SIZES[name]
    down, around = np.arange(height)[:, None], np.arange(width) - 0.5 * width
    shading = _folds(name, seed)
    match name:
        case "top":
            # Beside the chest and inside the sleeves; the light comes from above.
            shading *= (1.05 - 0.12 * down / height) * (1.0 - 0.28 * np.exp(-(((np.abs(around) - 112.0) / 40.0) ** 2)))
            shading[-5:] *= 0.80
            shading[:3] *= 0.80
        case "bottom":
            # Between the legs, and below the hem of the top; worn pale in front.
            between = np.exp(-(((around + 66.0) / 44.0) ** 2)) * np.clip((down - 58.0) / 30.0, 0.0, 1.0)
            worn = np.exp(-((around / 34.0) ** 2) - ((down - 96.0) / 30.0) ** 2)
            shading *= (1.0 - 0.42 * between + 0.13 * worn) * (1.0 - 0.35 * np.exp(-down / 9.0))
            shading[:5] *= 0.6
        case "shoes":
            shading[int(0.78 * height) : int(0.80 * height)] *= 0.6
    shading /= shading[5:-5].mean()
    return read_only(shading)


def _folds(name: GarmentName, seed: int) -> NDArray[np.float32]:
    """`(h, w)` factors of about 1: creases lit from above."""
    height, width = _SIZES[name]
    coarse = 2
    small = (-(-height // coarse) + 2, width // coarse)
    rng = np.random.default_rng(seed)
    relief = np.zeros(small)
    turn = 2.0 * np.pi * np.arange(3 * small[1]) / small[1]
    slant = sum(18.0 / order * np.sin(order * turn + rng.uniform(0.0, 6.28)) for order in (1.0, 2.0, 3.0))
    for size_px, weight in ((5.0, 0.5), (11.0, 1.0)):
        # Tiling makes the noise periodic around the body: no visible seam at the back.
        noise = np.tile(rng.normal(size=(2 * small[0], small[1])), (1, 3))
        blurred = cv2.GaussianBlur(noise, (0, 0), sigmaX=1.6 * size_px / coarse, sigmaY=0.7 * size_px / coarse)
        rows = np.arange(small[0])[:, None] + 0.5 * small[0] + slant
        columns = np.broadcast_to(np.arange(3 * small[1]), rows.shape)
        slanted = cv2.remap(blurred, columns.astype(np.float32), rows.astype(np.float32), cv2.INTER_LINEAR)
        # Cloth hangs between sharp ridges.
        relief -= weight * size_px * np.abs(slanted[:, small[1] : 2 * small[1]]) / blurred.std()
    lit: FloatArray = np.gradient(relief, axis=0)
    fine = np.asarray(cv2.resize(lit, (width, small[0] * coarse), interpolation=cv2.INTER_CUBIC), dtype=np.float64)
    return (1.0 + _FOLD_DEPTH[name] * fine[:height] / lit.std()).astype(np.float32)


def _inside(distance_px: FloatArray) -> FloatArray:
    """1 inside (negative signed distance), 0 outside, blended over one pixel."""
    return np.clip(0.5 - distance_px, 0.0, 1.0)


def _bands(position_px: FloatArray, repeat_px: float, half_px: float) -> FloatArray:
    """Periodic bands of half width `half_px`."""
    return _inside(np.abs((position_px % repeat_px) - 0.5 * repeat_px) - half_px)


def _accent_shares(
    pattern: Pattern, down: FloatArray, around: FloatArray, repeat_px: float, rng: np.random.Generator
) -> FloatArray:
    """Shares of the accent colour by rows from the top `(h, 1)` and columns from the front `(w,)` [px].

    They are in [0, 1] and broadcast to `(h, w)`.
    """
    match pattern:
        case "plain":
            return np.zeros((1, 1))
        case "stripes":
            return _bands(down, repeat_px, 0.22 * repeat_px)
        case "pinstripes":
            return 0.8 * _bands(around, 0.35 * repeat_px, 1.0)
        case "checks":
            half = 0.25 * repeat_px
            return 0.5 * _bands(down, repeat_px, half) + 0.5 * _bands(around, repeat_px, half)
        case "print":
            # A lobed disc with a ring cut out of it, on the chest; nothing of it is farther out.
            near, wide = np.abs(down[:, 0] - 74.0) < _PRINT_PX + 2.0, np.abs(around) < _PRINT_PX + 2.0
            x, y = around[wide] / _PRINT_PX, (down[near] - 74.0) / _PRINT_PX
            angle, radius = np.arctan2(y, x), np.hypot(x, y)
            lobes, phase, depth = int(rng.integers(3, 8)), rng.uniform(0, 6.28), rng.uniform(0.0, 0.45)
            disc = radius - (1.0 - depth * (0.5 + 0.5 * np.cos(lobes * angle + phase)))
            ring = np.abs(radius - rng.uniform(0.3, 0.55)) - 0.08
            shares = np.zeros((len(down), len(around)))
            shares[np.ix_(near, wide)] = np.clip(_inside(40.0 * disc) - _inside(40.0 * ring), 0.0, 1.0)
            return shares
        case "block":
            # A broad band across the chest, or shoulders of another colour.
            top, bottom = (55.0, 108.0) if rng.random() < 0.5 else (-5.0, 70.0)
            return _inside(np.abs(down - 0.5 * (top + bottom)) - 0.5 * (bottom - top))
        case "dots":
            step = 0.8 * repeat_px
            x = (around + 0.5 * step * (np.floor(down / step) % 2)) % step - 0.5 * step
            y = down % step - 0.5 * step
            return _inside(np.hypot(x, y) - 0.27 * step)
