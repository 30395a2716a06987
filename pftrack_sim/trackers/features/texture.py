"""Texture as a code image: centre-symmetric local binary patterns."""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

PATTERN_COUNT = 16


def cs_lbp_codes(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """CS-LBP of every pixel, 8 neighbours at radius 1 (Ko et al. 2012, eq. 2 and 3).

    Bit i is set when n_i - n_{i+4} >= 1, where n_0 is the right neighbour and i counts anticlockwise. The printed
    sum ends one pair too early; its text and its figure have the four pairs that make 16 patterns. Neighbours beyond
    the edge repeat the edge.

    Args:
        image: `(H, W, 3)` uint8 RGB; its grey value (ITU-R BT.601) is what is compared.

    Returns:
        `(H, W, 1)` codes 0..15.
    """
    grey = cv2.copyMakeBorder(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    out = np.empty((image.shape[0], image.shape[1], 1), np.uint8)
    _patterns(np.asarray(grey, dtype=np.uint8), out)
    return out


@njit(nogil=True, cache=True)
def _patterns(grey: NDArray[np.uint8], out: NDArray[np.uint8]) -> None:
    """Patterns of an image with a border of one pixel around it."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            code = 0
            if grey[i + 1, j + 2] > grey[i + 1, j]:
                code |= 1
            if grey[i, j + 2] > grey[i + 2, j]:
                code |= 2
            if grey[i, j + 1] > grey[i + 2, j + 1]:
                code |= 4
            if grey[i, j] > grey[i + 2, j + 2]:
                code |= 8
            out[i, j, 0] = code
