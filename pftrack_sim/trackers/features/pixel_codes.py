"""Pixel codes: images of colour bins or of texture patterns, from which histograms are counted."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.records import Image


def rgb_codes(image: Image, bin_count: int) -> NDArray[np.uint8]:
    """`(H, W, 3)` bins of red, green and blue; their number per channel is a power of two, at most 256."""
    return image >> _shift(bin_count)


def hsv_codes(image: Image, bin_count: int) -> NDArray[np.uint8]:
    """`(H, W, 3)` bins of hue, saturation and value (Ko et al. 2012, section 2.1), as those of `rgb_codes`."""
    codes = _hsv(image)
    return np.right_shift(codes, _shift(bin_count), out=codes)


JOINT_COUNT = 256
"""Codes of `hsv_joint_codes`."""


def hsv_joint_codes(image: Image) -> NDArray[np.uint8]:
    """`(H, W, 1)` bins of a joint histogram of 8 hues, 8 saturations and 4 values (Lee et al. 2012, section III.1)."""
    # NumPy takes twice as long for strides of three.
    hue, saturation, value = (np.asarray(one, dtype=np.uint8) for one in cv2.split(_hsv(image)))
    return (hue & np.uint8(0b11100000) | saturation >> np.uint8(5) << np.uint8(2) | value >> np.uint8(6))[..., None]


def _hsv(image: Image) -> NDArray[np.uint8]:
    """`(H, W, 3)` HSV with hue in 0..255: OpenCV's usual 180 steps are not divisible into equal bins."""
    # As one row: OpenCV converts the last pixels of each row, which fill no vector, one by one.
    converted = cv2.cvtColor(image.reshape(1, -1, 3), cv2.COLOR_RGB2HSV_FULL)
    return np.asarray(converted, dtype=np.uint8).reshape(image.shape)


def _shift(bin_count: int) -> np.uint8:
    """Right shift that maps a byte to its bin."""
    return np.uint8(8 - (bin_count.bit_length() - 1))


def cs_lbp_codes(image: Image) -> NDArray[np.uint8]:
    """`(H, W, 1)` centre-symmetric local binary patterns 0..15, 8 neighbours at radius 1 (Ko et al. 2012, eq. 2, 3).

    Bit i is set when n_i - n_{i+4} >= 1, where n_0 is the right neighbour and i counts anticlockwise, in grey by ITU-R
    BT.601. The printed sum ends one pair too early; the text and the figure have the four pairs that make 16 patterns.
    Border pixels are replicated.
    """
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    grey = np.asarray(cv2.copyMakeBorder(grey, 1, 1, 1, 1, cv2.BORDER_REPLICATE), dtype=np.uint8)
    above, beside, below = grey[:-2], grey[1:-1], grey[2:]
    pairs = (
        (beside[:, 2:], beside[:, :-2]),
        (above[:, 2:], below[:, :-2]),
        (above[:, 1:-1], below[:, 1:-1]),
        (above[:, :-2], below[:, 2:]),
    )
    # OpenCV's comparison gives 255, where NumPy's takes three times as long for rows that are not contiguous.
    codes = np.zeros(image.shape[:2], np.uint8)
    for bit, pair in enumerate(pairs):
        codes |= np.asarray(cv2.compare(*pair, cv2.CMP_GT), dtype=np.uint8) & np.uint8(1 << bit)
    return codes[..., None]
