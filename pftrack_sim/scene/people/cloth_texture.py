"""Textures of garments: patterns to scale, with folds, hems, seams and buttons.

Columns of a texture go around the body (front in the middle), rows go down.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scene.people.outfit import Garment, Outfit, Pattern

GarmentName: TypeAlias = Literal["top", "bottom", "shoes"]

PIXEL_M = 0.00215  # size of a cloth pixel on the body
_SIZES: dict[GarmentName, tuple[int, int]] = {"top": (232, 512), "bottom": (150, 512), "shoes": (48, 96)}
_FOLD_DEPTH: dict[GarmentName, float] = {"top": 0.075, "bottom": 0.085, "shoes": 0.04}


def cloth_texture(outfit: Outfit, name: GarmentName) -> NDArray[np.uint8]:
    """`(h, w, 3)` RGB texture of one garment."""
    garment: Garment = getattr(outfit, name)
    height, width = _SIZES[name]
    down, around = np.arange(height, dtype=float)[:, None], np.arange(width, dtype=float)[None] - 0.5 * width
    rng = np.random.default_rng(garment.texture_seed)
    share = _accent_share(garment.pattern, down, around, garment.scale_m / PIXEL_M, rng)
    folds = _folds(name, garment.texture_seed % 8)
    # Channel by channel: numpy is slow over a last axis of 3.
    image = np.empty((3, height, width))
    for channel, colour, accent in zip(image, garment.colour, garment.accent, strict=True):
        np.multiply(colour * (1.0 - share) + accent * share, folds, out=channel)
    match name:
        case "top":
            if outfit.open_front:
                image *= np.where(np.abs(around) < 1.6, 0.62, 1.0)
                buttons = (np.abs(around - 5.0) < 2.2) & (down % 34 < 4.4) & (down > 6)
                _blend(image, buttons, 0.5, (215.0, 212.0, 204.0))
            image[:, -5:] *= 0.80
            image[:, :3] *= 0.80
        case "bottom":
            # Side seams and a belt.
            image *= np.where(np.abs(np.abs(around) - 0.25 * width) < 1.2, 0.82, 1.0)
            image[:, :5] *= 0.45
        case "shoes":
            image[:, int(0.80 * height) :] = np.array(garment.accent, float)[:, None, None]
            image[:, int(0.78 * height) : int(0.80 * height)] *= 0.6
            laces = (np.abs(around) < 9) & (down < 0.5 * height) & (down % 7 < 2)
            _blend(image, laces, 0.6, (210.0, 208.0, 202.0))
    np.rint(image, out=image)
    np.clip(image, 0, 255, out=image)
    return np.asarray(cv2.merge(list(image.astype(np.uint8))), dtype=np.uint8)


def _blend(image: FloatArray, where: BoolArray, share: float, colour: tuple[float, float, float]) -> None:
    """Blend a share of a colour into some of the `(h, w)` pixels of a `(3, h, w)` image."""
    for channel, value in zip(image, colour, strict=True):
        channel[where] = (1.0 - share) * channel[where] + share * value


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


def _accent_share(
    pattern: Pattern, down: FloatArray, around: FloatArray, repeat_px: float, rng: np.random.Generator
) -> FloatArray:
    """Share of the accent colour in [0, 1], by rows from the top `(h, 1)` and columns from the front `(1, w)` [px].

    Its shape is `(h, w)`, or one that broadcasts to it.
    """
    match pattern:
        case "plain":
            return np.zeros_like(down)
        case "stripes":
            return _bands(down, repeat_px, 0.22 * repeat_px)
        case "pinstripes":
            return 0.8 * _bands(around, 0.35 * repeat_px, 1.0)
        case "checks":
            half = 0.25 * repeat_px
            return 0.5 * _bands(down, repeat_px, half) + 0.5 * _bands(around, repeat_px, half)
        case "print":
            # A lobed disc with a ring cut out of it, on the chest.
            x, y = around / 42.0, (down - 74.0) / 42.0
            angle, radius = np.arctan2(y, x), np.hypot(x, y)
            lobes, phase, depth = int(rng.integers(3, 8)), rng.uniform(0, 6.28), rng.uniform(0.0, 0.45)
            disc = radius - (1.0 - depth * (0.5 + 0.5 * np.cos(lobes * angle + phase)))
            ring = np.abs(radius - rng.uniform(0.3, 0.55)) - 0.08
            return np.clip(_inside(40.0 * disc) - _inside(40.0 * ring), 0.0, 1.0)
        case "block":
            # A broad band across the chest, or shoulders of another colour.
            top, bottom = (55.0, 108.0) if rng.random() < 0.5 else (-5.0, 70.0)
            return _inside(np.abs(down - 0.5 * (top + bottom)) - 0.5 * (bottom - top))
        case "dots":
            step = 0.8 * repeat_px
            row = np.floor(down / step)
            x = (around + 0.5 * step * (row % 2)) % step - 0.5 * step
            y = down % step - 0.5 * step
            return _inside(np.hypot(x, y) - 0.27 * step)
