"""One picture per person that holds everything painted on them: cloth, face, hair, skin, shoes.

One texture and one material for a whole person keep the number of things a renderer has to switch small.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.people.clothes import Outfit, texture
from pftrack_sim.scene.people.face import HEAD_SIZE, painted_head

SIZE = 512
"""Height and width of the atlas [px]."""

TOP = (0, 0, 512, 232)
BOTTOM = (0, 240, 512, 150)
HEAD = (0, 398, HEAD_SIZE[1], HEAD_SIZE[0])
SHOES = (262, 398, 96, 48)
SKIN = (364, 398, 64, 48)
HAIR = (262, 452, 64, 58)
CAP = (332, 452, 64, 58)
"""Regions: column, row, width, height [px]."""


def painted(anatomy: Anatomy, outfit: Outfit) -> NDArray[np.uint8]:
    """`(SIZE, SIZE, 3)` RGB: everything one person shows."""
    out = np.empty((SIZE, SIZE, 3), np.uint8)
    # What lies between the regions is skin: coarse mipmaps of small regions then blend into something harmless.
    out[:] = np.array(anatomy.skin, np.uint8)
    _put(out, TOP, texture(outfit, "top"))
    _put(out, BOTTOM, texture(outfit, "bottom"))
    out[232:240] = out[231]
    out[390:397] = out[389]
    _put(out, HEAD, painted_head(anatomy))
    _put(out, SHOES, texture(outfit, "shoes"))
    _put(out, HAIR, _strands(anatomy.hair, 0.16))
    _put(out, CAP, _strands(outfit.shoes.colour if outfit.shoes.colour != outfit.top.colour else (40, 44, 60), 0.03))
    return out


def _put(out: NDArray[np.uint8], region: tuple[int, int, int, int], picture: NDArray[np.uint8]) -> None:
    column, row, width, height = region
    out[row : row + height, column : column + width] = picture


def _strands(colour: tuple[int, int, int], depth: float) -> NDArray[np.uint8]:
    """Streaks that run down the picture."""
    height, width = HAIR[3], HAIR[2]
    noise = np.random.default_rng(5).normal(size=(height, width))
    streaks = cv2.GaussianBlur(noise, (0, 0), sigmaX=0.8, sigmaY=7.0)
    shade = 1.0 + depth * streaks / streaks.std()
    return np.clip(np.array(colour, float) * shade[..., None], 0, 255).astype(np.uint8)
