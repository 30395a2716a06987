"""Sensor noise by EMVA 1288: Poisson electrons and Gaussian read noise, clipped and display-coded.

The output of a pixel of a given value has a known distribution over 256 values. Its quantiles are tabulated, so that
a pixel costs one lookup at a random quantile.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from typing import TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.core.photometry import DISPLAY_GAMMA
from pftrack_sim.core.random_streams import stream
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.axes import NoiseAxis

Table: TypeAlias = NDArray[np.uint8]
"""`(256, QUANTILES)` output of a pixel of each value at each quantile."""

QUANTILES = 4096
"""Equally likely outputs of a pixel; the truncated tails lower the variance by less than 0.2 %."""

_EXACT_BELOW_E = 64.0
"""Mean electrons up to which the Poisson distribution is summed term by term.

Above, it is a Gaussian with the skewness of the Poisson distribution (first Edgeworth term): the cumulative
probability is off by less than 0.001.
"""

_STEPS_PER_EV = 16
"""Tables per stop of a changing exposure: the variance is off by 2.2 % at most."""

_TABLES_KEPT = 48


class Noise:
    """Adds independent noise to every frame.

    Args:
        axis: Electrons of white, and read noise.
        seed: Root seed of the episode.
    """

    def __init__(self, axis: NoiseAxis, seed: int) -> None:
        self._white_e = axis.white_e
        self._read_e = axis.severity * axis.read_noise_e
        self._seed = seed
        self._tables: OrderedDict[int, Table] = OrderedDict()

    def read(self, image: Image, index: int, gains: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Image:
        """Read out a frame.

        Args:
            image: `(H, W, 3)` uint8, display-coded, without noise.
            index: Index of the frame in its episode; it selects the random numbers.
            gains: Gains on linear red, green and blue that `image` contains: a pixel amplified by g has 1 / g of the
                electrons.

        Returns:
            `(H, W, 3)` uint8, a new array.
        """
        red, green, blue = (self._table(round(_STEPS_PER_EV * math.log2(gain))) for gain in gains)
        key = stream(self._seed, "sensor", "noise", index).integers(2**64, dtype=np.uint64)
        return _sample(np.ascontiguousarray(image), red, green, blue, key)

    def _table(self, steps: int) -> Table:
        """Table of a gain of `steps / _STEPS_PER_EV` stops; the tables used last are cached."""
        if steps not in self._tables:
            if len(self._tables) >= _TABLES_KEPT:
                self._tables.popitem(last=False)
            self._tables[steps] = quantile_table(self._white_e * 2.0 ** (-steps / _STEPS_PER_EV), self._read_e)
        self._tables.move_to_end(steps)
        return self._tables[steps]


def quantile_table(white_e: float, read_e: float) -> Table:
    """Quantiles of the output of a pixel of each value.

    Args:
        white_e: Electrons of a white pixel.
        read_e: Standard deviation of the read noise [e-].

    Returns:
        `(256, QUANTILES)` uint8, each row ascending.
    """
    values = np.arange(256) / 255.0
    limits = (np.arange(0.5, 255.0) / 255.0) ** DISPLAY_GAMMA
    return _tabulate(white_e * values**DISPLAY_GAMMA, white_e * limits, max(read_e, 1e-9))


@njit(cache=True)
def _tabulate(mean_e: FloatArray, limits_e: FloatArray, read_e: float) -> Table:
    """Quantile table from the mean of each value and the limits between outputs [e-]."""
    table = np.empty((256, QUANTILES), dtype=np.uint8)
    for value in range(256):
        mean = mean_e[value]
        spread = math.sqrt(mean + read_e * read_e)
        filled = 0
        for output in range(255):
            limit = limits_e[output]
            if mean >= _EXACT_BELOW_E and read_e < 0.35:
                # With little read noise the sum is a whole number of electrons (continuity correction).
                limit = math.floor(limit) + 0.5
            z = (limit - mean) / spread
            if z < -9.0:
                continue
            if mean < _EXACT_BELOW_E:
                below = _poisson_and_read(limit, mean, read_e)
            else:
                skew = mean / spread**3
                bell = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
                below = _normal(z) - bell * skew / 6.0 * (z * z - 1.0)
            last = min(QUANTILES, math.floor(below * QUANTILES + 0.5))
            while filled < last:
                table[value, filled] = output
                filled += 1
            if filled == QUANTILES or z > 9.0:
                break
        while filled < QUANTILES:
            table[value, filled] = 255
            filled += 1
    return table


@njit(cache=True)
def _normal(z: float) -> float:
    """Cumulative standard normal distribution."""
    return 0.5 * math.erfc(-z / math.sqrt(2.0))


@njit(cache=True)
def _poisson_and_read(limit_e: float, mean_e: float, read_e: float) -> float:
    """Probability that Poisson electrons plus read noise are below a limit."""
    term = math.exp(-mean_e)
    total = 0.0
    last = int(mean_e + 8.0 * math.sqrt(mean_e) + 12.0)
    for count in range(last + 1):
        total += term * _normal((limit_e - count) / read_e)
        term *= mean_e / (count + 1.0)
    return total


@njit(cache=True)
def _sample(image: Image, red: Table, green: Table, blue: Table, key: np.uint64) -> Image:
    """Draw every pixel at a random quantile.

    Random numbers are those of SplitMix64 (Steele, Lea and Flood 2014, "Fast splittable pseudorandom number
    generators"): 36 of 64 bits serve the three channels of a pixel.
    """
    height, width = image.shape[0], image.shape[1]
    out = np.empty_like(image)
    state = key
    for row in range(height):
        for column in range(width):
            state += np.uint64(0x9E3779B97F4A7C15)
            bits = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
            bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
            bits = bits ^ (bits >> np.uint64(31))
            out[row, column, 0] = red[image[row, column, 0], bits & np.uint64(4095)]
            out[row, column, 1] = green[image[row, column, 1], (bits >> np.uint64(12)) & np.uint64(4095)]
            out[row, column, 2] = blue[image[row, column, 2], (bits >> np.uint64(24)) & np.uint64(4095)]
    return out
