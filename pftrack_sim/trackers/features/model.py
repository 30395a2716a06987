"""A target's appearance in several features, and how like it every particle's box is."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.boxes import Box
from pftrack_sim.trackers.features.histogram import BinLayout, histogram, similarities


@dataclass(frozen=True, eq=False)
class Feature:
    """One way of looking at a box.

    Attributes:
        encode: From `(H, W, 3)` uint8 RGB to the `(H, W, C)` code image.
        layout: How the points of a box fill its histogram.
    """

    encode: Callable[[NDArray[np.uint8]], NDArray[np.uint8]]
    layout: BinLayout


class HistogramModel:
    """One histogram per feature, taken from the first frame and never changed.

    Args:
        features: What is looked at.
        image: `(H, W, 3)` uint8 RGB.
        box: `(4,)` the target's box [px].
    """

    def __init__(self, features: Sequence[Feature], image: NDArray[np.uint8], box: Box) -> None:
        self.features = tuple(features)
        part, corner = window(image, box[None])
        self.histograms = tuple(histogram(one.encode(part), box - corner, one.layout) for one in self.features)

    def look(self, image: NDArray[np.uint8], boxes: NDArray[np.float64]) -> Look:
        """Look at the part of an image that these boxes touch: what costs most, done once for all of them.

        Args:
            image: `(H, W, 3)` uint8 RGB.
            boxes: `(N, 4)` boxes [px].
        """
        part, corner = window(image, boxes)
        return Look(self, tuple(one.encode(part) for one in self.features), corner)

    def similarities(self, image: NDArray[np.uint8], boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """`(F, N)` Bhattacharyya coefficients of boxes in an image: `look`, and then `Look.similarities`."""
        return self.look(image, boxes).similarities(boxes)


@dataclass(frozen=True, eq=False)
class Look:
    """A part of an image, seen in every feature of a model.

    Attributes:
        model: What boxes are compared with.
        codes: The part's code image in each feature.
        corner: `(4,)` x, y of the part in the image [px], 0, 0.
    """

    model: HistogramModel
    codes: tuple[NDArray[np.uint8], ...]
    corner: NDArray[np.float64]

    def similarities(self, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Bhattacharyya coefficient of every box with the model, feature by feature.

        Args:
            boxes: `(N, 4)` boxes [px] in the image, none reaching farther than those that were given to `look`.

        Returns:
            `(F, N)` numbers in [0, 1], 1 for identical; the distance of Ko et al. 2012, eq. 7, is `sqrt(1 - it)`.
        """
        local = boxes - self.corner
        out = np.empty((len(self.codes), len(boxes)))
        for index, one in enumerate(self.model.features):
            out[index] = similarities(self.codes[index], local, one.layout, self.model.histograms[index])
        return out


def window(image: NDArray[np.uint8], boxes: NDArray[np.float64]) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """The part of the image that the boxes touch.

    Converting colours costs more than comparing particles, so only this part is converted. One pixel more on every
    side keeps texture patterns at its border what they are in the whole image.

    Args:
        image: `(H, W, 3)` uint8 RGB.
        boxes: `(N, 4)` boxes [px].

    Returns:
        `(h, w, 3)` part of the image, at least one pixel, and `(4,)` its x and y in the image [px], 0, 0: boxes less
        this are boxes in the part.
    """
    height, width = image.shape[:2]
    near = boxes[:, :2].min(axis=0)
    far = (boxes[:, :2] + boxes[:, 2:]).max(axis=0)
    left = min(max(math.floor(near[0]) - 1, 0), width - 1)
    top = min(max(math.floor(near[1]) - 1, 0), height - 1)
    right = max(min(math.ceil(far[0]) + 1, width), left + 1)
    bottom = max(min(math.ceil(far[1]) + 1, height), top + 1)
    return np.ascontiguousarray(image[top:bottom, left:right]), np.array([left, top, 0.0, 0.0])
