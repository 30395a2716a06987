"""Pinhole camera: intrinsics and normalized image coordinates.

Pixel (row i, column j) covers [j, j+1) x [i, i+1), so the principal point of a centred camera is (W/2, H/2). Camera
axes as in OpenCV: x right, y down, z forward. Normalized image coordinates of a point are (x/z, y/z).
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray

Intrinsics: TypeAlias = tuple[float, float, float, float]  # Focal lengths fx, fy and principal point cx, cy [px]


def intrinsics(width_px: int, height_px: int, fovy_rad: float) -> FloatArray:
    """`(3, 3)` camera matrix [px] of a centred pinhole camera with square pixels and a vertical field of view.

    Raises:
        ParameterError: An empty image, or a field of view outside (0, pi).

    >>> intrinsics(640, 480, math.pi / 2).tolist()
    [[240.00000000000003, 0.0, 320.0], [0.0, 240.00000000000003, 240.0], [0.0, 0.0, 1.0]]
    """
    if width_px < 1 or height_px < 1:
        raise ParameterError(f"an image needs a width and height >= 1, got {width_px} x {height_px}")
    if not 0.0 < fovy_rad < math.pi:
        raise ParameterError(f"fovy_rad must be between 0 and pi, got {fovy_rad}")
    focal = 0.5 * height_px / math.tan(0.5 * fovy_rad)
    return np.array([[focal, 0.0, 0.5 * width_px], [0.0, focal, 0.5 * height_px], [0.0, 0.0, 1.0]])


def focal_and_centre(K: ArrayLike) -> Intrinsics:
    """Focal lengths fx, fy and principal point cx, cy of a camera matrix [px].

    Raises:
        ParameterError: Not `(3, 3)`, skewed, or a focal length <= 0.
    """
    matrix = np.asarray(K, dtype=np.float64)
    if matrix.shape != (3, 3):
        raise ParameterError(f"K must have shape (3, 3), got {matrix.shape}")
    (fx, skew, cx), (_, fy, cy), _ = matrix.tolist()
    if skew != 0.0 or not (fx > 0.0 and fy > 0.0):
        raise ParameterError(f"K must have focal lengths > 0 and no skew, got {matrix.tolist()}")
    return fx, fy, cx, cy
