"""Success and precision over their thresholds, and the measures that are read off them.

Toolkits differ in whether a frame exactly on a threshold counts; each function says which rule it has. Frames that are
not to be scored (the first, those without a visible target) are left out by the caller.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.errors import ParameterError

Numbers = NDArray[np.float64]


def _frozen(values: Numbers) -> Numbers:
    values.setflags(write=False)
    return values


SUCCESS_THRESHOLDS = _frozen(np.linspace(0.0, 1.0, 21))
"""`(21,)` overlaps 0, 0.05 ... 1 (Wu, Lim & Yang 2013, and the GOT-10k toolkit)."""

PRECISION_THRESHOLDS_PX = _frozen(np.arange(0.0, 51.0))
"""`(51,)` centre errors 0, 1 ... 50 px (Wu, Lim & Yang 2013)."""

NORMALISED_PRECISION_THRESHOLDS = _frozen(np.linspace(0.0, 0.5, 51))
"""`(51,)` centre errors 0, 0.01 ... 0.5 in sizes of the box (Müller et al. 2018, TrackingNet)."""


def success_curve(overlap: ArrayLike, thresholds: ArrayLike = SUCCESS_THRESHOLDS) -> Numbers:
    """Share of frames with an overlap of *more* than each threshold (Wu, Lim & Yang 2013; GOT-10k: `>`).

    A perfect tracker is at 0 for the threshold 1: its area is 20/21, not 1.

    Args:
        overlap: `(N,)` overlaps.
        thresholds: `(T,)` in [0, 1].

    Returns:
        `(T,)` shares; NaN for no frames.

    Raises:
        ParameterError: `overlap` or the thresholds are not a row of numbers.
    """
    values, at = _row("overlap", overlap), _row("thresholds", thresholds)
    return _shares(values[:, None] > at)


def area_under_success(overlap: ArrayLike) -> float:
    """AUC: mean of the success curve over its 21 thresholds (Wu, Lim & Yang 2013).

    Args:
        overlap: `(N,)` overlaps.

    Returns:
        A number in [0, 20/21]; NaN for no frames.

    >>> round(area_under_success([1.0, 1.0]), 4), round(area_under_success([0.52, 0.0]), 4)
    (0.9524, 0.2619)
    """
    return float(np.mean(success_curve(overlap)))


def average_overlap(overlap: ArrayLike) -> float:
    """AO: mean overlap of all frames but the first, whose box is given (Huang, Zhao & Huang 2019, GOT-10k).

    Args:
        overlap: `(N,)` overlaps of a sequence without its first frame.
    """
    values = _row("overlap", overlap)
    return float(values.mean()) if values.size else math.nan


def strict_success_rate(overlap: ArrayLike, threshold: float = 0.5) -> float:
    """SR: share of frames with an overlap of *more* than the threshold (GOT-10k: SR_0.5 and SR_0.75).

    Args:
        overlap: `(N,)` overlaps of a sequence without its first frame.
        threshold: In [0, 1].

    >>> strict_success_rate([0.5, 0.6]), strict_success_rate([0.5, 0.6], 0.75)
    (0.5, 0.0)
    """
    return float(success_curve(overlap, [threshold])[0])


def precision_curve(centre_error: ArrayLike, thresholds: ArrayLike = PRECISION_THRESHOLDS_PX) -> Numbers:
    """Share of frames with a centre error of *at most* each threshold (Wu, Lim & Yang 2013: `<=`).

    Args:
        centre_error: `(N,)` [px], or normalised; NaN counts as a miss.
        thresholds: `(T,)` in the same unit.

    Returns:
        `(T,)` shares; NaN for no frames.

    Raises:
        ParameterError: One of them is not a row of numbers.
    """
    values, at = _row("centre_error", centre_error), _row("thresholds", thresholds)
    return _shares(values[:, None] <= at)


def normalised_centre_errors(estimates: ArrayLike, truth: ArrayLike) -> Numbers:
    """Centre errors in sizes of the true box: across in its widths, down in its heights (Müller et al. 2018, eq. 2).

    Args:
        estimates: `(N, 4)` boxes [px]; a row that is not finite is a miss.
        truth: `(N, 4)` boxes [px]; NaN, or of no area, where there is none.

    Returns:
        `(N,)`; infinite for a miss, NaN where there is no truth.

    Raises:
        ParameterError: The shapes differ or are not `(N, 4)`.
    """
    said, true = np.asarray(estimates, dtype=np.float64), np.asarray(truth, dtype=np.float64)
    if said.shape != true.shape or said.ndim != 2 or said.shape[1] != 4:
        raise ParameterError(f"estimates and truth must both have shape (N, 4), got {said.shape} and {true.shape}")
    known = np.isfinite(true).all(axis=1) & (true[:, 2:] > 0.0).all(axis=1)
    both = known & np.isfinite(said).all(axis=1)
    errors = np.where(known, math.inf, math.nan)
    shift = said[both, :2] + 0.5 * said[both, 2:] - true[both, :2] - 0.5 * true[both, 2:]
    errors[both] = np.hypot(*(shift / true[both, 2:]).T)
    return errors


def normalised_precision(normalised_error: ArrayLike) -> float:
    """Mean of the normalised precision curve over [0, 0.5] (Müller et al. 2018).

    Args:
        normalised_error: `(N,)` from `normalised_centre_errors`.

    Returns:
        A number in [0, 1]; NaN for no frames.
    """
    return float(np.mean(precision_curve(normalised_error, NORMALISED_PRECISION_THRESHOLDS)))


def _row(name: str, values: ArrayLike) -> Numbers:
    row = np.asarray(values, dtype=np.float64)
    if row.ndim != 1:
        raise ParameterError(f"{name} must have shape (N,), got {row.shape}")
    return row


def _shares(counted: NDArray[np.bool_]) -> Numbers:
    """Mean of each column; NaN where there are no rows."""
    count, columns = counted.shape[0], counted.shape[-1]
    if not count:
        return np.full((columns,), math.nan)
    return np.count_nonzero(counted, axis=0).astype(np.float64) / count
