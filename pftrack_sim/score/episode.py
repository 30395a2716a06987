"""How well boxes agree with the truth.

Frames where the target cannot be seen are not scored (Ko et al. 2012, section 4), and neither is the first scored
frame: the tracker was given its box.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ParameterError

SUCCESS_OVERLAP = 0.5
PRECISION_PX = 20.0


@dataclass(frozen=True)
class Summary:
    """Scores of one tracker on one sequence; NaN where no frame is scored.

    Attributes:
        frames: Number of scored frames.
        mean_overlap: Mean overlap (Ko et al. 2012, table 2).
        success: Share of frames with an overlap of at least `SUCCESS_OVERLAP`.
        precision: Share of frames with a centre error of at most `PRECISION_PX`.
        centre_error_median_px: Median centre error; infinite when the tracker gave no box in most frames.
        ms_median: Median time for a frame; the frame where it was started does not count.
    """

    frames: int
    mean_overlap: float
    success: float
    precision: float
    centre_error_median_px: float
    ms_median: float

    def as_dict(self) -> dict[str, float]:
        """By name, for a table."""
        return asdict(self)


def overlaps(estimates: ArrayLike, truth: ArrayLike) -> NDArray[np.float64]:
    """Overlap of every frame's estimate with the truth (Ko et al. 2012, eq. 14).

    Args:
        estimates: `(N, 4)` boxes [px]; a row that is not finite is a miss.
        truth: `(N, 4)` boxes [px]; NaN or of no area where there is none.

    Returns:
        `(N,)` numbers in [0, 1]; 0 for a miss, and where there is no truth.

    Raises:
        ParameterError: The shapes differ or are not `(N, 4)`.
    """
    # A box with itself may come to 1 + 2e-16.
    return np.minimum(boxes.pairwise_iou(*_paired(estimates, truth)), 1.0)


def centre_errors(estimates: ArrayLike, truth: ArrayLike) -> NDArray[np.float64]:
    """Distance of every frame's centre from the truth's.

    Args:
        estimates: `(N, 4)` boxes [px]; a row that is not finite is a miss.
        truth: `(N, 4)` boxes [px]; NaN where there is none.

    Returns:
        `(N,)` pixels; infinite for a miss, NaN where there is no truth.

    Raises:
        ParameterError: The shapes differ or are not `(N, 4)`.
    """
    said, true = _paired(estimates, truth)
    answered, known = np.isfinite(said).all(axis=1), np.isfinite(true).all(axis=1)
    errors = np.where(known, math.inf, math.nan)
    both = answered & known
    shift = (said[both, :2] + 0.5 * said[both, 2:]) - (true[both, :2] + 0.5 * true[both, 2:])
    errors[both] = np.hypot(shift[:, 0], shift[:, 1])
    return errors


def success_rate(overlap: ArrayLike, threshold: float = SUCCESS_OVERLAP) -> float:
    """Share of frames that are tracked: overlap at least the threshold.

    The threshold itself counts as tracked. (Wu, Lim & Yang 2013 ask for more than the threshold, which differs only in
    frames exactly on it.)

    Args:
        overlap: `(N,)` overlaps.
        threshold: In [0, 1].

    Returns:
        A number in [0, 1]; NaN for no frames.
    """
    return _mean(np.asarray(overlap, dtype=np.float64) >= threshold)


def precision(centre_error: ArrayLike, threshold_px: float = PRECISION_PX) -> float:
    """Share of frames whose centre error is at most the threshold (Wu, Lim & Yang 2013).

    Args:
        centre_error: `(N,)` [px]; NaN counts as a miss.
        threshold_px: In pixels.

    Returns:
        A number in [0, 1]; NaN for no frames.
    """
    return _mean(np.asarray(centre_error, dtype=np.float64) <= threshold_px)


def summarise(overlap: ArrayLike, centre_error: ArrayLike, scored: ArrayLike, ms: ArrayLike) -> Summary:
    """Put a sequence into one row.

    Args:
        overlap: `(N,)` from `overlaps`.
        centre_error: `(N,)` from `centre_errors` [px].
        scored: `(N,)` true where the target can be seen. The first of these frames is left out: its box was given.
        ms: `(N,)` time the tracker took.

    Raises:
        ParameterError: The lengths differ.
    """
    columns = [np.asarray(one, dtype=np.float64) for one in (overlap, centre_error, ms)]
    counted = np.array(scored, dtype=np.bool_)
    if any(one.shape != counted.shape or one.ndim != 1 for one in columns):
        shapes = ", ".join(str(one.shape) for one in (*columns[:2], counted, columns[2]))
        raise ParameterError(f"overlap, centre_error, scored and ms must have one number per frame, got {shapes}")
    seen = np.flatnonzero(counted)
    given = int(seen[0]) if seen.size else counted.size
    counted[: given + 1] = False
    some_overlap, some_error, took = columns[0][counted], columns[1][counted], columns[2][given + 1 :]
    return Summary(
        frames=int(counted.sum()),
        mean_overlap=_mean(some_overlap),
        success=success_rate(some_overlap),
        precision=precision(some_error),
        centre_error_median_px=_median(some_error),
        ms_median=_median(took),
    )


def _paired(estimates: ArrayLike, truth: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    said, true = np.asarray(estimates, dtype=np.float64), np.asarray(truth, dtype=np.float64)
    if said.shape != true.shape or said.ndim != 2 or said.shape[1] != 4:
        raise ParameterError(f"estimates and truth must both have shape (N, 4), got {said.shape} and {true.shape}")
    return said, true


def _mean(values: NDArray[np.float64] | NDArray[np.bool_]) -> float:
    return float(np.mean(values)) if values.size else math.nan


def _median(values: NDArray[np.float64]) -> float:
    return float(np.median(values)) if values.size else math.nan
