"""Texture of head and neck: eyes, brows, mouth, beard, and the scalp in the colour of the hair.

Columns of the texture go around the head (front in the middle), rows from the crown down to the neck. Positions on it
are a direction [rad], 0 at the front, and a height [statures] above the base of the neck of a person of average head.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.data_files import asset_table
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray, read_only
from pftrack_sim.scenario.clothes import HairStyle
from pftrack_sim.scene.people.anatomy import Anatomy

HEAD_SIZE = (112, 256)  # height and width of the texture [px]
_TOP_Z, _BOTTOM_Z = 0.165, -0.025  # heights that the first and the last row show
_OVERSAMPLING = 2
_CANVAS = (HEAD_SIZE[0] * _OVERSAMPLING, HEAD_SIZE[1] * _OVERSAMPLING)


def texture_row(z: ArrayLike) -> FloatArray:
    """Row of the texture [px] that shows height z."""
    return (_TOP_Z - np.asarray(z, float)) / (_TOP_Z - _BOTTOM_Z) * HEAD_SIZE[0]


def hairline(style: HairStyle, angle: FloatArray) -> FloatArray:
    """Height of the lower edge of the hair by direction [rad]."""
    shape = asset_table("people")["hair"].get(style, {})
    side, nape = shape.get("side", 0.092), shape.get("nape", 0.040)
    angles = np.array([0.0, 0.45, 0.80, 1.10, 1.45, 1.75, 2.2, np.pi])
    heights = np.array([0.1335, 0.1320, 0.1220, side, side - 0.012, 0.5 * (side + nape), nape + 0.008, nape])
    return np.interp(np.abs(angle), angles, heights)


def paint_head(anatomy: Anatomy) -> Image:
    """`(112, 256, 3)` RGB texture of head and neck."""
    # Channel by channel, (3, H, W): arrays with a last axis of three are slow.
    skin, hair = (np.array(rgb, np.float32)[:, None, None] for rgb in (anatomy.skin, anatomy.hair))
    painted = _complexion() * skin
    if anatomy.beard > 0.05:
        _blend(painted, _beard(), hair, 0.75 * anatomy.beard)
    _blend(painted, _scalp(anatomy.hair_style), hair, 1.0)

    canvas = np.asarray(cv2.merge([*painted.astype(np.uint8)]), np.uint8)
    brow = [int(value) for value in (0.75 * hair + 0.12 * skin).flat]
    lips = [int(value * share) for value, share in zip(anatomy.skin, (0.80, 0.52, 0.50), strict=True)]
    for side in (-1, 1):
        _draw_ellipse(canvas, 0.37 * side, 0.0940, 0.150, 0.0036, (226, 221, 214))
        _draw_ellipse(canvas, 0.365 * side, 0.0943, 0.060, 0.0038, (52, 36, 26))
        _draw_line(canvas, ((0.22 * side, 0.0962), (0.37 * side, 0.0984), (0.53 * side, 0.0960)), (44, 30, 26), 0.9)
        _draw_line(canvas, ((0.17 * side, 0.1040), (0.36 * side, 0.1072), (0.58 * side, 0.1042)), brow, 2.0)
    _draw_ellipse(canvas, 0.0, 0.0525, 0.27, 0.0034, lips)
    _draw_line(canvas, ((-0.27, 0.0530), (0.0, 0.0524), (0.27, 0.0530)), [int(value * 0.6) for value in lips], 0.8)
    if anatomy.glasses != "none":
        frame = (36, 32, 32)
        for side in (-1, 1):
            _draw_ellipse(canvas, 0.37 * side, 0.0935, 0.225, 0.0085, frame, -1 if anatomy.glasses == "dark" else 2)
            _draw_line(canvas, ((0.55 * side, 0.0955), (1.45 * side, 0.0955)), frame, 1.4)
        _draw_line(canvas, ((-0.16, 0.0950), (0.16, 0.0950)), frame, 1.4)
    return np.asarray(cv2.resize(canvas, HEAD_SIZE[::-1], interpolation=cv2.INTER_AREA), np.uint8)


def _blend(image: NDArray[np.float32], share: NDArray[np.float32], colour: NDArray[np.float32], weight: float) -> None:
    """Blend a `(3, 1, 1)` colour into the upper rows of a `(3, H, W)` image, by the `(h, W)` share of each pixel."""
    rows = image[:, : len(share)]
    rows += (colour - rows) * (weight * share)


def _grid() -> tuple[FloatArray, FloatArray]:
    """Rows of the texture `(h, 1)` and directions `(w,)` [rad] of the pixels of the canvas."""
    height, width = _CANVAS
    return np.arange(height)[:, None] / _OVERSAMPLING, (np.arange(width) / width - 0.5) * 2.0 * np.pi


@cache
def _complexion() -> NDArray[np.float32]:
    """`(3, H, W)` factors of the skin's colour on the canvas: Gaussian spots of shadow and blush; read-only."""
    rows, angle = _grid()
    factors = np.ones((3, *_CANVAS))
    for strength, z, at, size_z, size_angle, *tint in asset_table("people")["face"]["spots"]:
        down = (rows - texture_row(z)) / (size_z / (_TOP_Z - _BOTTOM_Z) * HEAD_SIZE[0])
        around = (angle - at) / size_angle
        share = strength * np.exp(-(down**2) - around**2)
        factors += (np.reshape(tint, (3, 1, 1)) - factors) * share
    return read_only(factors.astype(np.float32))


@cache
def _beard() -> NDArray[np.float32]:
    """`(h, W)` share of the beard on the upper rows of the canvas; read-only."""
    rows, angle = _grid()
    # Whiskers before the ears, around the mouth and below the jaw.
    top = np.interp(np.abs(angle), (0.0, 0.35, 0.6, 1.2, 1.45), (0.0575, 0.055, 0.050, 0.058, 0.092))
    mask = np.clip((rows - texture_row(top)) / 7.0, 0.0, 1.0) * np.clip((texture_row(0.026) - rows) / 6.0, 0.0, 1.0)
    return _upper_rows(mask * np.clip((1.6 - np.abs(angle)) / 0.3, 0.0, 1.0))


@cache
def _scalp(style: HairStyle) -> NDArray[np.float32]:
    """`(h, W)` share of the hair's colour on the upper rows of the canvas; read-only."""
    rows, angle = _grid()
    scalp = np.clip((texture_row(hairline(style, angle)) - rows) / 1.5 + 0.5, 0.0, 1.0)
    return _upper_rows(scalp * 0.18 if style == "bald" else scalp)


def _upper_rows(share: FloatArray) -> NDArray[np.float32]:
    """The rows of a `(H, W)` share down to the last in which it is not zero, `(h, W)`; read-only."""
    return read_only(share[: int(np.flatnonzero(share.any(axis=1))[-1]) + 1].astype(np.float32))


def _canvas_pixel(angle: float, z: float) -> tuple[int, int]:
    column = (angle / (2.0 * np.pi) + 0.5) * HEAD_SIZE[1] * _OVERSAMPLING
    return round(column), round(float(texture_row(z)) * _OVERSAMPLING)


def _draw_ellipse(
    canvas: NDArray[np.uint8],
    angle: float,
    z: float,
    half_angle: float,
    half_z: float,
    colour: Sequence[int],
    line_px: int = -1,
) -> None:
    half_width = round(half_angle / (2.0 * np.pi) * HEAD_SIZE[1] * _OVERSAMPLING)
    half_height = round(half_z / (_TOP_Z - _BOTTOM_Z) * HEAD_SIZE[0] * _OVERSAMPLING)
    centre = _canvas_pixel(angle, z)
    cv2.ellipse(canvas, centre, (half_width, half_height), 0.0, 0.0, 360.0, colour, line_px, cv2.LINE_AA)


def _draw_line(
    canvas: NDArray[np.uint8], points: Sequence[tuple[float, float]], colour: Sequence[int], width: float
) -> None:
    line = np.array([_canvas_pixel(angle, z) for angle, z in points], np.int32)
    cv2.polylines(canvas, [line], False, colour, max(1, round(width * _OVERSAMPLING)), cv2.LINE_AA)
