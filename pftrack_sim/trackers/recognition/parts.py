"""Colours of a target's parts, by which it is told from others and from what covers it.

A box is compared by three histograms, of its upper, middle and lower part (of a person head, trunk and legs), in the
middle half of its width, where the background of an elongated target is least. Their mean Bhattacharyya coefficient
with those of the target is the likeness (Comaniciu, Ramesh and Meer 2003, "Kernel-based object tracking", eq. 6).
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.recognition.pyramid import ImagePyramid

PARTS = ((0.0, 0.17), (0.17, 0.5), (0.5, 0.92))
"""Spans of the height, without the feet: between steps the ground shows beside them."""
SIDE_PX = 48  # Side of the patch that is described
BINS = 8  # of each channel of CIE Lab
_LIGHTNESS_WIDTH = 256 // BINS  # Of a bin, as OpenCV scales lightness
_CHROMA_FIRST, _CHROMA_WIDTH = 96, 8  # Where the bins of a and b begin (grey is 128), and their width
FIRST_LIKENESS = 0.85  # Usual likeness before any was seen
RATE = 0.01  # Least weight of a new frame

_NEIGHBOURS = 0.25 * (np.eye(BINS, k=1) + 2.0 * np.eye(BINS) + np.eye(BINS, k=-1))
_SMOOTHING = (_NEIGHBOURS / _NEIGHBOURS.sum(axis=0)).astype(np.float32)
"""Each bin shared with its neighbours in its channel: a change of light moves colours a little."""

Histograms = NDArray[np.float32]


def describe(pyramid: ImagePyramid, centre: FloatArray, size: FloatArray) -> Histograms:
    """`(3, BINS^3)` histograms of the parts of a box of `(2,)` width and height [px] around `(2,)` x, y."""
    width, height = (SIDE_PX * float(side) / float(size.max()) for side in size)
    lab = cv2.cvtColor(pyramid.patch(centre, float(size.max()), SIDE_PX), cv2.COLOR_RGB2LAB)
    lightness, *chroma = (one.astype(np.int32) for one in cv2.split(lab))
    red_green, blue_yellow = (np.clip((one - _CHROMA_FIRST) // _CHROMA_WIDTH, 0, BINS - 1) for one in chroma)
    bins = ((lightness // _LIGHTNESS_WIDTH) * BINS + red_green) * BINS + blue_yellow
    half = max(0.25 * width, 2.0)
    left, right = int(0.5 * SIDE_PX - half), math.ceil(0.5 * SIDE_PX + half)
    top = 0.5 * (SIDE_PX - height)
    counts = np.empty((len(PARTS), BINS**3), np.float32)
    for count, (start, stop) in zip(counts, PARTS, strict=True):
        first = int(top + start * height)
        pixels = bins[first : max(int(top + stop * height), first + 2), left:right]
        count[:] = np.bincount(pixels.ravel(), minlength=BINS**3)
    shares = (counts / counts.sum(axis=1, keepdims=True)).reshape(-1, BINS, BINS, BINS)
    smooth = (_SMOOTHING @ (shares @ _SMOOTHING.T)).reshape(-1, BINS, BINS * BINS)
    return np.asarray(_SMOOTHING @ smooth, dtype=np.float32).reshape(len(PARTS), -1)


class PartColours:
    """Running means of the target's histograms, and of the likeness that it usually has with them."""

    def __init__(self, first: Histograms) -> None:
        self._means = first.copy()
        self._usual, self._count = FIRST_LIKENESS, 1

    describe = staticmethod(describe)

    def follow(self, found: Histograms, likeness: float, *, close_up: bool = False) -> float:
        """The likeness itself: colours do not tell a gradual change from another target."""
        return likeness

    def is_covered(self, found: Histograms) -> bool:
        """Always: all that is known of a target that is no person is how alike it is."""
        return True

    def off(self, found: Histograms) -> None:
        """Nothing: colours say no place."""

    correction = off

    def likeness(self, found: Histograms) -> float:
        """Likeness of `(3, BINS^3)` histograms with the target's, as a share of what is usual for the target."""
        return float(np.sqrt(self._means * found).sum(axis=1).mean()) / self._usual

    def learn(self, found: Histograms, trust: float) -> None:
        """Learn histograms of the target with weight `trust` in [0, 1]."""
        likeness = self.likeness(found)
        self._count += 1
        rate = max(1.0 / self._count, RATE) * trust  # a mean of the first frames, then a slow one
        self._means += np.float32(rate) * (found - self._means)
        self._usual *= 1.0 + rate * (likeness - 1.0)
