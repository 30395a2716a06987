"""Means of an image over rectangles at any position, from integral images (Crow 1984; Viola & Jones 2001).

Coordinates are continuous: between pixels the integral image is interpolated bilinearly, which is exact for an image
that is constant within each pixel. Rectangles are given relative to boxes, so that the same rectangles are measured in
every particle.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.core.types import FloatArray


def integral_image(image: NDArray[Any]) -> FloatArray:
    """`(H + 1, W + 1, C)` sums over all pixels above and left of each corner, of an `(H, W)` or `(H, W, C)` image."""
    sums = np.asarray(cv2.integral(image, sdepth=cv2.CV_64F), dtype=np.float64)
    return sums.reshape(*sums.shape[:2], -1)


def rectangle_means(
    integral: FloatArray, boxes: FloatArray, rectangles: FloatArray, channels: NDArray[np.intp]
) -> FloatArray:
    """`(N, R)` means over `(R, 4)` rectangles, each in one of the `(R,)` channels, within `(N, 4)` boxes [px].

    Rectangles are x, y, w, h in shares of the box: (0, 0, 1, 1) is the box itself, and a rectangle may lie beyond it.
    Only the part inside the image counts; the mean is 0 where there is none.
    """
    out = np.empty((len(boxes), len(rectangles)))
    _means(integral, boxes, rectangles, channels, out)
    return out


@njit(nogil=True, cache=True)
def _means(
    integral: FloatArray, boxes: FloatArray, rectangles: FloatArray, channels: NDArray[np.intp], out: FloatArray
) -> None:
    height, width = integral.shape[0] - 1.0, integral.shape[1] - 1.0
    for n in range(boxes.shape[0]):
        x, y, w, h = boxes[n]
        for r in range(rectangles.shape[0]):
            left, top = x + rectangles[r, 0] * w, y + rectangles[r, 1] * h
            right = min(max(left + rectangles[r, 2] * w, 0.0), width)
            bottom = min(max(top + rectangles[r, 3] * h, 0.0), height)
            left, top = min(max(left, 0.0), width), min(max(top, 0.0), height)
            area = (right - left) * (bottom - top)
            if area <= _LEAST_AREA:
                out[n, r] = 0.0
                continue
            c = channels[r]
            total = _at(integral, bottom, right, c) - _at(integral, top, right, c)
            total += _at(integral, top, left, c) - _at(integral, bottom, left, c)
            out[n, r] = total / area


@njit(nogil=True, cache=True)
def _at(integral: FloatArray, row: float, column: float, channel: int) -> float:
    """The integral image at a continuous position inside it."""
    i, j = min(int(row), integral.shape[0] - 2), min(int(column), integral.shape[1] - 2)
    v, u = row - i, column - j
    above = integral[i, j, channel] + (integral[i, j + 1, channel] - integral[i, j, channel]) * u
    below = integral[i + 1, j, channel] + (integral[i + 1, j + 1, channel] - integral[i + 1, j, channel]) * u
    return above + (below - above) * v


_LEAST_AREA = 1e-6  # Below this area [px^2] the difference of sums is a rounding error
