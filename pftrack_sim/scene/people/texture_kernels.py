"""Kernels that paint garments and heads: pixel by pixel the steps of formulas on arrays, with the same rounding."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.core.types import FloatArray


class Details(NamedTuple):
    """What is sewn on a garment of `h` rows and `w` columns, after its pattern and folds.

    Attributes:
        row_factors: `(h,)` brightness of the rows.
        column_factors: `(w,)` brightness of the columns.
        spot_rows: `(h,)` rows of buttons or laces.
        spot_columns: `(w,)` columns of buttons or laces.
        spot_share: Share of their colour.
        spot_colour: `(3,)` their colour.
        accent_row: First row that has the colour of the accent alone.
    """

    row_factors: FloatArray
    column_factors: FloatArray
    spot_rows: NDArray[np.bool_]
    spot_columns: NDArray[np.bool_]
    spot_share: float
    spot_colour: FloatArray
    accent_row: int


@njit(cache=True, nogil=True)
def dye(
    colours: FloatArray,
    row_shares: FloatArray,
    column_shares: FloatArray,
    shares: FloatArray,
    folds: FloatArray,
    details: Details,
) -> NDArray[np.uint8]:
    """A garment's `(h, w, 3)` texture.

    Args:
        colours: `(2, 3)` main colour and accent.
        row_shares: `(h,)` shares of the accent by row, to which those by column are added.
        column_shares: `(w,)` shares of the accent by column.
        shares: `(h, w)` shares of the accent by pixel instead, or empty.
        folds: `(h, w)` factors of the brightness.
        details: What is sewn on.
    """
    height, width = folds.shape
    image = np.empty((height, width, 3), np.uint8)
    share, values = np.empty(width), np.empty(width)
    for row in range(height):
        if row >= details.accent_row:
            for column in range(width):
                for channel in range(3):
                    image[row, column, channel] = np.uint8(colours[1, channel])
            continue
        for column in range(width):
            share[column] = row_shares[row] + column_shares[column]
        if shares.size > 0:
            share[:] = shares[row]
        # Short loops without branches, which the processor does for several columns at a time.
        for channel in range(3):
            main, accent = colours[0, channel], colours[1, channel]
            for column in range(width):
                mixed = main * (1.0 - share[column]) + accent * share[column]
                values[column] = mixed * folds[row, column] * details.column_factors[column]
            if details.spot_rows[row]:
                added = details.spot_share * details.spot_colour[channel]
                for column in range(width):
                    if details.spot_columns[column]:
                        values[column] = (1.0 - details.spot_share) * values[column] + added
            for column in range(width):
                value = np.rint(values[column] * details.row_factors[row])
                image[row, column, channel] = np.uint8(min(max(value, 0.0), 255.0))
    return image


@njit(cache=True, nogil=True)
def mix(image: FloatArray, row: int, column: int, share: FloatArray, colour: FloatArray) -> None:
    """Mix a `(h, w)` share of a `(3,)` colour into a `(3, H, W)` image, from a row and a column on."""
    height, width = share.shape
    for channel in range(3):
        value = colour[channel]
        for down in range(height):
            for right in range(width):
                present = image[channel, row + down, column + right]
                image[channel, row + down, column + right] = present + (value - present) * share[down, right]


@njit(cache=True, nogil=True)
def interleaved(image: FloatArray) -> NDArray[np.uint8]:
    """`(h, w, 3)` pixels of a `(3, h, w)` image, clipped to 0 to 255 and rounded down."""
    _, height, width = image.shape
    pixels = np.empty((height, width, 3), np.uint8)
    for row in range(height):
        for column in range(width):
            for channel in range(3):
                pixels[row, column, channel] = np.uint8(min(max(image[channel, row, column], 0.0), 255.0))
    return pixels
