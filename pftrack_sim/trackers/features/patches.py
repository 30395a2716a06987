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
    down, across = (((np.arange(count) + 0.5) / count - 0.5) for count in shape)
    v, u = np.meshgrid(down, across, indexing="ij")
    points = np.stack([np.ones(u.size), u.ravel(), v.ravel()])
    # OpenCV has pixel centres at whole numbers.
    x, y = (np.asarray(placements[:, axis::2] @ points - 0.5, dtype=np.float32) for axis in (0, 1))
    values, out = grey.astype(np.float32), np.empty(x.shape, np.float32)
    for start in range(0, len(out), _TOGETHER):
        some = slice(start, start + _TOGETHER)
        out[some] = cv2.remap(values, x[some], y[some], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    out -= out.mean(axis=1, keepdims=True, dtype=np.float64)
    variance = np.einsum("ij,ij->i", out, out) / out.shape[1]
    scales = np.divide(1.0, np.sqrt(variance), out=np.zeros_like(variance), where=variance > _FLAT)
    out *= scales[:, None]
    return out


_TOGETHER = 10_000  # Rows of one image: OpenCV allows less than 32768
_FLAT = 1e-3  # Variances below this [grey levels squared] are rounding errors of a uniform patch
