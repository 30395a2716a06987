"""States of particle filters on a box: `(4,)` or more, beginning with centre x, y, width, height [px]."""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

import numpy as np

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray

NoiseUnit: TypeAlias = Literal["px", "box"]  # Unit of the dynamics' noise: pixels, or a share of the estimated box


def state_of(box: Box) -> FloatArray:
    """`(4,)` state of a `(4,)` box."""
    return np.concatenate([boxes.centre(box), box[2:]])


def noise_scales(state: FloatArray, unit: NoiseUnit) -> tuple[float, float, float]:
    """Factors from `unit` to pixels of the noise of position, width and height.

    A share of the box is one of the square root of its area for the position (a camera shakes alike in both
    directions), and of width and height each for themselves.
    """
    if unit == "px":
        return 1.0, 1.0, 1.0
    width, height = float(state[2]), float(state[3])
    return math.sqrt(width * height), width, height


def clip_states(states: FloatArray, image: Image, min_size: float | FloatArray) -> None:
    """Clip `(N, 4+)` states in place: centres to the image, sizes to `min_size` [px] and twice the image."""
    height_px, width_px = image.shape[:2]
    low, high = np.zeros(4), np.array([width_px, height_px, 2.0 * width_px, 2.0 * height_px])
    low[2:] = min_size
    clipped = states[:, :4]
    np.maximum(clipped, low, out=clipped)  # `np.clip` takes four times as long for a hundred states
    np.minimum(clipped, high, out=clipped)
