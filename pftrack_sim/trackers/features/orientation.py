"""Edge orientations as channels of an image, to be summed over rectangles by integral images."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

_SOBEL_PX = 3


def orientation_channels(grey: NDArray[np.uint8], bin_count: int) -> NDArray[np.float32]:
    """`(H, W, bin_count)` gradient magnitude (Sobel, 3x3) of every pixel, in the channel of its edge's orientation.

    The first bin begins at a horizontal gradient; orientations are those of lines, 0 to 180 degrees, so that a dark
    target on a bright background has those of a bright one on a dark background.
    """
    right = np.asarray(cv2.Sobel(grey, cv2.CV_32F, 1, 0, ksize=_SOBEL_PX), dtype=np.float32)
    down = np.asarray(cv2.Sobel(grey, cv2.CV_32F, 0, 1, ksize=_SOBEL_PX), dtype=np.float32)
    angle = np.mod(np.arctan2(down, right), np.float32(np.pi))
    bins = np.minimum((angle * np.float32(bin_count / np.pi)).astype(np.intp), bin_count - 1)
    out = np.zeros((*grey.shape, bin_count), np.float32)
    np.put_along_axis(out, bins[..., None], np.hypot(right, down)[..., None], axis=2)
    return out
