"""Colour as code images: each channel's value divided into bins."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def rgb_codes(image: NDArray[np.uint8], bin_count: int) -> NDArray[np.uint8]:
    """`(H, W, 3)` bins of red, green and blue.

    Args:
        image: `(H, W, 3)` uint8 RGB.
        bin_count: Bins per channel: a power of two, at most 256.
    """
    return image >> _shift(bin_count)


def hsv_codes(image: NDArray[np.uint8], bin_count: int) -> NDArray[np.uint8]:
    """`(H, W, 3)` bins of hue, saturation and value (Ko et al. 2012, section 2.1).

    Args:
        image: `(H, W, 3)` uint8 RGB.
        bin_count: Bins per channel: a power of two, at most 256.
    """
    return _hsv(image) >> _shift(bin_count)


def hsv_joint_codes(image: NDArray[np.uint8], bin_counts: tuple[int, int, int]) -> NDArray[np.uint8]:
    """`(H, W, 1)` bins of a histogram over hue, saturation and value together (Lee et al. 2012, section III.1).

    Args:
        image: `(H, W, 3)` uint8 RGB.
        bin_counts: Bins of hue, saturation and value: powers of two whose product is at most 256.
    """
    shifts = np.array([_shift(count) for count in bin_counts], dtype=np.uint8)
    strides = np.array([bin_counts[1] * bin_counts[2], bin_counts[2], 1.0])
    summed = cv2.transform(_hsv(image) >> shifts, strides[None])
    return np.asarray(summed, dtype=np.uint8).reshape(*image.shape[:2], 1)


def _hsv(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Hue over the whole range of a byte, which OpenCV's usual 180 steps do not divide evenly into bins."""
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2HSV_FULL), dtype=np.uint8)


def _shift(bin_count: int) -> np.uint8:
    """By how many bits a byte is shifted to become a bin."""
    return np.uint8(8 - (bin_count.bit_length() - 1))
