"""Statistics over seeds: intervals, paired comparisons, and rank correlation.

The unit of repetition is the seed, never the frame: frames of one episode are correlated, and resampling them would
give intervals that are far too narrow.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # it imports its packages at first use
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray

BOOTSTRAP_RESAMPLES = 2000
SIGN_FLIPS = 20_000  # Random sign flips behind a p-value where the exhaustive test would need more of them


def bootstrap_interval(
    values: ArrayLike, rng: np.random.Generator, *, level: float = 0.95, resamples: int = BOOTSTRAP_RESAMPLES
) -> tuple[float, float]:
    """Percentile bootstrap interval of a mean over independent repeats, one per seed (Efron 1979).

    With few seeds it is somewhat too narrow, as every percentile bootstrap is.

    Args:
        values: `(N,)` one score per seed; NaN are left out.
        rng: Draws the resamples.
        level: Coverage in (0, 1).
        resamples: Number of resamples.

    Returns:
        Lower and upper end; NaN for fewer than two values.

    Raises:
        ParameterError: `values` is not `(N,)`, or the level or the number of resamples is out of range.
    """
    repeats = np.asarray(values, dtype=np.float64)
    if repeats.ndim != 1:
        raise ParameterError(f"values must have shape (N,), got {repeats.shape}")
    _check_resampling(level, resamples)
    known = repeats[~np.isnan(repeats)]
    if known.size < 2:
        return math.nan, math.nan
    means = known[rng.integers(0, known.size, (resamples, known.size))].mean(axis=1)
    return _percentile_interval(means, level)


def proportion_interval(values: ArrayLike) -> tuple[float, float]:
    """95 % interval of a proportion (Wilson 1927), valid also where all `(N,)` values, 0 or 1 per seed, are equal.

    NaN values are left out; without values both ends are NaN.

    Raises:
        ParameterError: A value is neither 0 nor 1.

    >>> [round(end, 3) for end in proportion_interval([1.0] * 10)]
    [0.722, 1.0]
    """
    given = np.asarray(values, dtype=np.float64)
    known = given[~np.isnan(given)]
    if given.ndim != 1 or not np.isin(known, (0.0, 1.0)).all():
        raise ParameterError(f"a proportion needs (N,) zeros and ones, got {given.tolist()}")
    if not known.size:
        return math.nan, math.nan
    interval = scipy.stats.binomtest(int(known.sum()), known.size).proportion_ci(0.95, method="wilson")
    return float(interval.low), float(interval.high)


def paired_difference(
    first: ArrayLike, second: ArrayLike, rng: np.random.Generator
) -> tuple[float, tuple[float, float], float]:
    """Mean of first - second, its 95 % bootstrap interval, and the p-value of a sign-flip test (Fisher 1935).

    Scores are `(N,)`, one per seed, on the same seeds; without seeds everything is NaN. The two-sided test is
    exhaustive for few seeds and uses `SIGN_FLIPS` random flips for many. With n seeds the p-value cannot be below 2 /
    2^n: 5 seeds never reach 0.05.

    Raises:
        ParameterError: The lengths differ.
    """
    one, other = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    if one.ndim != 1 or one.shape != other.shape:
        raise ParameterError(f"paired scores must have one number per seed, got {one.shape} and {other.shape}")
    differences = (one - other)[np.isfinite(one) & np.isfinite(other)]
    if not differences.size:
        return math.nan, (math.nan, math.nan), math.nan
    mean, interval = float(differences.mean()), bootstrap_interval(differences, rng)
    if differences.size == 1:
        return mean, interval, 1.0
    test = scipy.stats.permutation_test(
        (differences,), np.mean, permutation_type="samples", vectorized=True, n_resamples=SIGN_FLIPS, rng=rng
    )
    return mean, interval, float(test.pvalue)


def holm(p_values: ArrayLike) -> FloatArray:
    """`(N,)` p-values corrected for multiple comparisons, step-down (Holm 1979); NaN stay NaN and do not count.

    By hand: scipy has false discovery rates, but no family-wise correction.

    Raises:
        ParameterError: `p_values` is not `(N,)`.

    >>> holm([0.01, 0.04, 0.03]).round(6).tolist()
    [0.03, 0.06, 0.06]
    """
    given = np.asarray(p_values, dtype=np.float64)
    if given.ndim != 1:
        raise ParameterError(f"p_values must have shape (N,), got {given.shape}")
    corrected = np.full(given.shape, math.nan)
    known = np.flatnonzero(~np.isnan(given))
    order = known[np.argsort(given[known], kind="stable")]
    factors = np.arange(order.size, 0, -1)
    corrected[order] = np.minimum(np.maximum.accumulate(given[order] * factors), 1.0)
    return corrected


@dataclass(frozen=True)
class Comparison:
    """Comparison of two trackers on the same seeds.

    Attributes:
        difference: Mean of (first - second) over seeds.
        low: Lower end of the 95 % interval of that mean.
        high: Upper end.
        p: Two-sided p-value of the sign-flip test.
        p_corrected: The same after Holm's correction for all pairs compared.
        seeds: Number of seeds both have.
    """

    first: str
    second: str
    difference: float
    low: float
    high: float
    p: float
    p_corrected: float
    seeds: int


def compare(scores: Mapping[str, ArrayLike], rng: np.random.Generator) -> list[Comparison]:
    """Comparison of every pair of trackers, corrected for the number of pairs.

    Scores are `(N,)` for each tracker, in the same order of seeds; NaN where one is missing.

    Raises:
        ParameterError: The lengths differ.
    """
    names = list(scores)
    rows = {name: np.asarray(scores[name], dtype=np.float64) for name in names}
    pairs = [(first, second) for index, first in enumerate(names) for second in names[index + 1 :]]
    results = [paired_difference(rows[first], rows[second], rng) for first, second in pairs]
    corrected = holm([p for _, _, p in results])
    return [
        Comparison(
            first, second, difference, *interval, p, float(p_holm), int(np.isfinite(rows[first] + rows[second]).sum())
        )
        for (first, second), (difference, interval, p), p_holm in zip(pairs, results, corrected, strict=True)
    ]


def win_matrix(comparisons: Sequence[Comparison], names: Sequence[str], *, level: float = 0.05) -> NDArray[np.int8]:
    """`(T, T)` significant differences between trackers, in the order of `names`.

    1 where the row's tracker is better than the column's, -1 where it is worse, 0 where the corrected p-value is not
    below `level`.
    """
    place = {name: index for index, name in enumerate(names)}
    table = np.zeros((len(names), len(names)), dtype=np.int8)
    for pair in comparisons:
        if pair.p_corrected < level:
            sign = 1 if pair.difference > 0.0 else -1
            table[place[pair.first], place[pair.second]] = sign
            table[place[pair.second], place[pair.first]] = -sign
    return table


@dataclass(frozen=True)
class RankAgreement:
    """Spearman's rank correlation, in [-1, 1], of two scores over methods, and the ends of its interval over seeds.

    NaN where a score is constant.
    """

    rho: float
    low: float
    high: float


def rank_agreement(
    first: ArrayLike,
    second: ArrayLike,
    rng: np.random.Generator,
    *,
    level: float = 0.95,
    resamples: int = BOOTSTRAP_RESAMPLES,
) -> RankAgreement:
    """Rank correlation of the means over seeds, with a percentile bootstrap interval over the seeds.

    One resample of seeds serves all methods and both scores, since a seed is the same episode to all of them. The
    interval covers other episodes for these methods; it does not cover other methods.

    Args:
        first: `(N, S)` a score of N methods on S seeds; NaN is left out of a mean.
        second: `(N, S)` another score of the same methods on the same seeds.
        rng: Draws the resamples.
        level: Coverage in (0, 1).
        resamples: Number of resamples; those without a defined correlation are left out.

    Raises:
        ParameterError: The shapes differ, a method has no score, or the level or the number is out of range.
    """
    one, other = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    if one.ndim != 2 or one.shape != other.shape:
        raise ParameterError(f"two scores must have the same shape (N, S), got {one.shape} and {other.shape}")
    _check_resampling(level, resamples)
    for scores in (one, other):
        missing = np.isnan(scores).all(axis=1)
        if missing.any():
            raise ParameterError(f"method {int(np.argmax(missing))} has no score on any seed")
    rho = _rank_correlation(np.nanmean(one, axis=1), np.nanmean(other, axis=1))
    seeds = one.shape[1]
    drawn: list[float] = []
    for chosen in rng.integers(0, seeds, (resamples, seeds)):
        means = [_known_means(scores[:, chosen]) for scores in (one, other)]
        drawn.append(_rank_correlation(*means))
    known = np.array([value for value in drawn if not math.isnan(value)])
    if seeds < 2 or not known.size:
        return RankAgreement(rho, math.nan, math.nan)
    return RankAgreement(rho, *_percentile_interval(known, level))


def _rank_correlation(first: FloatArray, second: FloatArray) -> float:
    """Spearman's, ties sharing their mean rank; NaN where a score is constant or unknown, or for fewer than two."""
    if first.size < 2 or not np.ptp(first) > 0.0 or not np.ptp(second) > 0.0:
        return math.nan
    return float(np.corrcoef(scipy.stats.rankdata(first), scipy.stats.rankdata(second))[0, 1])


def _known_means(scores: FloatArray) -> FloatArray:
    """Mean of every row without its NaN; NaN for a row of NaN (`np.nanmean` would warn)."""
    known = ~np.isnan(scores)
    count = known.sum(axis=1)
    return np.where(known, scores, 0.0).sum(axis=1) / np.where(count > 0, count, math.nan)


def _percentile_interval(values: FloatArray, level: float) -> tuple[float, float]:
    low, high = np.quantile(values, [0.5 * (1.0 - level), 0.5 * (1.0 + level)])
    return float(low), float(high)


def _check_resampling(level: float, resamples: int) -> None:
    if not 0.0 < level < 1.0 or resamples < 1:
        raise ParameterError(f"level must be in (0, 1) and resamples >= 1, got {level} and {resamples}")
