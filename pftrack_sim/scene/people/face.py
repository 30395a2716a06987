"""The skin of the head, painted: eyes, brows, mouth, beard, and the scalp's colour under the hair."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.scene.people.anatomy import Anatomy

Array = NDArray[np.float64]

HEAD_SIZE = (112, 256)
"""Height and width of the head's picture [px]: columns go around (front in the middle), rows from crown to neck."""

TOP_Z, BOTTOM_Z = 0.165, -0.025
"""What the first and last row show: height above the base of the neck, in statures of a person of average head."""

_OVERSAMPLING = 2


def row_of(z: Array | float) -> Array:
    """Row of the head's picture [px] that shows height z [statures above the base of the neck]."""
    return (TOP_Z - np.asarray(z)) / (TOP_Z - BOTTOM_Z) * HEAD_SIZE[0]


def hairline(style: str, turn: Array) -> Array:
    """Height at which hair begins, by direction (0 is the front) [statures above the base of the neck]."""
    side, nape = {"medium": (0.070, 0.024), "long": (0.078, 0.020)}.get(style, (0.092, 0.040))
    knots = np.array([0.0, 0.45, 0.80, 1.10, 1.45, 1.75, 2.2, np.pi])
    heights = np.array([0.1335, 0.1320, 0.1220, side, side - 0.012, 0.5 * (side + nape), nape + 0.008, nape])
    return np.interp(np.abs(turn), knots, heights)


def painted_head(anatomy: Anatomy) -> NDArray[np.uint8]:
    """`(112, 256, 3)` RGB skin of the head and neck."""
    height, width = HEAD_SIZE[0] * _OVERSAMPLING, HEAD_SIZE[1] * _OVERSAMPLING
    skin = np.array(anatomy.skin, float)
    picture = np.broadcast_to(skin, (height, width, 3)).copy()
    rows = np.arange(height)[:, None] / _OVERSAMPLING
    turn = (np.arange(width)[None] / width - 0.5) * 2.0 * np.pi

    def shade(strength: float, z: float, angle: float, size_z: float, size_angle: float, tint: Array) -> None:
        """Blend a soft spot of tinted skin in."""
        down = (rows[:, 0] - row_of(z)) / (size_z / (TOP_Z - BOTTOM_Z) * HEAD_SIZE[0])
        around = (turn[0] - angle) / size_angle
        near, wide = np.abs(down) < 2.5, np.abs(around) < 2.5
        spot = strength * np.exp(-(down[near] ** 2))[:, None] * np.exp(-(around[wide] ** 2))
        patch = picture[np.ix_(near, wide)]
        picture[np.ix_(near, wide)] = patch + spot[..., None] * (skin * tint - patch)

    shadow, blush = np.array([0.55, 0.45, 0.42]), np.array([1.0, 0.72, 0.68])
    shade(0.55, 0.020, 0.0, 0.012, 1.2, shadow)  # below the chin
    for side in (-1.0, 1.0):
        shade(0.42, 0.0945, 0.37 * side, 0.006, 0.17, shadow)  # eye sockets
        shade(0.22, 0.066, 0.52 * side, 0.010, 0.18, blush)  # cheeks
        shade(0.16, 0.0660, 0.13 * side, 0.007, 0.035, shadow)  # beside the nose
        shade(0.40, 0.0610, 0.07 * side, 0.0016, 0.04, shadow)  # nostrils
    shade(0.18, 0.0590, 0.0, 0.003, 0.12, shadow)
    if anatomy.beard > 0.05:
        jaw = np.clip((row_of(0.070) + 9.0 * np.clip(1.0 - np.abs(turn) / 0.5, 0.0, 1.0) - rows) / -3.0, 0.0, 1.0)
        jaw = jaw * np.clip((row_of(0.026) - rows) / 3.0, 0.0, 1.0) * np.clip((1.5 - np.abs(turn)) / 0.2, 0.0, 1.0)
        picture += (0.75 * anatomy.beard * jaw)[..., None] * (np.array(anatomy.hair, float) - picture)
    scalp = np.clip((row_of(hairline(anatomy.hair_style, turn)) - rows) / 1.5 + 0.5, 0.0, 1.0)
    if anatomy.hair_style == "bald":
        scalp = scalp * 0.18
    picture += scalp[..., None] * (np.array(anatomy.hair, float) - picture)

    canvas = np.ascontiguousarray(np.clip(picture, 0, 255).astype(np.uint8))
    brow = tuple(int(v) for v in 0.75 * np.array(anatomy.hair, float) + 0.12 * skin)
    lips = tuple(int(v) for v in skin * (0.80, 0.52, 0.50))
    for side in (-1, 1):
        _ellipse(canvas, 0.37 * side, 0.0920, 0.125, 0.0036, (232, 228, 222))
        _ellipse(canvas, 0.365 * side, 0.0922, 0.050, 0.0038, (52, 36, 26))
        _stroke(canvas, ((0.24 * side, 0.0950), (0.37 * side, 0.0968), (0.50 * side, 0.0945)), (44, 30, 26), 0.9)
        _stroke(canvas, ((0.18 * side, 0.1020), (0.36 * side, 0.1055), (0.55 * side, 0.1030)), brow, 2.0)
    _ellipse(canvas, 0.0, 0.0480, 0.27, 0.0030, lips)
    _stroke(canvas, ((-0.27, 0.0484), (0.0, 0.0478), (0.27, 0.0484)), tuple(int(v * 0.6) for v in lips), 0.8)
    return np.asarray(cv2.resize(canvas, HEAD_SIZE[::-1], interpolation=cv2.INTER_AREA), np.uint8)


def _at(turn: float, z: float) -> tuple[int, int]:
    column = (turn / (2.0 * np.pi) + 0.5) * HEAD_SIZE[1] * _OVERSAMPLING
    return round(column), round(float(row_of(z)) * _OVERSAMPLING)


def _ellipse(
    canvas: NDArray[np.uint8], turn: float, z: float, half_turn: float, half_z: float, colour: tuple[int, ...]
) -> None:
    axes = (
        round(half_turn / (2.0 * np.pi) * HEAD_SIZE[1] * _OVERSAMPLING),
        round(half_z / (TOP_Z - BOTTOM_Z) * HEAD_SIZE[0] * _OVERSAMPLING),
    )
    cv2.ellipse(canvas, _at(turn, z), axes, 0.0, 0.0, 360.0, colour, -1, cv2.LINE_AA)


def _stroke(
    canvas: NDArray[np.uint8], points: tuple[tuple[float, float], ...], colour: tuple[int, ...], width: float
) -> None:
    line = np.array([_at(turn, z) for turn, z in points], np.int32)
    cv2.polylines(canvas, [line], False, colour, max(1, round(width * _OVERSAMPLING)), cv2.LINE_AA)
