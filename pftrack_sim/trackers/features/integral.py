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

_LEAST_AREA = 1e-6  # Below this area [px^2] the difference of sums is a rounding error


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
    out = np.empty((len(boxes), len(rectangles), 1))
    _means(integral, boxes, rectangles, channels, out)
    return out[..., 0]


def channel_means(integral: FloatArray, boxes: FloatArray, rectangles: FloatArray) -> FloatArray:
    """`(N, R, C)` means of all channels over rectangles, as `rectangle_means`."""
    out = np.empty((len(boxes), len(rectangles), integral.shape[2]))
    _means(integral, boxes, rectangles, np.zeros(len(rectangles), np.intp), out)
    return out


@njit(nogil=True, cache=True)
def _means(
    integral: FloatArray, boxes: FloatArray, rectangles: FloatArray, first: NDArray[np.intp], out: FloatArray
) -> None:
    """Fill `(N, R, C)` with the means of C channels from the first one of each rectangle on."""
    height, width = integral.shape[0] - 1.0, integral.shape[1] - 1.0
    rows, columns = np.empty((4, 2)), np.empty((4, 2))
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
            _lines(left, right, integral.shape[1], columns)
            _lines(top, bottom, integral.shape[0], rows)
            for c in range(out.shape[2]):
                total = 0.0
                for i in range(4):
                    row = int(rows[i, 0])
                    along = 0.0
                    for j in range(4):
                        along += columns[j, 1] * integral[row, int(columns[j, 0]), first[r] + c]
                    total += rows[i, 1] * along
                out[n, r, c] = total / area


@njit(nogil=True, cache=True)
def _lines(near: float, far: float, count: int, out: FloatArray) -> None:
    """Fill `(4, 2)` with the lines beside two positions, and their weights in the difference of the sums there."""
    low, high = min(int(near), count - 2), min(int(far), count - 2)
    out[0, 0], out[0, 1] = low, near - low - 1.0
    out[1, 0], out[1, 1] = low + 1, low - near
    out[2, 0], out[2, 1] = high, high + 1.0 - far
    out[3, 0], out[3, 1] = high + 1, far - high
