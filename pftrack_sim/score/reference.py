"""What a mean overlap is compared with, from the true boxes alone: a box that stays, and a box that keeps its shape.

Many trackers keep the shape of the box with which they were initialised. The true box of a walking person does not
keep its shape: seen from the side its width follows the stride (Milan et al. 2016, "MOT16", annotation rules).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.score import curves


@dataclass(frozen=True)
class Ceiling:
    """Best possible scores on one sequence, over its scored frames; NaN where there are none.

    Attributes:
        frames: Number of scored frames.
        mean_overlap: Mean overlap.
        success: Share of frames with an overlap of at least `SUCCESS_OVERLAP`.
    """

    frames: int
    mean_overlap: float
    success: float


def first_scored(scored: ArrayLike) -> int:
    """Index of the first frame in which the target can be seen: its box is given; the number of frames if none is."""
    visible = np.flatnonzero(np.asarray(scored, dtype=np.bool_))
    return int(visible[0]) if visible.size else np.size(scored)


def counted_frames(scored: ArrayLike) -> BoolArray:
    """`(N,)` the scored frames except the first one, whose box was given."""
    counted = np.array(scored, dtype=np.bool_)
    counted[: first_scored(counted) + 1] = False
    return counted


def stay_overlaps(truth: ArrayLike, scored: ArrayLike) -> FloatArray:
    """`(N,)` overlap of the first scored box with the truth of every frame.

    Args:
        truth: `(N, 4)` boxes on which overlap is scored [px]; NaN or of zero area where the target is out of view.
        scored: `(N,)` true where the target can be seen.

    Raises:
        ParameterError: The shapes do not fit.
    """
    true = _checked(truth, scored)
    first = first_scored(scored)
    box = true[first] if first < len(true) else boxes.NO_BOX
    return boxes.pairwise_iou(np.broadcast_to(box, true.shape), true)


def skill(overlap: float, stay: float) -> float:
    """Mean overlap relative to that of a box that never moves: 0 for equal, 1 for perfect, negative for worse.

    NaN where `stay` is 1 and nothing could be better.

    >>> skill(0.75, 0.5), skill(0.25, 0.5)
    (0.5, -0.5)
    """
    return (overlap - stay) / (1.0 - stay) if stay < 1.0 else math.nan


def fixed_shape_ceiling(truth: ArrayLike, scored: ArrayLike) -> Ceiling:
    """Scores of an estimate with the true centre in every frame, and the width and height of the first scored box.

    No tracker with a box of this shape exceeds either number: of all boxes of one shape, the one about the true centre
    has the largest intersection with the true box. Arguments and errors are those of `stay_overlaps`.

    >>> fixed_shape_ceiling([[0, 0, 10, 20], [5, 0, 10, 20], [8, 0, 40, 20]], [True, True, True])
    Ceiling(frames=2, mean_overlap=0.625, success=0.5)
    """
    true, visible = _checked(truth, scored), np.flatnonzero(np.asarray(scored, dtype=np.bool_))
    if visible.size < 2:
        return Ceiling(0, math.nan, math.nan)
    size, seen = true[visible[0], 2:], true[visible[1:]]
    corners = seen[:, :2] + 0.5 * (seen[:, 2:] - size)
    overlap = boxes.pairwise_iou(np.concatenate([corners, np.broadcast_to(size, (len(seen), 2))], axis=1), seen)
    return Ceiling(len(seen), curves.average_overlap(overlap), curves.success_rate(overlap))


def _checked(truth: ArrayLike, scored: ArrayLike) -> FloatArray:
    true = np.asarray(truth, dtype=np.float64)
    if true.ndim != 2 or true.shape[1] != 4 or np.shape(scored) != true.shape[:1]:
        raise ParameterError(f"truth must be (N, 4) and scored (N,), got {true.shape} and {np.shape(scored)}")
    return true
