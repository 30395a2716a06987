"""Haar-like centre-surround features: the mean over the centre of a region minus that over all of it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.integral import channel_means, integral_image

CHANNEL_COUNT = 3
_OPPONENTS = np.array([[1 / 3, 1 / 3, 1 / 3], [0.5, -0.5, 0.0], [-0.25, -0.25, 0.5]], np.float32)


def opponent_integral(image: Image) -> FloatArray:
    """`(H + 1, W + 1, 3)` integral image of intensity, red minus green and blue minus yellow."""
    return integral_image(np.asarray(cv2.transform(image.astype(np.float32), _OPPONENTS)))


@dataclass(frozen=True, eq=False)
class CentreSurround:
    """A set of features; feature `region * CHANNEL_COUNT + channel` belongs to one region and one channel.

    Attributes:
        regions: `(R, 4)` regions in shares of a box.
        centres: `(R, 4)` their centres.
    """

    regions: FloatArray
    centres: FloatArray

    @property
    def size(self) -> int:
        """Number of features."""
        return len(self.regions) * CHANNEL_COUNT

    def values(self, integral: FloatArray, boxes: FloatArray, chosen: NDArray[np.intp] | None = None) -> FloatArray:
        """`(N, T)` values of the `(T,)` chosen features, or of all, in `(N, 4)` boxes [px]."""
        if chosen is None:
            return self._of(integral, boxes, slice(None)).reshape(len(boxes), -1)
        regions, place = np.unique(chosen // CHANNEL_COUNT, return_inverse=True)
        return self._of(integral, boxes, regions)[:, place, chosen % CHANNEL_COUNT]

    def _of(self, integral: FloatArray, boxes: FloatArray, regions: NDArray[np.intp] | slice) -> FloatArray:
        """`(N, R, 3)` values of some regions."""
        rectangles = np.concatenate([self.centres[regions], self.regions[regions]])
        means = channel_means(integral, boxes, rectangles)
        count = len(rectangles) // 2
        return means[:, :count] - means[:, count:]


def grid_of_regions(divisions: int, centre: float) -> CentreSurround:
    """Regions of twice the side of a box, and of 1/1, 1/2, ... 1/`divisions` of it, each half over the next.

    The grid reaches half a region beyond the box, so that some regions have one half on the target and the other on its
    surround. `centre` is the side of a region's centre as a share of the region's; with 1/2 the largest region's centre
    is the box.
    """
    regions = [(-0.5, -0.5, 2.0, 2.0)]
    for count in range(1, divisions + 1):
        side = 1.0 / count
        places = 0.5 * side * np.arange(-1, 2 * count)
        regions += [(x, y, side, side) for y in places for x in places]
    found = np.array(regions)
    centres = found.copy()
    centres[:, :2] += 0.5 * (1.0 - centre) * found[:, 2:]
    centres[:, 2:] *= centre
    return CentreSurround(found, centres)
