"""Texture of head and neck: eyes, brows, mouth, beard, and the scalp in the colour of the hair.

Columns of the texture go around the head (front in the middle), rows from the crown down to the neck. Positions on it
are a direction [rad], 0 at the front, and a height [statures] above the base of the neck of a person of average head.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scene.people.anatomy import Anatomy, HairStyle

HEAD_SIZE = (112, 256)  # height and width of the texture [px]
_TOP_Z, _BOTTOM_Z = 0.165, -0.025  # heights that the first and the last row show
_OVERSAMPLING = 2
_CANVAS = (HEAD_SIZE[0] * _OVERSAMPLING, HEAD_SIZE[1] * _OVERSAMPLING)


class _Spot(NamedTuple):
    """A spot on the canvas: its rows and columns, the share of each pixel, and the tint of the skin."""

    rows: slice
    columns: slice
    share: FloatArray
    tint: FloatArray


def texture_row(z: ArrayLike) -> FloatArray:
    """Row of the texture [px] that shows height z."""
    return (_TOP_Z - np.asarray(z, float)) / (_TOP_Z - _BOTTOM_Z) * HEAD_SIZE[0]


def hairline(style: HairStyle, angle: FloatArray) -> FloatArray:
    """Height of the lower edge of the hair by direction [rad]."""
    side, nape = {"medium": (0.070, 0.024), "long": (0.078, 0.020)}.get(style, (0.092, 0.040))
    angles = np.array([0.0, 0.45, 0.80, 1.10, 1.45, 1.75, 2.2, np.pi])
    heights = np.array([0.1335, 0.1320, 0.1220, side, side - 0.012, 0.5 * (side + nape), nape + 0.008, nape])
    return np.interp(np.abs(angle), angles, heights)


def paint_head(anatomy: Anatomy) -> NDArray[np.uint8]:
    """`(112, 256, 3)` RGB texture of head and neck."""
    from pftrack_sim.scene.people.texture_kernels import interleaved, mix  # numba: imported when it is used

    skin, hair = np.array(anatomy.skin, float), np.array(anatomy.hair, float)
    # Channel by channel: a kernel takes several pixels of a row at a time.
    image = np.empty((3, *_CANVAS))
    image[:] = skin[:, None, None]
    for rows, columns, share, tint in _spots():
        mix(image, rows.start, columns.start, share, skin * tint)
    if anatomy.beard > 0.05:
        rows, mask = _beard()
        mix(image, rows.start, 0, 0.75 * anatomy.beard * mask, hair)
    rows, scalp = _scalp(anatomy.hair_style)
    mix(image, rows.start, 0, scalp, hair)

    canvas = interleaved(image)
    brow = [int(value) for value in 0.75 * hair + 0.12 * skin]
    lips = [int(value) for value in skin * (0.80, 0.52, 0.50)]
    for side in (-1, 1):
        _draw_ellipse(canvas, 0.37 * side, 0.0920, 0.125, 0.0036, (232, 228, 222))
        _draw_ellipse(canvas, 0.365 * side, 0.0922, 0.050, 0.0038, (52, 36, 26))
        _draw_line(canvas, ((0.24 * side, 0.0950), (0.37 * side, 0.0968), (0.50 * side, 0.0945)), (44, 30, 26), 0.9)
        _draw_line(canvas, ((0.18 * side, 0.1020), (0.36 * side, 0.1055), (0.55 * side, 0.1030)), brow, 2.0)
    _draw_ellipse(canvas, 0.0, 0.0480, 0.27, 0.0030, lips)
    _draw_line(canvas, ((-0.27, 0.0484), (0.0, 0.0478), (0.27, 0.0484)), [int(value * 0.6) for value in lips], 0.8)
    return np.asarray(cv2.resize(canvas, HEAD_SIZE[::-1], interpolation=cv2.INTER_AREA), np.uint8)


@cache
def _grid() -> tuple[FloatArray, FloatArray]:
    """Rows of the texture `(h, 1)` and directions `(1, w)` [rad] of the pixels of the canvas; read-only."""
    height, width = _CANVAS
    rows = np.arange(height)[:, None] / _OVERSAMPLING
    angle = (np.arange(width)[None] / width - 0.5) * 2.0 * np.pi
    return _frozen(rows), _frozen(angle)


@cache
def _spots() -> tuple[_Spot, ...]:
    """Gaussian spots of tinted skin; read-only."""
    rows, angle = _grid()

    def spot(strength: float, z: float, spot_angle: float, size_z: float, size_angle: float, tint: FloatArray) -> _Spot:
        down = (rows[:, 0] - texture_row(z)) / (size_z / (_TOP_Z - _BOTTOM_Z) * HEAD_SIZE[0])
        around = (angle[0] - spot_angle) / size_angle
        near, wide = (_run(np.abs(distance) < 2.5) for distance in (down, around))
        share = strength * np.exp(-(down[near] ** 2))[:, None] * np.exp(-(around[wide] ** 2))
        return _Spot(near, wide, _frozen(share), tint)

    shadow, blush = _frozen(np.array([0.55, 0.45, 0.42])), _frozen(np.array([1.0, 0.72, 0.68]))
    found = [spot(0.55, 0.020, 0.0, 0.012, 1.2, shadow)]  # below the chin
    for side in (-1.0, 1.0):
        found += [
            spot(0.42, 0.0945, 0.37 * side, 0.006, 0.17, shadow),  # eye sockets
            spot(0.22, 0.066, 0.52 * side, 0.010, 0.18, blush),  # cheeks
            spot(0.16, 0.0660, 0.13 * side, 0.007, 0.035, shadow),  # beside the nose
            spot(0.40, 0.0610, 0.07 * side, 0.0016, 0.04, shadow),  # nostrils
        ]
    return (*found, spot(0.18, 0.0590, 0.0, 0.003, 0.12, shadow))  # below the nose


@cache
def _beard() -> tuple[slice, FloatArray]:
    """Rows of the canvas with the beard, and its share of each of their pixels; read-only."""
    rows, angle = _grid()
    jaw = texture_row(0.070) + 9.0 * np.clip(1.0 - np.abs(angle) / 0.5, 0.0, 1.0)
    mask = np.clip((jaw - rows) / -3.0, 0.0, 1.0) * np.clip((texture_row(0.026) - rows) / 3.0, 0.0, 1.0)
    return _occupied(mask * np.clip((1.5 - np.abs(angle)) / 0.2, 0.0, 1.0))


@cache
def _scalp(style: HairStyle) -> tuple[slice, FloatArray]:
    """Rows of the canvas with the scalp, and its share of each of their pixels; read-only."""
    rows, angle = _grid()
    scalp = np.clip((texture_row(hairline(style, angle)) - rows) / 1.5 + 0.5, 0.0, 1.0)
    return _occupied(scalp * 0.18 if style == "bald" else scalp)


def _occupied(share: FloatArray) -> tuple[slice, FloatArray]:
    """The rows of a `(h, w)` share in which it is not zero, and the share there."""
    rows = _run(share.max(axis=1) > 0.0)
    return rows, _frozen(share[rows].copy())


def _frozen(array: FloatArray) -> FloatArray:
    array.setflags(write=False)
    return array


def _run(chosen: BoolArray) -> slice:
    """The only run of true values."""
    indices = np.flatnonzero(chosen)
    return slice(int(indices[0]), int(indices[-1]) + 1)


def _canvas_pixel(angle: float, z: float) -> tuple[int, int]:
    column = (angle / (2.0 * np.pi) + 0.5) * HEAD_SIZE[1] * _OVERSAMPLING
    return round(column), round(float(texture_row(z)) * _OVERSAMPLING)


def _draw_ellipse(
    canvas: NDArray[np.uint8], angle: float, z: float, half_angle: float, half_z: float, colour: Sequence[int]
) -> None:
    half_width = round(half_angle / (2.0 * np.pi) * HEAD_SIZE[1] * _OVERSAMPLING)
    half_height = round(half_z / (_TOP_Z - _BOTTOM_Z) * HEAD_SIZE[0] * _OVERSAMPLING)
    centre = _canvas_pixel(angle, z)
    cv2.ellipse(canvas, centre, (half_width, half_height), 0.0, 0.0, 360.0, colour, -1, cv2.LINE_AA)


def _draw_line(
    canvas: NDArray[np.uint8], points: Sequence[tuple[float, float]], colour: Sequence[int], width: float
) -> None:
    line = np.array([_canvas_pixel(angle, z) for angle, z in points], np.int32)
    cv2.polylines(canvas, [line], False, colour, max(1, round(width * _OVERSAMPLING)), cv2.LINE_AA)
