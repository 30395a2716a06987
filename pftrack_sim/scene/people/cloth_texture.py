"""Cloth as pictures: patterns to scale, with folds, hems and buttons painted in."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.scene.people.anatomy import Colour

Array = NDArray[np.float64]

PITCH_M = 0.00215
"""Size of a cloth pixel on the body."""
SIZES: dict[str, tuple[int, int]] = {"top": (232, 512), "bottom": (150, 512), "shoes": (48, 96)}
"""Height and width of each garment's picture [px]."""

_FOLD_DEPTH = {"top": 0.075, "bottom": 0.085, "shoes": 0.04}


def woven(
    which: str, colour: Colour, accent: Colour, pattern: str, scale_m: float, weave: int, *, open_front: bool
) -> NDArray[np.uint8]:
    """A garment's picture.

    Args:
        which: Key of `SIZES`.
        colour: Main colour.
        accent: Colour of the pattern.
        pattern: `"plain"` or one of the patterns of `clothes.Pattern`.
        scale_m: Repeat of the pattern [m].
        weave: Seed of folds and print.
        open_front: Whether a row of buttons runs down the middle.

    Returns:
        `(h, w, 3)` RGB.
    """
    height, width = SIZES[which]
    down, around = np.mgrid[0:height, 0:width].astype(float)
    around = around - 0.5 * width
    share = _PATTERNS[pattern](down, around, scale_m / PITCH_M, np.random.default_rng(weave))[..., None]
    picture = np.array(colour, float) * (1.0 - share) + np.array(accent, float) * share
    picture *= 1.0 + _FOLD_DEPTH[which] * _folds(which, weave % 8)[..., None]
    if open_front:
        picture *= np.where(np.abs(around) < 1.6, 0.62, 1.0)[..., None]
        buttons = (np.abs(around - 5.0) < 2.2) & (down % 34 < 4.4) & (down > 6)
        picture[buttons] = 0.5 * picture[buttons] + 0.5 * np.array([215.0, 212.0, 204.0])
    if which == "bottom":
        # Side seams, and a belt that shows when the shirt lifts.
        picture *= np.where(np.abs(np.abs(around) - 0.25 * width) < 1.2, 0.82, 1.0)[..., None]
        picture[:5] *= 0.45
    if which == "top":
        picture[-5:] *= 0.80
        picture[:3] *= 0.80
    if which == "shoes":
        picture[int(0.80 * height) :] = np.array(accent, float)
        picture[int(0.78 * height) : int(0.80 * height)] *= 0.6
        lace = (np.abs(around) < 9) & (down < 0.5 * height) & (down % 7 < 2)
        picture[lace] = 0.4 * picture[lace] + 0.6 * np.array([210.0, 208.0, 202.0])
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


@lru_cache(maxsize=24)
def _folds(which: str, seed: int) -> Array:
    """Smooth unit-variance shading, stretched along the hang of the cloth."""
    height, width = SIZES[which]
    coarse = 4
    small = (-(-height // coarse), width // coarse)
    rng = np.random.default_rng(seed)
    field = np.zeros((height, width))
    for size_px, weight in ((10.0, 1.0), (22.0, 1.2)):
        # Blurring the noise around a wrapped border keeps the seam at the back invisible.
        noise = np.tile(rng.normal(size=small), (1, 3))
        blurred = cv2.GaussianBlur(noise, (0, 0), sigmaX=0.55 * size_px / coarse, sigmaY=size_px / coarse)
        fine = cv2.resize(blurred, (3 * width, small[0] * coarse), interpolation=cv2.INTER_CUBIC)
        field += weight * fine[:height, width : 2 * width] / blurred.std()
    field = (field - field.mean()) / field.std()
    field.setflags(write=False)
    return field


def _edge(distance_px: Array) -> Array:
    """1 inside (negative distance), 0 outside, one pixel of blend."""
    return np.clip(0.5 - distance_px, 0.0, 1.0)


def _plain(down: Array, around: Array, repeat: float, rng: np.random.Generator) -> Array:
    return np.zeros_like(down)


def _stripes(down: Array, around: Array, repeat: float, rng: np.random.Generator) -> Array:
    return _edge(np.abs((down % repeat) - 0.5 * repeat) - 0.22 * repeat)


def _pinstripes(down: Array, around: Array, repeat: float, rng: np.random.Generator) -> Array:
    step = 0.35 * repeat
    return 0.8 * _edge(np.abs((around % step) - 0.5 * step) - 1.0)


def _checks(down: Array, around: Array, repeat: float, rng: np.random.Generator) -> Array:
    rows = _edge(np.abs((down % repeat) - 0.5 * repeat) - 0.25 * repeat)
    columns = _edge(np.abs((around % repeat) - 0.5 * repeat) - 0.25 * repeat)
    return 0.5 * rows + 0.5 * columns


def _print(down: Array, around: Array, repeat: float, rng: np.random.Generator) -> Array:
    """A drawing on the chest: a disc, a bar, a star of lobes, as the weave has it."""
    centre = 74.0
    x, y = around / 42.0, (down - centre) / 42.0
    angle, radius = np.arctan2(y, x), np.hypot(x, y)
    lobes, turn, depth = int(rng.integers(3, 8)), rng.uniform(0, 6.28), rng.uniform(0.0, 0.45)
    shape = radius - (1.0 - depth * (0.5 + 0.5 * np.cos(lobes * angle + turn)))
    inner = np.abs(radius - rng.uniform(0.3, 0.55)) - 0.08
    return np.clip(_edge(40.0 * shape) - _edge(40.0 * inner), 0.0, 1.0)


def _block(down: Array, around: Array, repeat: float, rng: np.random.Generator) -> Array:
    """A broad band across the chest, or shoulders of another colour."""
    top, bottom = (55.0, 108.0) if rng.random() < 0.5 else (-5.0, 70.0)
    return _edge(np.abs(down - 0.5 * (top + bottom)) - 0.5 * (bottom - top))


def _dots(down: Array, around: Array, repeat: float, rng: np.random.Generator) -> Array:
    step = 0.8 * repeat
    row = np.floor(down / step)
    x = (around + 0.5 * step * (row % 2)) % step - 0.5 * step
    y = down % step - 0.5 * step
    return _edge(np.hypot(x, y) - 0.27 * step)


_PATTERNS: dict[str, Callable[[Array, Array, float, np.random.Generator], Array]] = {
    "plain": _plain,
    "stripes": _stripes,
    "pinstripes": _pinstripes,
    "checks": _checks,
    "print": _print,
    "block": _block,
    "dots": _dots,
}
