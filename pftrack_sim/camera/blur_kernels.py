"""Kernel of the lens blur of the default width, whose weights are eighths and whose sums need 16 bits only."""

from __future__ import annotations

import numpy as np
from numba import njit

from pftrack_sim.core.records import Image

_CHANNELS = 3


@njit(cache=True, nogil=True)
def blurred(image: Image) -> Image:
    """`(H, W, 3)` image blurred by weights of 1/8, 6/8, 1/8 along each axis; its border is replicated.

    The result is rounded once, half up, as by `cv2.GaussianBlur`, in a quarter of its time: a sum of products is at
    most 64 * 255.
    """
    height, width = image.shape[:2]
    values = width * _CHANNELS
    out = np.empty((height, width, _CHANNELS), dtype=np.uint8)
    source, target = image.reshape(height, values), out.reshape(height, values)
    # One row, blurred along its columns, with a pixel more at either end. All sums stay in 16 bits: others would be
    # computed in 64, eight times fewer at once.
    word = np.uint16
    row = np.empty(values + 2 * _CHANNELS, dtype=word)
    for index in range(height):
        above, here, below = source[max(index - 1, 0)], source[index], source[min(index + 1, height - 1)]
        for i in range(values):
            row[_CHANNELS + i] = word(above[i]) + word(below[i]) + word(6) * word(here[i])
        for channel in range(_CHANNELS):
            row[channel], row[_CHANNELS + values + channel] = row[_CHANNELS + channel], row[values + channel]
        line = target[index]
        for i in range(values):
            sides = word(row[i]) + word(row[i + 2 * _CHANNELS])
            line[i] = (sides + word(6) * word(row[i + _CHANNELS]) + word(32)) >> word(6)
    return out
