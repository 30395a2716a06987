"""A target's appearance in several features, and how like it every particle's box is."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.boxes import Box
from pftrack_sim.trackers.appearance.histogram import Layout, histogram, similarities


@dataclass(frozen=True, eq=False)
class Feature:
    """One way of looking at a box.

    Attributes:
        encode: From `(H, W, 3)` uint8 RGB to the `(H, W, C)` code image.
        layout: How the points of a box fill its histogram.
    """

    encode: Callable[[NDArray[np.uint8]], NDArray[np.uint8]]
    layout: Layout


class HistogramModel:
    """One histogram per feature, taken from the first frame and never changed.

    Args:
        features: What is looked at.
        image: `(H, W, 3)` uint8 RGB.
        box: `(4,)` the target's box [px].
    """

    def __init__(self, features: Sequence[Feature], image: NDArray[np.uint8], box: Box) -> None:
        self.features = tuple(features)
        window, local = _window(image, box[None])
        self.histograms = tuple(histogram(one.encode(window), local[0], one.layout) for one in self.features)

    def similarities(self, image: NDArray[np.uint8], boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Bhattacharyya coefficient of every box with the model, feature by feature.

        Args:
            image: `(H, W, 3)` uint8 RGB.
            boxes: `(N, 4)` boxes [px].

        Returns:
            `(F, N)` numbers in [0, 1], 1 for identical; the distance of Ko et al. 2012, eq. 7, is `sqrt(1 - it)`.
        """
        window, local = _window(image, boxes)
        pairs = zip(self.features, self.histograms, strict=True)
        return np.stack([similarities(one.encode(window), local, one.layout, model) for one, model in pairs])


def _window(image: NDArray[np.uint8], boxes: NDArray[np.float64]) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """The part of the image that the boxes touch, and the boxes in its coordinates.

    Converting colours costs more than comparing particles, so only this part is converted. One pixel more on every
    side keeps texture patterns at its border what they are in the whole image.
    """
    height, width = image.shape[:2]
    near = boxes[:, :2].min(axis=0)
    far = (boxes[:, :2] + boxes[:, 2:]).max(axis=0)
    left = min(max(math.floor(near[0]) - 1, 0), width - 1)
    top = min(max(math.floor(near[1]) - 1, 0), height - 1)
    right = max(min(math.ceil(far[0]) + 1, width), left + 1)
    bottom = max(min(math.ceil(far[1]) + 1, height), top + 1)
    return np.ascontiguousarray(image[top:bottom, left:right]), boxes - np.array([left, top, 0.0, 0.0])
