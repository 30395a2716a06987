"""Whether two scores put trackers in the same order: does overlap predict following?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.score.compare import DRAWS


@dataclass(frozen=True)
class Agreement:
    """Rank correlation of two scores.

    Attributes:
        rho: Spearman's, in [-1, 1]; NaN where a score is the same everywhere.
        low: Lower end of its interval over seeds.
        high: Upper end.
    """

    rho: float
    low: float
    high: float


def rank_correlation(first: ArrayLike, second: ArrayLike) -> float:
    """Spearman's rank correlation; equal values share the mean of their ranks (Spearman 1904, with Kendall's ties).

    Args:
        first: `(N,)` a score of N methods.
        second: `(N,)` another score of the same methods.

    Returns:
        In [-1, 1]; NaN where a score is the same everywhere, or for fewer than two methods.

    Raises:
        ParameterError: The lengths differ, or a number is not finite.

    >>> rank_correlation([0.2, 0.5, 0.9], [1.0, 2.0, 40.0])
    1.0
    """
    one, other = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    if one.ndim != 1 or one.shape != other.shape or not (np.isfinite(one).all() and np.isfinite(other).all()):
        raise ParameterError(f"two scores need the same number of finite values, got {one.shape} and {other.shape}")
    a, b = _centred_ranks(one), _centred_ranks(other)
    spread = math.sqrt(float(a @ a) * float(b @ b))
    return float(a @ b) / spread if spread > 0.0 else math.nan


def rank_agreement(
    first: ArrayLike, second: ArrayLike, rng: np.random.Generator, *, level: float = 0.95, draw_count: int = DRAWS
) -> Agreement:
    """Rank correlation of the means over seeds, with a percentile bootstrap interval over the seeds.

    The seeds are drawn anew for all methods and both scores at once, since a seed is the same episode to all of them.
    The interval says what other episodes would have given for these methods; it does not say what other methods would.

    Args:
        first: `(N, S)` a score of N methods on S seeds; NaN is left out of a mean.
        second: `(N, S)` another score of the same methods on the same seeds.
        rng: The seeds are drawn from it.
        level: Share of the draws inside, in (0, 1).
        draw_count: How many are drawn.

    Returns:
        The correlation and its interval. Draws in which a score is the same everywhere, or a method has no score, have
        no correlation and are left out.

    Raises:
        ParameterError: The shapes differ, a method has no score at all, or the level or the count is out of range.
    """
    one, other = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    if one.ndim != 2 or one.shape != other.shape:
        raise ParameterError(f"two scores must have the same shape (N, S), got {one.shape} and {other.shape}")
    if not 0.0 < level < 1.0 or draw_count < 1:
        raise ParameterError(f"level must be in (0, 1) and draw_count >= 1, got {level} and {draw_count}")
    for scores in (one, other):
        if np.isnan(scores).all(axis=1).any():
            raise ParameterError(f"method {int(np.argmax(np.isnan(scores).all(axis=1)))} has no score on any seed")
    rho = rank_correlation(np.nanmean(one, axis=1), np.nanmean(other, axis=1))
    seeds = one.shape[1]
    drawn: list[float] = []
    for chosen in rng.integers(0, seeds, (draw_count, seeds)):
        means = [_means(scores[:, chosen]) for scores in (one, other)]
        if not any(np.isnan(mean).any() for mean in means):
            drawn.append(rank_correlation(*means))
    known = np.array([one for one in drawn if not math.isnan(one)])
    if seeds < 2 or not known.size:
        return Agreement(rho, math.nan, math.nan)
    low, high = np.quantile(known, [0.5 * (1.0 - level), 0.5 * (1.0 + level)])
    return Agreement(rho, float(low), float(high))


def _means(scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of every row without its NaN; NaN for a row that has nothing else."""
    known = ~np.isnan(scores)
    count = known.sum(axis=1)
    return np.where(known, scores, 0.0).sum(axis=1) / np.where(count > 0, count, math.nan)


def _centred_ranks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ranks less their mean; equal values share the mean of theirs."""
    ordered = np.sort(values)
    below, up_to = np.searchsorted(ordered, values, "left"), np.searchsorted(ordered, values, "right")
    return 0.5 * (below + up_to - values.size).astype(np.float64)
