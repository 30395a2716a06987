"""Grey patches of a target under planar motion, sampled from an image.

A *placement* is where a template lies in the image: `(6,)` cx, cy, ux, uy, vx, vy, its centre [px] and the vectors of
its width and of its height [px]. A patch is the image sampled at ROWS x COLUMNS points of a placement, normalised to
mean 0 and variance 1, so that it does not depend on brightness and contrast.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.compiled import kernel
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.image_region import ImageRegion, block_means, whole_block_size

Patches: TypeAlias = NDArray[np.float32]  # `(N, d)` patches, points row by row


def grid_shape(width: float, height: float, point_count: int) -> tuple[int, int]:
    """Rows and columns, at least 2 each, of a grid of about `point_count` points of equal spacing in a box."""
    columns = min(max(round(math.sqrt(point_count * width / height)), 2), max(point_count // 2, 2))
    return max(round(point_count / columns), 2), columns


class PatchSampler:
    """Samples patches from one frame; the region they touch is converted to grey and downsampled on demand.

    The image is downsampled to one or two pixels per point of a template of `size` width and height [px] and `shape`
    rows and columns, so that a large target costs no more than a small one and is not aliased. A patch does not depend
    on those sampled before.
    """

    def __init__(self, image: Image, size: tuple[float, float], shape: tuple[int, int]) -> None:
        self._image, self._size, self._shape = image, size, shape
        self._covered = np.array([np.inf, np.inf, -np.inf, -np.inf])
        self._grey: NDArray[np.uint8]
        self._region: ImageRegion

    def patches(self, placements: FloatArray) -> Patches:
        """Sample the patches of `(N, 6)` placements; see `sample_patches`."""
        reach = 0.5 * (np.abs(placements[:, 2:4]) + np.abs(placements[:, 4:6]))
        near = (placements[:, :2] - reach).min(axis=0)
        far = (placements[:, :2] + reach).max(axis=0)
        if (near < self._covered[:2]).any() or (far > self._covered[2:]).any():
            self._cover(near, far)
        local = placements.copy()
        local[:, :2] -= self._region.origin
        local /= np.tile(self._region.step, 3)
        return sample_patches(self._grey, local, self._shape)

    def _cover(self, near: FloatArray, far: FloatArray) -> None:
        """Extend the region to the corners `near` and `far` [px], with a margin for the particles around them."""
        margin = _MARGIN * max(self._size)
        near, far = np.minimum(near - margin, self._covered[:2]), np.maximum(far + margin, self._covered[2:])
        hull = np.concatenate([near, far - near])
        points = self._shape[1], self._shape[0]
        # Blocks are powers of two: an image of twice the resolution is downsampled to the same pixels.
        block = np.exp2(np.floor(np.log2(np.maximum(np.divide(self._size, points), 1.0)) + 1e-9))
        self._region = block_means(self._image, hull[None], whole_block_size(self._image, block * points, points))
        self._grey = np.asarray(cv2.cvtColor(self._region.pixels, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        self._covered = np.concatenate([near, far])


_MARGIN = 0.3  # Margin of the region, in sizes of the template


def sample_patches(grey: NDArray[np.uint8], placements: FloatArray, shape: tuple[int, int]) -> Patches:
    """`(N, rows * columns)` patches at `(N, 6)` placements, each of mean 0 and variance 1, or all 0 if uniform.

    Sampled bilinearly in an `(H, W)` uint8 image; border pixels are replicated. `shape` is rows and columns of the
    template.
    """
    out = np.empty((len(placements), shape[0] * shape[1]), np.float32)
    _sample(grey, placements, shape[0], shape[1], out)
    return out


@kernel
def _sample(
    grey: NDArray[np.uint8], placements: NDArray[np.float64], rows: int, columns: int, out: NDArray[np.float32]
) -> None:
    """Fill `out` with normalised patches."""
    height, width = grey.shape
    max_x, max_y = np.float32(width - 1), np.float32(height - 1)
    count = rows * columns
    for n in range(placements.shape[0]):
        # Pixel centres lie at half pixels: position 0.5 is the centre of pixel 0.
        cx, cy = placements[n, 0] - 0.5, placements[n, 1] - 0.5
        ux, uy, vx, vy = placements[n, 2], placements[n, 3], placements[n, 4], placements[n, 5]
        reach_x, reach_y = 0.5 * (abs(ux) + abs(vx)), 0.5 * (abs(uy) + abs(vy))
        inside = cx - reach_x >= 0 and cy - reach_y >= 0 and cx + reach_x < width - 1 and cy + reach_y < height - 1
        step_x, step_y = np.float32(ux / columns), np.float32(uy / columns)
        for i in range(rows):
            v, u = (i + 0.5) / rows - 0.5, 0.5 / columns - 0.5
            x0, y0 = np.float32(cx + v * vx + u * ux), np.float32(cy + v * vy + u * uy)
            for j in range(columns):
                x, y = x0 + np.float32(j) * step_x, y0 + np.float32(j) * step_y
                if not inside:
                    x = min(max(x, np.float32(0.0)), max_x)
                    y = min(max(y, np.float32(0.0)), max_y)
                left, top = np.int32(x), np.int32(y)
                right = left + 1 if inside else min(left + 1, width - 1)
                bottom = top + 1 if inside else min(top + 1, height - 1)
                fx, fy = x - np.float32(left), y - np.float32(top)
                corner_top, corner_bottom = np.float32(grey[top, left]), np.float32(grey[bottom, left])
                above = corner_top + (np.float32(grey[top, right]) - corner_top) * fx
                below = corner_bottom + (np.float32(grey[bottom, right]) - corner_bottom) * fx
                out[n, i * columns + j] = above + (below - above) * fy
        total, squares = np.float64(0.0), np.float64(0.0)
        for k in range(count):
            total += out[n, k]
        mean = np.float32(total / count)
        for k in range(count):
            out[n, k] -= mean
            squares += out[n, k] * out[n, k]
        variance = squares / count
        scale = np.float32(1.0 / math.sqrt(variance)) if variance > _FLAT else np.float32(0.0)
        for k in range(count):
            out[n, k] *= scale


_FLAT = 1e-3  # Variances below this [grey levels squared] are rounding errors of a uniform patch
