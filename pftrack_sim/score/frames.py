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
        overlap: `(N,)` intersection over union (Ko et al. 2012, eq. 14); 0 for a miss and where there is no truth.
        centre_error_px: `(N,)` distance between the centres; infinite for a miss, NaN where there is no truth.
        normalised_error: `(N,)` the same in units of the true width across and the true height down (Müller et al.
            2018, eq. 2); NaN also where the true box has no area.
        centre_inside: `(N,)` whether the centre of the estimate lies inside the true box.
        truth: `(N, 4)` the true boxes [px].
    """

    overlap: FloatArray
    centre_error_px: FloatArray
    normalised_error: FloatArray
    centre_inside: BoolArray
    truth: FloatArray


def frame_scores(estimates: ArrayLike, truth: ArrayLike) -> FrameScores:
    """Scores of `(N, 4)` estimated boxes [px], where a row that is not finite is a miss.

    True boxes are `(N, 4)`, NaN or of zero area where the target is out of view.

    Raises:
        ParameterError: The shapes differ or are not `(N, 4)`.
    """
    estimated, true = np.asarray(estimates, dtype=np.float64), np.asarray(truth, dtype=np.float64)
    if estimated.shape != true.shape or estimated.ndim != 2 or estimated.shape[1] != 4:
        raise ParameterError(f"estimates and truth must both have shape (N, 4), got {estimated.shape} and {true.shape}")
    shift = estimated[:, :2] + 0.5 * estimated[:, 2:] - (true[:, :2] + 0.5 * true[:, 2:])
    size, hit = true[:, 2:], np.isfinite(estimated).all(axis=1)
    known = np.asarray(np.isfinite(true).all(axis=1))
    has_area = np.asarray(known & (size > 0.0).all(axis=1))

    def distances(unit: FloatArray, counted: BoolArray) -> FloatArray:
        errors = np.where(counted, math.inf, math.nan)
        both = counted & hit
        errors[both] = np.hypot(*(shift[both] / unit[both]).T)
        return errors

    # NaN compares as false: a miss is not inside, nor is anything inside an unknown box.
    inside = np.asarray((np.abs(shift) <= 0.5 * size).all(axis=1) & has_area)
    overlap = boxes.pairwise_iou(estimated, true)
    return FrameScores(overlap, distances(np.ones_like(size), known), distances(size, has_area), inside, true)
