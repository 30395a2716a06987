"""The pinhole camera: from metres in front of the lens to pixels, and the frustum that draws exactly that.

Pixel (row i, column j) covers [j, j+1) x [i, i+1), so the principal point of a centred camera is (W/2, H/2). Camera
axes as OpenCV: x right, y down, z forward. `T_world_camera` maps camera to world.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.errors import ParameterError

OPENGL_AXES = np.diag([1.0, -1.0, -1.0])
"""Turns camera axes between OpenCV (x right, y down, z forward) and OpenGL and MuJoCo (x right, y up, z backward):
`R_opencv = R_opengl @ OPENGL_AXES` and the other way round."""
OPENGL_AXES.setflags(write=False)


@dataclass(frozen=True)
class Frustum:
    """What an OpenGL camera needs: the sides of the view on the near plane [m], y up.

    Attributes:
        left: Left side; negative for a centred camera.
        right: Right side.
        bottom: Bottom side; negative for a centred camera.
        top: Top side.
        near: Distance of the near plane.
        far: Distance of the far plane.
    """

    left: float
    right: float
    bottom: float
    top: float
    near: float
    far: float


def intrinsics(width_px: int, height_px: int, fovy_rad: float) -> NDArray[np.float64]:
    """Camera matrix of a centred pinhole camera with square pixels.

    Args:
        width_px: Image width.
        height_px: Image height.
        fovy_rad: Vertical field of view, between 0 and pi.

    Returns:
        `(3, 3)` K [px].

    Raises:
        ParameterError: An empty image, or a field of view that is no angle between 0 and pi.

    >>> intrinsics(640, 480, math.pi / 2).tolist()
    [[240.00000000000003, 0.0, 320.0], [0.0, 240.00000000000003, 240.0], [0.0, 0.0, 1.0]]
    """
    if width_px < 1 or height_px < 1:
        raise ParameterError(f"an image needs a width and height >= 1, got {width_px} x {height_px}")
    if not 0.0 < fovy_rad < math.pi:
        raise ParameterError(f"fovy_rad must be between 0 and pi, got {fovy_rad}")
    focal = 0.5 * height_px / math.tan(0.5 * fovy_rad)
    return np.array([[focal, 0.0, 0.5 * width_px], [0.0, focal, 0.5 * height_px], [0.0, 0.0, 1.0]])


def camera_matrix(K: ArrayLike | float, width_px: int, height_px: int) -> NDArray[np.float64]:
    """A `(3, 3)` camera matrix [px], from itself or from a vertical field of view [rad].

    Raises:
        ParameterError: Neither.
    """
    if np.ndim(K) == 0:
        return intrinsics(width_px, height_px, float(np.asarray(K)))
    focal_and_centre(K)
    return np.array(K, dtype=np.float64)


def cropped(K: ArrayLike, left_px: float, top_px: float) -> NDArray[np.float64]:
    """Camera matrix of a rectangle of the image: the same pixel grid, counted from the rectangle's corner.

    Args:
        K: `(3, 3)` camera matrix of the whole image [px].
        left_px: First column of the rectangle.
        top_px: First row of the rectangle.
    """
    shifted = np.array(K, dtype=np.float64)
    shifted[0, 2] -= left_px
    shifted[1, 2] -= top_px
    return shifted


def frustum(K: ArrayLike, width_px: int, height_px: int, near_m: float, far_m: float) -> Frustum:
    """The frustum whose drawing is the image that K describes; with `cropped`, a rectangle of it.

    Args:
        K: `(3, 3)` camera matrix [px], without skew.
        width_px: Image width.
        height_px: Image height.
        near_m: Distance of the near plane.
        far_m: Distance of the far plane.

    Raises:
        ParameterError: Planes out of order, or a camera matrix with skew or a focal length <= 0.
    """
    if not 0.0 < near_m < far_m:
        raise ParameterError(f"0 < near < far is needed, got near={near_m}, far={far_m}")
    fx, fy, cx, cy = focal_and_centre(K)
    return Frustum(
        left=-cx / fx * near_m,
        right=(width_px - cx) / fx * near_m,
        bottom=-(height_px - cy) / fy * near_m,
        top=cy / fy * near_m,
        near=near_m,
        far=far_m,
    )


def focal_and_centre(K: ArrayLike) -> tuple[float, float, float, float]:
    """Focal lengths fx, fy and principal point cx, cy of a camera matrix [px].

    Raises:
        ParameterError: Not `(3, 3)`, skewed, or a focal length <= 0.
    """
    matrix = np.asarray(K, dtype=np.float64)
    if matrix.shape != (3, 3):
        raise ParameterError(f"K must have shape (3, 3), got {matrix.shape}")
    if matrix[0, 1] != 0.0 or not (matrix[0, 0] > 0.0 and matrix[1, 1] > 0.0):
        raise ParameterError(f"K must have focal lengths > 0 and no skew, got {matrix.tolist()}")
    return float(matrix[0, 0]), float(matrix[1, 1]), float(matrix[0, 2]), float(matrix[1, 2])


def in_camera(points: ArrayLike, T_world_camera: ArrayLike) -> NDArray[np.float64]:
    """`(N, 3)` world points [m] in the camera's axes [m]; the third column is the depth."""
    pose = np.asarray(T_world_camera, dtype=np.float64)
    return (np.asarray(points, dtype=np.float64) - pose[:3, 3]) @ pose[:3, :3]


def project(
    points: ArrayLike, T_world_camera: ArrayLike, K: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where world points appear.

    Args:
        points: `(N, 3)` [m], world frame.
        T_world_camera: `(4, 4)` camera pose.
        K: `(3, 3)` camera matrix [px].

    Returns:
        `(N, 2)` x, y [px], NaN for points that are not in front of the camera, and `(N,)` depths [m] along the
        camera's z.
    """
    fx, fy, cx, cy = focal_and_centre(K)
    local = in_camera(points, T_world_camera)
    depth = local[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = local[:, :2] / depth[:, None] * (fx, fy) + (cx, cy)
    pixels[depth <= 0.0] = np.nan
    return pixels, depth
