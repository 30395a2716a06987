"""Means of an image over rectangles at any position, from integral images (Crow 1984; Viola & Jones 2001).

Coordinates are continuous: between pixels the integral image is interpolated bilinearly, which is exact for an image
that is constant within each pixel. Rectangles are given relative to boxes, so that the same rectangles are measured in
every particle.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.compiled import kernel
from pftrack_sim.core.types import FloatArray

_LEAST_AREA = 1e-6  # Below this area [px^2] the difference of sums is a rounding error


def integral_image(image: NDArray[Any]) -> FloatArray:
    """`(H + 1, W + 1, C)` sums over all pixels above and left of each corner, of an `(H, W)` or `(H, W, C)` image."""
    sums = np.asarray(cv2.integral(image, sdepth=cv2.CV_64F), dtype=np.float64)
    return sums.reshape(*sums.shape[:2], -1)


def rectangle_means(integral: FloatArray, boxes: FloatArray, rectangles: FloatArray) -> FloatArray:
    """`(N, R, C)` means of all channels over `(R, 4)` rectangles within `(N, 4)` boxes [px].

    Rectangles are x, y, w, h in shares of the box: (0, 0, 1, 1) is the box itself, and a rectangle may lie beyond it.
    Only the part inside the image counts; the mean is 0 where there is none.
    """
    out = np.empty((len(boxes), len(rectangles), integral.shape[2]))
    _means(integral, boxes, rectangles, out)
    return out


@kernel
def _means(integral: FloatArray, boxes: FloatArray, rectangles: FloatArray, out: FloatArray) -> None:
    """Fill `(N, R, C)` means."""
    height, width = integral.shape[0] - 1, integral.shape[1] - 1
    # The lines beside each side of a rectangle, and their weights in the difference of the sums.
    rows, columns = np.empty(4, np.int64), np.empty(4, np.int64)
    row_weights, column_weights = np.empty(4), np.empty(4)
    for n in range(boxes.shape[0]):
        for r in range(rectangles.shape[0]):
            x = boxes[n, 0] + rectangles[r, 0] * boxes[n, 2]
            y = boxes[n, 1] + rectangles[r, 1] * boxes[n, 3]
            left, right = min(max(x, 0.0), width), min(max(x + rectangles[r, 2] * boxes[n, 2], 0.0), width)
            top, bottom = min(max(y, 0.0), height), min(max(y + rectangles[r, 3] * boxes[n, 3], 0.0), height)
            area = (right - left) * (bottom - top)
            for side in range(2):
                sign = 2.0 * side - 1.0
                column, row = right if side else left, bottom if side else top
                columns[2 * side], rows[2 * side] = min(int(column), width - 1), min(int(row), height - 1)
                columns[2 * side + 1], rows[2 * side + 1] = columns[2 * side] + 1, rows[2 * side] + 1
                column_weights[2 * side + 1] = sign * (column - columns[2 * side])
                column_weights[2 * side] = sign - column_weights[2 * side + 1]
                row_weights[2 * side + 1] = sign * (row - rows[2 * side])
                row_weights[2 * side] = sign - row_weights[2 * side + 1]
            for c in range(out.shape[2]):
                total = 0.0
                for i in range(4):
                    for j in range(4):
                        total += row_weights[i] * column_weights[j] * integral[rows[i], columns[j], c]
                out[n, r, c] = total / area if area > _LEAST_AREA else 0.0
