"""Sensor noise by EMVA 1288: Poisson electrons and Gaussian read noise, clipped and display-coded.

The output of a pixel of a given value has a known distribution over 256 values. Its quantiles are tabulated, so that
a pixel costs one lookup at a random quantile.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TypeAlias

import numpy as np
import scipy  # it imports its packages at first use
from numpy.typing import NDArray

from pftrack_sim.core.compiled import kernel
from pftrack_sim.core.photometry import DISPLAY_GAMMA
from pftrack_sim.core.random_streams import stream
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.axes import NoiseAxis

Table: TypeAlias = NDArray[np.uint8]  # `(256, QUANTILES)` output of a pixel of each value at each quantile
QUANTILES = 4096  # Equally likely outputs of a pixel; the truncated tails lower the variance by less than 0.2 %

_EXACT_BELOW_E = 64.0
"""Mean electrons up to which the Poisson distribution is summed term by term.

Above, it is a Gaussian with the skewness of the Poisson distribution (first Edgeworth term): the cumulative
probability is off by less than 0.001.
"""

_STEPS_PER_EV = 16  # Tables per stop of a changing exposure: the variance is off by 2.2 % at most


class Noise:
    """Adds independent noise to every frame of the episode of a root seed."""

    def __init__(self, axis: NoiseAxis, seed: int) -> None:
        self._white_e = axis.white_e
        self._read_e = axis.severity * axis.read_noise_e
        self._seed = seed

    def read(self, image: Image, index: int, gains: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Image:
        """Read out a frame of `(H, W, 3)` uint8, display-coded, without noise; a new array.

        Args:
            image: The frame.
            index: Its index in the episode; it selects the random numbers.
            gains: Gains on linear red, green and blue that `image` contains: a pixel amplified by g has 1 / g of the
                electrons.
        """
        stops = (round(_STEPS_PER_EV * math.log2(gain)) / _STEPS_PER_EV for gain in gains)
        red, green, blue = (quantile_table(self._white_e * 2.0**-ev, self._read_e) for ev in stops)
        key = stream(self._seed, "sensor", "noise", index).integers(2**64, dtype=np.uint64)
        return _sample(np.ascontiguousarray(image), red, green, blue, key)


@lru_cache(maxsize=48)
def quantile_table(white_e: float, read_e: float) -> Table:
    """`(256, QUANTILES)` uint8 quantiles of the output of a pixel of each value, each row ascending; read-only.

    A white pixel has `white_e` electrons, the read noise a standard deviation of `read_e`.
    """
    mean_e = white_e * (np.arange(256) / 255.0) ** DISPLAY_GAMMA
    limits_e = white_e * (np.arange(0.5, 255.0) / 255.0) ** DISPLAY_GAMMA
    read_e = max(read_e, 1e-9)
    dim = int(np.searchsorted(mean_e, _EXACT_BELOW_E))
    exact = [_poisson_cdf(limits_e, float(mean), read_e) for mean in mean_e[:dim]]
    below = np.concatenate([np.array(exact), _edgeworth_cdf(limits_e, mean_e[dim:, None], read_e)])
    ends = np.clip(np.maximum.accumulate(np.floor(below * QUANTILES + 0.5), axis=1), 0, QUANTILES).astype(np.intp)
    counts = np.diff(ends, axis=1, prepend=0, append=QUANTILES)
    outputs = np.tile(np.arange(256, dtype=np.uint8), 256)
    table = np.repeat(outputs, counts.ravel()).reshape(256, QUANTILES)
    table.setflags(write=False)
    return table


def _poisson_cdf(limits_e: FloatArray, mean_e: float, read_e: float) -> FloatArray:
    """Probabilities that Poisson electrons plus read noise are below `(L,)` limits, summed term by term."""
    counts = np.arange(int(mean_e + 8.0 * math.sqrt(mean_e) + 12.0) + 1)
    probabilities = np.exp(scipy.special.xlogy(counts, mean_e) - scipy.special.gammaln(counts + 1.0) - mean_e)
    return probabilities @ scipy.special.ndtr((limits_e - counts[:, None]) / read_e)


def _edgeworth_cdf(limits_e: FloatArray, mean_e: FloatArray, read_e: float) -> FloatArray:
    """The same for `(M, 1)` large means: a Gaussian with the skewness of the Poisson distribution."""
    if read_e < 0.35:
        # With little read noise the sum is a whole number of electrons (continuity correction).
        limits_e = np.floor(limits_e) + 0.5
    spread = np.sqrt(mean_e + read_e * read_e)
    z = (limits_e - mean_e) / spread
    density = np.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    return scipy.special.ndtr(z) - density * (mean_e / spread**3) / 6.0 * (z * z - 1.0)


@kernel
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
