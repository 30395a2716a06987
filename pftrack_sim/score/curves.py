"""Success and precision curves, and the measures derived from them.

Toolkits differ in whether a frame exactly on a threshold counts; each function states its rule. The caller leaves out
frames that are not scored: the first one and those without a visible target.
"""

from __future__ import annotations

import math

import numpy as np
import scipy  # it imports its packages at first use
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.records import frozen_array
from pftrack_sim.core.types import BoolArray, FloatArray

SUCCESS_OVERLAP = 0.5  # Overlap from which a frame counts as tracked
LOOSE_OVERLAP = 0.3  # A looser overlap from which a frame counts as tracked, printed beside `SUCCESS_OVERLAP`
PRECISION_PX = 20.0  # Centre error up to which a frame counts as precise

SUCCESS_THRESHOLDS = frozen_array(np.linspace(0.0, 1.0, 21))
"""`(21,)` overlaps 0, 0.05 ... 1 (Wu, Lim & Yang 2013, and the GOT-10k toolkit)."""

PRECISION_THRESHOLDS_PX = frozen_array(np.arange(0.0, 51.0))
"""`(51,)` centre errors 0, 1 ... 50 px (Wu, Lim & Yang 2013)."""

STRICT_OVERLAPS = (0.5, 0.75)  # SR_0.5 and SR_0.75 of GOT-10k: shares of frames with *more* overlap

NORMALISED_PRECISION_THRESHOLDS = frozen_array(np.linspace(0.0, 0.5, 51))
"""`(51,)` centre errors 0, 0.01 ... 0.5 in sizes of the box (Müller et al. 2018, TrackingNet)."""


def success_curve(overlap: ArrayLike, thresholds: ArrayLike = SUCCESS_THRESHOLDS) -> FloatArray:
    """`(T,)` shares of `(N,)` overlaps above each of `(T,)` thresholds (Wu, Lim & Yang 2013; GOT-10k: `>`).

    NaN for no frames. A perfect tracker is at 0 for the threshold 1: its area is 20/21, not 1.

    Raises:
        ParameterError: One of them is not a row of numbers.
    """
    values, at = _row("overlap", overlap), _row("thresholds", thresholds)
    return _shares(values[:, None] > at)


def area_under_success(overlap: ArrayLike) -> float:
    """AUC: mean of the success curve of `(N,)` overlaps over its 21 thresholds (Wu, Lim & Yang 2013), in [0, 20/21].

    >>> round(area_under_success([1.0, 1.0]), 4), round(area_under_success([0.52, 0.0]), 4)
    (0.9524, 0.2619)
    """
    return float(np.mean(success_curve(overlap)))


def average_overlap(overlap: ArrayLike) -> float:
    """AO: mean of `(N,)` overlaps of a sequence without its first frame (Huang, Zhao & Huang 2019, GOT-10k)."""
    values = _row("overlap", overlap)
    return float(values.mean()) if values.size else math.nan


def success_rate(overlap: ArrayLike, threshold: float = SUCCESS_OVERLAP) -> float:
    """Share of `(N,)` overlaps of *at least* the threshold; NaN for no frames.

    Wu, Lim & Yang 2013 use more than the threshold, which differs only in frames exactly on it.
    """
    values = _row("overlap", overlap)
    return float(np.mean(values >= threshold)) if values.size else math.nan


def precision(centre_error: ArrayLike) -> float:
    """Share of frames with a centre error of *at most* 20 px (Wu, Lim & Yang 2013); NaN for no frames."""
    return float(precision_curve(centre_error, [PRECISION_PX])[0])


def precision_curve(centre_error: ArrayLike, thresholds: ArrayLike = PRECISION_THRESHOLDS_PX) -> FloatArray:
    """`(T,)` shares of `(N,)` centre errors of *at most* each of `(T,)` thresholds (Wu, Lim & Yang 2013: `<=`).

    Both are in pixels, or normalised. A NaN error counts as a miss; shares are NaN for no frames.

    Raises:
        ParameterError: One of them is not a row of numbers.
    """
    values, at = _row("centre_error", centre_error), _row("thresholds", thresholds)
    return _shares(values[:, None] <= at)


def normalised_precision(normalised_error: ArrayLike) -> float:
    """Mean of the normalised precision curve over [0, 0.5] (Müller et al. 2018) of `(N,)` normalised errors."""
    return float(np.mean(precision_curve(normalised_error, NORMALISED_PRECISION_THRESHOLDS)))


def roc_area(confidence: ArrayLike, right: ArrayLike) -> float:
    """Area under the ROC curve: how often a right frame has more confidence than a wrong one, ties counted half.

    NaN where all `(N,)` frames are right, or none is. 0.5 says nothing (Fawcett 2006).

    >>> roc_area([0.9, 0.8, 0.3, 0.3], [True, False, True, False])
    0.625
    """
    said, true = _row("confidence", confidence), np.asarray(right, dtype=np.bool_)
    if true.shape != said.shape:
        raise ParameterError(f"right must have shape {said.shape}, got {true.shape}")
    hits, misses = int(true.sum()), int((~true).sum())
    if not hits or not misses:
        return math.nan
    ranks: FloatArray = scipy.stats.rankdata(said)  # of equal ones the mean
    return (float(ranks[true].sum()) - 0.5 * hits * (hits + 1)) / (hits * misses)


def _row(name: str, values: ArrayLike) -> FloatArray:
    row = np.asarray(values, dtype=np.float64)
    if row.ndim != 1:
        raise ParameterError(f"{name} must have shape (N,), got {row.shape}")
    return row


def _shares(counted: BoolArray) -> FloatArray:
    """Mean of each column; NaN where there are no rows."""
    count, columns = counted.shape[0], counted.shape[-1]
    if not count:
        return np.full((columns,), math.nan)
    return np.count_nonzero(counted, axis=0).astype(np.float64) / count
