"""Quasi-random noise for particle filters, apart from `filters` because SciPy's statistics are slow to import."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from pftrack_sim.core.types import FloatArray

_SOBOL_BITS = 64  # The sequence has 2^64 points, so that no tracker comes to its end
_LEAST_SHARE = 1e-12


class SobolNormals:
    """Quasi-random normal noise: a scrambled Sobol sequence through the inverse normal distribution.

    Its points cover the space more evenly than independent ones, most so if their number is a power of two: successive
    draws of 2^k points are then digital nets (Owen 1998). It goes on from draw to draw.

    Args:
        dimension: D, number of components.
        rng: Source of the scrambling.
    """

    def __init__(self, dimension: int, rng: np.random.Generator) -> None:
        self._sequence = qmc.Sobol(dimension, scramble=True, bits=_SOBOL_BITS, rng=rng)

    def draw(self, count: int) -> FloatArray:
        """`(count, D)` next values; of a number that is no power of two, the first of the next power."""
        uniform = self._sequence.random(1 << (count - 1).bit_length())[:count]
        # 0 and 1 lie at infinity.
        return np.asarray(ndtri(np.clip(uniform, _LEAST_SHARE, 1.0 - _LEAST_SHARE)), dtype=np.float64)
