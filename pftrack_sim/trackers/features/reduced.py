"""The part of an image that boxes touch, made smaller, so that a large box costs no more than a small one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Reduced:
    """A part of an image whose pixels are means of blocks of the image's.

    Attributes:
        pixels: `(h, w, 3)` uint8 RGB.
        origin: `(2,)` x, y of its corner in the image [px].
        step: `(2,)` width and height of a block, whole numbers [px].
    """

    pixels: NDArray[np.uint8]
    origin: NDArray[np.float64]
    step: NDArray[np.float64]

    def local(self, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """`(N, 4)` boxes in its own pixels, given boxes in the image's."""
        return np.concatenate([(boxes[:, :2] - self.origin) / self.step, boxes[:, 2:] / self.step], axis=1)


def reduced(
    image: NDArray[np.uint8], boxes: NDArray[np.float64], size: tuple[float, float], points: tuple[int, int]
) -> Reduced:
    """What boxes touch, with at least as many pixels to a box of `size` as there are points to read in it.

    Blocks lie on a grid fixed to the image, so that what stands still looks the same wherever the boxes are. One block
    more on every side is there for reading between blocks.

    Args:
        image: `(H, W, 3)` uint8 RGB.
        boxes: `(N, 4)` boxes [px].
        size: Width and height of a typical box [px].
        points: Columns and rows that will be read in a box.
    """
    near = boxes[:, :2].min(axis=0)
    far = (boxes[:, :2] + boxes[:, 2:]).max(axis=0)
    starts: list[int] = []
    stops: list[int] = []
    steps: list[int] = []
    for axis, room in enumerate((image.shape[1], image.shape[0])):
        # Never so coarse that the image itself has fewer blocks than there are points.
        step = max(min(math.floor(size[axis] / points[axis]), room // points[axis]), 1)
        blocks = room // step
        first = min(max(math.floor(near[axis] / step) - 1, 0), blocks - 1)
        last = max(min(math.ceil(far[axis] / step) + 1, blocks), first + 1)
        starts.append(first * step)
        stops.append(last * step)
        steps.append(step)
    part = image[starts[1] : stops[1], starts[0] : stops[0]]
    if steps == [1, 1]:
        pixels = np.ascontiguousarray(part)
    else:
        shape = ((stops[0] - starts[0]) // steps[0], (stops[1] - starts[1]) // steps[1])
        pixels = np.asarray(cv2.resize(part, shape, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    return Reduced(pixels, np.array(starts, dtype=np.float64), np.array(steps, dtype=np.float64))
