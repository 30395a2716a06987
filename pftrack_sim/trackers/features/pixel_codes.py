"""Pixel codes: images of colour bins or of texture patterns, from which histograms are counted."""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.core.records import Image

PATTERN_COUNT = 16


def rgb_codes(image: Image, bin_count: int) -> NDArray[np.uint8]:
    """`(H, W, 3)` bins of red, green and blue; their number per channel is a power of two, at most 256."""
    return image >> _shift(bin_count)


def hsv_codes(image: Image, bin_count: int) -> NDArray[np.uint8]:
    """`(H, W, 3)` bins of hue, saturation and value (Ko et al. 2012, section 2.1), as those of `rgb_codes`."""
    codes = _hsv(image)
    return np.right_shift(codes, _shift(bin_count), out=codes)


def hsv_joint_codes(image: Image, bin_counts: tuple[int, int, int]) -> NDArray[np.uint8]:
    """`(H, W, 1)` bins of a joint histogram of hue, saturation and value (Lee et al. 2012, section III.1).

    The numbers of bins are powers of two whose product is at most 256.
    """
    out = np.empty((*image.shape[:2], 1), np.uint8)
    _join(_hsv(image).reshape(-1, 3), bin_counts, tuple(_shift(count) for count in bin_counts), out.reshape(-1))
    return out


@njit(nogil=True, cache=True)
def _join(
    hsv: NDArray[np.uint8], counts: tuple[int, int, int], shifts: tuple[np.uint8, ...], out: NDArray[np.uint8]
) -> None:
    """Fill `(N,)` with the joint bins of `(N, 3)` pixels."""
    for i in range(out.size):
        hue, saturation, value = hsv[i, 0] >> shifts[0], hsv[i, 1] >> shifts[1], hsv[i, 2] >> shifts[2]
        out[i] = np.uint8((hue * counts[1] + saturation) * counts[2] + value)


def _hsv(image: Image) -> NDArray[np.uint8]:
    """`(H, W, 3)` HSV with hue in 0..255: OpenCV's usual 180 steps are not divisible into equal bins."""
    return _converted(image, cv2.COLOR_RGB2HSV_FULL).reshape(image.shape)


def _converted(image: Image, code: int) -> NDArray[np.uint8]:
    """The pixels of an `(H, W, 3)` image in another colour space, as one row.

    The last pixels of a row that fill no vector are converted one by one, with the same values: of one row there are
    few, of a narrow region up to a third.
    """
    return np.asarray(cv2.cvtColor(image.reshape(1, -1, 3), code), dtype=np.uint8)


def _shift(bin_count: int) -> np.uint8:
    """Right shift that maps a byte to its bin."""
    return np.uint8(8 - (bin_count.bit_length() - 1))


def cs_lbp_codes(image: Image) -> NDArray[np.uint8]:
    """`(H, W, 1)` centre-symmetric local binary patterns 0..15, 8 neighbours at radius 1 (Ko et al. 2012, eq. 2, 3).

    Bit i is set when n_i - n_{i+4} >= 1, where n_0 is the right neighbour and i counts anticlockwise, in grey by ITU-R
    BT.601. The printed sum ends one pair too early; the text and the figure have the four pairs that make 16 patterns.
    Border pixels are replicated.
    """
    grey = _converted(image, cv2.COLOR_RGB2GRAY).reshape(image.shape[:2])
    grey = cv2.copyMakeBorder(grey, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    out = np.empty((image.shape[0], image.shape[1], 1), np.uint8)
    _cs_lbp(np.asarray(grey, dtype=np.uint8), out)
    return out


@njit(nogil=True, cache=True)
def _cs_lbp(grey: NDArray[np.uint8], out: NDArray[np.uint8]) -> None:
    """Fill `out` with the patterns of an image that has a border of one pixel."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            code = 0
            if grey[i + 1, j + 2] > grey[i + 1, j]:
                code |= 1
            if grey[i, j + 2] > grey[i + 2, j]:
                code |= 2
            if grey[i, j + 1] > grey[i + 2, j + 1]:
                code |= 4
            if grey[i, j] > grey[i + 2, j + 2]:
                code |= 8
            out[i, j, 0] = code
