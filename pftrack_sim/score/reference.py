"""What a mean overlap is compared with: a box that never moves, from the true boxes alone."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import BoolArray, FloatArray

DEFINITIONS = {
    "stay": "mean overlap of the first box in every frame, on the same frames",
    "skill": "(overlap - stay) / (1 - stay)",
    "ceiling": "share of frames in which the first box's size at the true centre reaches an overlap of 0.5",
    "inside": "share of frames in which the centre of the estimate lies inside the true box",
}
"""The columns beside the mean overlap in every table, in words."""


def first_scored(scored: ArrayLike) -> int:
    """Index of the first frame in which the target can be seen: its box is given; the number of frames if none is."""
    visible = np.flatnonzero(np.asarray(scored, dtype=np.bool_))
    return int(visible[0]) if visible.size else np.size(scored)


def stay_overlaps(truth: ArrayLike, scored: ArrayLike) -> FloatArray:
    """`(N,)` overlap of the first scored box with the truth of every frame.

    Args:
        truth: `(N, 4)` true boxes [px]; NaN or of zero area where the target is out of view.
        scored: `(N,)` true where the target can be seen.

    Raises:
        ParameterError: The shapes do not fit.
    """
    true = np.asarray(truth, dtype=np.float64)
    if true.ndim != 2 or true.shape[1] != 4 or np.shape(scored) != true.shape[:1]:
        raise ParameterError(f"truth must be (N, 4) and scored (N,), got {true.shape} and {np.shape(scored)}")
    first = first_scored(scored)
    box = true[first] if first < len(true) else np.full(4, math.nan)
    return boxes.pairwise_iou(np.broadcast_to(box, true.shape), true)


def skill(overlap: float, stay: float) -> float:
    """Overlap relative to a box that never moves: 0 for equal, 1 for perfect, negative for worse.

    Args:
        overlap: Mean overlap of a tracker.
        stay: Mean overlap of the first box in every frame, on the same frames.

    Returns:
        NaN where `stay` is 1 and nothing could be better.

    >>> skill(0.75, 0.5), skill(0.25, 0.5)
    (0.5, -0.5)
    """
    return (overlap - stay) / (1.0 - stay) if stay < 1.0 else math.nan


def counted_frames(scored: ArrayLike) -> BoolArray:
    """`(N,)` the scored frames except the first one, whose box was given."""
    counted = np.array(scored, dtype=np.bool_)
    counted[: first_scored(counted) + 1] = False
    return counted
