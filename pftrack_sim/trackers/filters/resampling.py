"""Drawing particles anew in proportion to their weights."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def systematic(weights: NDArray[np.float64], rng: np.random.Generator, count: int | None = None) -> NDArray[np.intp]:
    """Systematic resampling: one uniform number, then equal steps along the summed weights.

    Particle i is drawn `count * weights[i]` times on average, and never more than one away from that.
    Source: Carpenter, Clifford & Fearnhead 1999; Arulampalam et al. 2002, algorithm 2.

    Args:
        weights: `(N,)` >= 0, summing to 1.
        rng: One number is drawn.
        count: How many to draw; N if None.

    Returns:
        `(count,)` indices, ascending.
    """
    wanted = weights.size if count is None else count
    edges = np.cumsum(weights)
    total = float(edges[-1])
    points = (rng.random() + np.arange(wanted)) * (total / wanted)
    # Rounding may put the last point on the end itself, beyond which no particle lies.
    return np.searchsorted(edges, np.minimum(points, np.nextafter(total, 0.0)), side="right")


def effective_sample_size(weights: NDArray[np.float64]) -> float:
    """1 / sum(w^2): N when all weigh the same, 1 when one holds everything (Arulampalam et al. 2002, eq. 51).

    Args:
        weights: `(N,)` >= 0, summing to 1.
    """
    return 1.0 / float(weights @ weights)
