"""States of particle filters on a box: `(4,)` or more, beginning with centre x, y, width, height [px].

What is done with all particles of a frame is compiled: of a hundred, each call of NumPy costs more than its work.
"""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

import numpy as np
from numba import njit

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
    least: list[float] = min_size.tolist() if isinstance(min_size, np.ndarray) else [min_size, min_size]
    _clip(states, float(width_px), float(height_px), float(least[0]), float(least[1]))


@njit(nogil=True, cache=True)
def _clip(states: FloatArray, width_px: float, height_px: float, least_width: float, least_height: float) -> None:
    """Clip `(N, 4+)` states in place."""
    for n in range(states.shape[0]):
        states[n, 0] = min(max(states[n, 0], 0.0), width_px)
        states[n, 1] = min(max(states[n, 1], 0.0), height_px)
        states[n, 2] = min(max(states[n, 2], least_width), 2.0 * width_px)
        states[n, 3] = min(max(states[n, 3], least_height), 2.0 * height_px)


def box_of(state: FloatArray) -> Box:
    """`(4,)` box [px] of a `(4,)` state."""
    x, y, width, height = state.tolist()
    return np.array([x - 0.5 * width, y - 0.5 * height, width, height])


def boxes_of(states: FloatArray, estimate: FloatArray) -> FloatArray:
    """`(N + 1, 4)` boxes [px] of the `(N, 4)` states of particles and, last, of the `(4,)` estimate."""
    out = np.empty((len(states) + 1, 4))
    _fill_boxes(states, out)
    out[-1] = box_of(estimate)
    return out


@njit(nogil=True, cache=True)
def _fill_boxes(states: FloatArray, out: FloatArray) -> None:
    """Fill the first N of `(N + 1, 4)` boxes with those of `(N, 4)` states."""
    for n in range(states.shape[0]):
        width, height = states[n, 2], states[n, 3]
        out[n] = states[n, 0] - 0.5 * width, states[n, 1] - 0.5 * height, width, height
