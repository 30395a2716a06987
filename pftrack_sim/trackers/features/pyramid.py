"""Patches of an image at any scale, from a pyramid of halved images."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray

MIN_SIDE_PX = 4


class ImagePyramid:
    """An image and its halves, each level the mean of 2x2 pixels of the one below; levels are made on demand.

    Args:
        image: `(H, W, 3)` uint8 RGB.
    """

    def __init__(self, image: Image) -> None:
        self._levels = [image]
        self._grey: dict[int, NDArray[np.uint8]] = {}

    @property
    def image(self) -> Image:
        """`(H, W, 3)` the image itself."""
        return self._levels[0]

    def grey(self, level: int) -> NDArray[np.uint8]:
        """`(H, W)` grey image of a level."""
        if level not in self._grey:
            self._grey[level] = np.asarray(cv2.cvtColor(self._levels[level], cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        return self._grey[level]

    def level(self, step: float) -> int:
        """The level whose pixels best fit samples that are `step` pixels of the image apart."""
        # A level is left when samples would lie 1.57 of its pixels apart: later they alias, earlier they blur.
        wanted = max(math.floor(math.log2(max(step, 1.0)) + 0.35), 0)
        while len(self._levels) <= wanted:
            finest = self._levels[-1]
            rows, columns = finest.shape[0] // 2, finest.shape[1] // 2
            if min(rows, columns) < MIN_SIDE_PX:
                break
            even = finest[: 2 * rows, : 2 * columns]
            self._levels.append(np.asarray(cv2.resize(even, (columns, rows), interpolation=cv2.INTER_AREA), np.uint8))
        return min(wanted, len(self._levels) - 1)

    def patch(self, centre: FloatArray, size: tuple[float, float], shape: tuple[int, int]) -> Image:
        """A part of the image, resampled to `shape`; border pixels are replicated.

        Args:
            centre: `(2,)` x, y of its centre [px].
            size: Width and height [px].
            shape: Columns and rows of the result.

        Returns:
            `(rows, columns, 3)` uint8 RGB.
        """
        level = self.level(min(size[0] / shape[0], size[1] / shape[1]))
        return self._warp(self._levels[level], level, centre, size, shape)

    def grey_patch(self, centre: FloatArray, size: tuple[float, float], shape: tuple[int, int]) -> NDArray[np.uint8]:
        """`(rows, columns)` grey patch; arguments as of `patch`."""
        level = self.level(min(size[0] / shape[0], size[1] / shape[1]))
        return self._warp(self.grey(level), level, centre, size, shape)

    @staticmethod
    def _warp(
        pixels: NDArray[np.uint8], level: int, centre: FloatArray, size: tuple[float, float], shape: tuple[int, int]
    ) -> NDArray[np.uint8]:
        shrink = 0.5**level
        step_x, step_y = (shrink * size[axis] / shape[axis] for axis in (0, 1))
        # OpenCV has pixel centres at whole numbers.
        left = shrink * (float(centre[0]) - 0.5 * size[0]) + 0.5 * step_x - 0.5
        top = shrink * (float(centre[1]) - 0.5 * size[1]) + 0.5 * step_y - 0.5
        matrix = np.array([[step_x, 0.0, left], [0.0, step_y, top]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        out = cv2.warpAffine(pixels, matrix, shape, flags=flags, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(out, dtype=np.uint8)
