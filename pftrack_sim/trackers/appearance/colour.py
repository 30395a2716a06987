"""Colour as code images: each channel's value divided into bins."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

HUE_COUNT = 180  # OpenCV's 8-bit hue is in steps of two degrees


def rgb_codes(image: NDArray[np.uint8], bin_count: int) -> NDArray[np.uint8]:
    """`(H, W, 3)` bins of red, green and blue.

    Args:
        image: `(H, W, 3)` uint8 RGB.
        bin_count: Bins per channel, at most 256.
    """
    return cv2.LUT(image, _table(256, bin_count))  # pyright: ignore[reportReturnType]


def hsv_codes(image: NDArray[np.uint8], bin_count: int) -> NDArray[np.uint8]:
    """`(H, W, 3)` bins of hue, saturation and value (Ko et al. 2012, section 2.1).

    Args:
        image: `(H, W, 3)` uint8 RGB.
        bin_count: Bins per channel, at most 256; hue's 180 steps are spread over all of them.
    """
    hsv = cv2.cvtColor(image, cv2.COLOR_RGB2HSV)
    return cv2.LUT(hsv, _hsv_tables(bin_count))  # pyright: ignore[reportReturnType]


def hsv_joint_codes(image: NDArray[np.uint8], bin_counts: tuple[int, int, int]) -> NDArray[np.uint8]:
    """`(H, W, 1)` bins of a histogram over hue, saturation and value together (Lee et al. 2012, section III.1).

    Args:
        image: `(H, W, 3)` uint8 RGB.
        bin_counts: Bins of hue, saturation and value; their product is at most 256.
    """
    hues, saturations, values = bin_counts
    hsv = cv2.cvtColor(image, cv2.COLOR_RGB2HSV)
    strides = (saturations * values, values, 1)
    channels = [
        _table(count, bins) * np.uint8(stride)
        for count, bins, stride in zip((HUE_COUNT, 256, 256), (hues, saturations, values), strides, strict=True)
    ]
    parts = cv2.LUT(hsv, np.stack(channels, axis=-1)[None])
    summed = np.asarray(cv2.transform(parts, np.ones((1, 3))), dtype=np.uint8)
    return summed.reshape(*image.shape[:2], 1)


@lru_cache(maxsize=8)
def _hsv_tables(bin_count: int) -> NDArray[np.uint8]:
    """`(1, 256, 3)` bins of each channel's values: OpenCV takes a row of 256 three-channel pixels."""
    channels = [_table(HUE_COUNT, bin_count), _table(256, bin_count), _table(256, bin_count)]
    tables = np.stack(channels, axis=-1)[None]
    tables.setflags(write=False)
    return tables


def _table(value_count: int, bin_count: int) -> NDArray[np.uint8]:
    """`(256,)` bin of each value."""
    values = np.minimum(np.arange(256), value_count - 1)
    return (values * bin_count // value_count).astype(np.uint8)
