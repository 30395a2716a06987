"""Scores of single frames: overlap and centre errors of estimated boxes against true boxes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class FrameScores:
    """Scores of one tracker, one number per frame.

    Attributes:
        overlap: `(N,)` intersection over union; 0 for a miss and where there is no truth.
        centre_error_px: `(N,)` infinite for a miss, NaN where there is no truth.
        normalised_error: `(N,)` centre error in sizes of the true box; infinite and NaN as above.
        centre_inside: `(N,)` whether the centre of the estimate lies inside the true box.
        truth: `(N, 4)` the true boxes [px].
    """

    overlap: FloatArray
    centre_error_px: FloatArray
    normalised_error: FloatArray
    centre_inside: BoolArray
    truth: FloatArray


def frame_scores(estimates: ArrayLike, truth: ArrayLike) -> FrameScores:
    """Scores of every frame.

    Args:
        estimates: `(N, 4)` boxes [px]; a row that is not finite is a miss.
        truth: `(N, 4)` boxes [px]; NaN or of zero area where the target is out of view.

    Raises:
        ParameterError: The shapes differ or are not `(N, 4)`.
    """
    estimated, true = _paired(estimates, truth)
    shift = np.abs(estimated[:, :2] + 0.5 * estimated[:, 2:] - (true[:, :2] + 0.5 * true[:, 2:]))
    return FrameScores(
        overlaps(estimated, true),
        centre_errors(estimated, true),
        normalised_centre_errors(estimated, true),
        # NaN compares as false: a miss is not inside, nor is anything inside an unknown box.
        np.asarray((shift <= 0.5 * true[:, 2:]).all(axis=1) & (true[:, 2:] > 0.0).all(axis=1)),
        true,
    )


def overlaps(estimates: ArrayLike, truth: ArrayLike) -> FloatArray:
    """`(N,)` overlap of each estimate with the truth (Ko et al. 2012, eq. 14); arguments as `frame_scores`."""
    return boxes.pairwise_iou(*_paired(estimates, truth))


def centre_errors(estimates: ArrayLike, truth: ArrayLike) -> FloatArray:
    """`(N,)` distance [px] between the centres; infinite for a miss, NaN without truth; arguments as `frame_scores`."""
    estimated, true = _paired(estimates, truth)
    return _centre_distances(estimated, true, _finite_rows(true), np.ones_like(true[:, 2:]))


def normalised_centre_errors(estimates: ArrayLike, truth: ArrayLike) -> FloatArray:
    """Centre errors in units of the true width across and the true height down (Müller et al. 2018, eq. 2).

    Args:
        estimates: `(N, 4)` boxes [px]; a row that is not finite is a miss.
        truth: `(N, 4)` boxes [px].

    Returns:
        `(N,)`; infinite for a miss, NaN where the true box is NaN or has no area.

    Raises:
        ParameterError: The shapes differ or are not `(N, 4)`.
    """
    estimated, true = _paired(estimates, truth)
    known = _finite_rows(true) & np.all(true[:, 2:] > 0.0, axis=1)
    return _centre_distances(estimated, true, known, true[:, 2:])


def _centre_distances(estimated: FloatArray, true: FloatArray, known: BoolArray, unit: FloatArray) -> FloatArray:
    errors = np.where(known, math.inf, math.nan)
    both = known & _finite_rows(estimated)
    shift = (estimated[both, :2] + 0.5 * estimated[both, 2:]) - (true[both, :2] + 0.5 * true[both, 2:])
    errors[both] = np.hypot(*(shift / unit[both]).T)
    return errors


def _finite_rows(boxes_px: FloatArray) -> BoolArray:
    return np.asarray(np.isfinite(boxes_px).all(axis=1))


def _paired(estimates: ArrayLike, truth: ArrayLike) -> tuple[FloatArray, FloatArray]:
    estimated, true = np.asarray(estimates, dtype=np.float64), np.asarray(truth, dtype=np.float64)
    if estimated.shape != true.shape or estimated.ndim != 2 or estimated.shape[1] != 4:
        raise ParameterError(f"estimates and truth must both have shape (N, 4), got {estimated.shape} and {true.shape}")
    return estimated, true
