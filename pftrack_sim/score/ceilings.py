"""Highest scores that are possible under a restriction of the estimates, from the true boxes alone.

Many trackers keep the shape of the box with which they were initialised. The true box of a walking person does not
keep its shape: seen from the side its width follows the stride (Milan et al. 2016, "MOT16", annotation rules).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.score import curves
from pftrack_sim.score.frames import overlaps


@dataclass(frozen=True)
class Ceiling:
    """Best possible scores on one sequence; NaN where no frame is scored.

    Attributes:
        frames: Number of scored frames.
        mean_overlap: Mean overlap.
        success: Share of frames with an overlap of at least `SUCCESS_OVERLAP`.
    """

    frames: int
    mean_overlap: float
    success: float


def fixed_shape_ceiling(truth: ArrayLike, scored: ArrayLike) -> Ceiling:
    """Scores of an estimate with the centre of the true box in every frame, and the width and height of the first one.

    No tracker with a box of this shape exceeds either number: of all boxes of one shape, the one about the true centre
    has the largest intersection with the true box.

    Args:
        truth: `(N, 4)` boxes on which overlap is scored [px]; NaN or of zero area where the target is out of view.
        scored: `(N,)` true where the target can be seen. The box of the first of these frames gives the shape; that
            frame is not scored, as in `summarise`.

    Raises:
        ParameterError: The lengths differ.

    >>> fixed_shape_ceiling([[0, 0, 10, 20], [5, 0, 10, 20], [8, 0, 40, 20]], [True, True, True])
    Ceiling(frames=2, mean_overlap=0.625, success=0.5)
    """
    true, counted = np.asarray(truth, dtype=np.float64), np.array(scored, dtype=np.bool_)
    if true.ndim != 2 or true.shape[1] != 4 or counted.shape != true.shape[:1]:
        raise ParameterError(f"truth must be (N, 4) and scored (N,), got {true.shape} and {counted.shape}")
    visible = np.flatnonzero(counted)
    if visible.size < 2:
        return Ceiling(0, math.nan, math.nan)
    size, seen = true[visible[0], 2:], true[visible[1:]]
    estimates = np.concatenate(
        [seen[:, :2] + 0.5 * (seen[:, 2:] - size), np.broadcast_to(size, (len(seen), 2))], axis=1
    )
    overlap = overlaps(estimates, seen)
    return Ceiling(len(seen), curves.average_overlap(overlap), curves.success_rate(overlap))
