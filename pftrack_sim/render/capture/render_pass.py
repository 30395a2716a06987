"""Render pass: one rendered image of a frame, its camera, and the map from camera pixels to it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pftrack_sim.camera.distortion import Lens
from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.camera.remap import PixelMap
from pftrack_sim.core.types import FloatArray


@dataclass(frozen=True, eq=False)
class RenderPass:
    """One rendered image of a frame.

    Attributes:
        bands: First and one past the last of the bands of image rows that it serves.
        offset_s: Mean offset of its light from the mid-exposure of each row.
        T_world_camera: `(4, 4)` pose of its camera.
        K: `(3, 3)` its camera matrix [px].
        rows: Rows of the rendered image that are used.
        pixel_maps: For each time it is resampled, `(rows, W, 2)` places in those rows.
    """

    bands: tuple[int, int]
    offset_s: float
    T_world_camera: FloatArray
    K: FloatArray
    rows: slice
    pixel_maps: tuple[PixelMap, ...]


def coordinate_range(grids: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """`(2,)` smallest and largest normalized coordinates of `(rows, columns, 2)` grids, found on their borders."""
    border = np.concatenate([side for grid in grids for side in (grid[0], grid[-1], grid[:, 0], grid[:, -1])])
    return border.min(axis=0), border.max(axis=0)


def rows_used(grids: Sequence[FloatArray], K: FloatArray, height_px: int) -> slice:
    """Rows of a rendered image that grids of normalized coordinates use, with a margin of two."""
    _, fy, _, cy = focal_and_centre(K)
    low = min(float(grid[..., 1].min()) for grid in grids) * fy + cy
    high = max(float(grid[..., 1].max()) for grid in grids) * fy + cy
    return slice(min(max(math.floor(low) - 2, 0), height_px - 1), max(min(math.ceil(high) + 2, height_px), 1))


def fit_camera_matrix(lens: Lens, grids: Sequence[FloatArray], size: tuple[int, int]) -> FloatArray:
    """`(3, 3)` camera matrix of a rendered image that contains some rays, at the scale of the lens or smaller.

    Args:
        lens: Projection of the camera.
        grids: `(rows, columns, 2)` normalized coordinates of the rays.
        size: Width and height of the rendered image [px].
    """
    low, high = coordinate_range(grids)
    size_px = np.array(size)
    focal = np.array(focal_and_centre(lens.K)[:2])
    scale = min(1.0, float((size_px / ((high - low) * focal)).min()))
    centre = 0.5 * size_px - 0.5 * scale * focal * (low + high)
    if scale == 1.0:
        # On the pixel grid of the image, so that pixels without distortion are not interpolated.
        principal_point = lens.K[:2, 2]
        centre = principal_point + np.round(centre - principal_point)
    K = np.eye(3)
    K[0, 0], K[1, 1] = scale * focal
    K[:2, 2] = centre
    return K
