"""Windows and labels of correlation filters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def hann(count: int) -> NDArray[np.float32]:
    """`(count,)` Hann window at the centres of `count` samples; positive everywhere."""
    return (0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(count) + 0.5) / count)).astype(np.float32)


def vertex(before: float, peak: float, after: float) -> float:
    """Offset in [-0.5, 0.5] of the vertex of the parabola through three samples, from the one in the middle."""
    curvature = before - 2.0 * peak + after
    if curvature >= -1e-12:
        return 0.0
    return min(max(0.5 * (before - after) / curvature, -0.5), 0.5)
