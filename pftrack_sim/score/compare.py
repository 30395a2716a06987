"""Which tracker is better, and how sure that is: intervals over seeds, and differences paired by seed.

The unit of repetition is the seed, never the frame: frames of an episode hang together, and drawing them anew would
give intervals that are far too narrow.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.errors import ParameterError

Numbers = NDArray[np.float64]

DRAWS = 2000
"""Bootstrapped means behind an interval."""

SIGN_FLIPS = 20_000
"""Random sign flips behind a p-value, where there are too many seeds to try all."""

_ALL_FLIPS_UP_TO = 14  # 2^14 sign flips are fewer than SIGN_FLIPS: then every one is tried


def bootstrap_interval(
    values: ArrayLike, rng: np.random.Generator, *, level: float = 0.95, draw_count: int = DRAWS
) -> tuple[float, float]:
    """Percentile bootstrap interval of a mean over independent repeats (Efron 1979).

    Meant for one score per seed: runs with different seeds are independent, while the frames of a run are not, and
    drawing those anew would give an interval that is far too narrow. It says what other seeds would have given on the
    same images, and for a tracker that draws nothing it has no width. With few seeds it is somewhat too narrow, as
    every percentile bootstrap is.

    Args:
        values: `(N,)` one score per repeat; NaN are left out.
        rng: The repeats are drawn from it.
        level: Share of the bootstrapped means inside, in (0, 1).
        draw_count: How many means are drawn.

    Returns:
        Lower and upper end; NaN for fewer than two repeats, which say nothing about their spread.

    Raises:
        ParameterError: `values` is not `(N,)`, or the level or the count is out of range.
    """
    repeats = np.asarray(values, dtype=np.float64)
    if repeats.ndim != 1:
        raise ParameterError(f"values must have shape (N,), got {repeats.shape}")
    if not 0.0 < level < 1.0 or draw_count < 1:
        raise ParameterError(f"level must be in (0, 1) and draw_count >= 1, got {level} and {draw_count}")
    known = repeats[~np.isnan(repeats)]
    if known.size < 2:
        return math.nan, math.nan
    means = known[rng.integers(0, known.size, (draw_count, known.size))].mean(axis=1)
    low, high = np.quantile(means, [0.5 * (1.0 - level), 0.5 * (1.0 + level)])
    return float(low), float(high)


_WILSON_Z = 1.959963984540054  # 97.5% of a normal distribution


def share_interval(values: ArrayLike) -> tuple[float, float]:
    """Interval that holds a share with 95% (Wilson 1927): of successes and failures, also where all are alike.

    Args:
        values: `(N,)` 0 or 1 per seed; NaN are left out.

    Returns:
        Lower and upper end, within [0, 1]; NaN without values.

    Raises:
        ParameterError: Not a row of zeros and ones.

    >>> [round(end, 3) for end in share_interval([1.0] * 10)]
    [0.722, 1.0]
    """
    given = np.asarray(values, dtype=np.float64)
    known = given[~np.isnan(given)]
    if given.ndim != 1 or not np.isin(known, (0.0, 1.0)).all():
        raise ParameterError(f"a share needs (N,) zeros and ones, got {given.tolist()}")
    if not known.size:
        return math.nan, math.nan
    count, share, square = known.size, float(known.mean()), _WILSON_Z**2
    middle = (share + square / (2 * count)) / (1 + square / count)
    half = _WILSON_Z * math.sqrt(share * (1 - share) / count + square / (4 * count**2)) / (1 + square / count)
    return max(middle - half, 0.0), min(middle + half, 1.0)


@dataclass(frozen=True)
class Comparison:
    """One tracker against another on the same seeds.

    Attributes:
        one: The tracker.
        other: What it is compared with.
        difference: Mean of (one - other) over seeds.
        low: Lower end of the 95% interval of that mean.
        high: Upper end.
        p: Chance of a mean difference at least as far from 0 if the two were alike (sign-flip test).
        p_corrected: The same, corrected for all pairs that were compared (Holm 1979).
        seeds: Number of seeds that both have.
    """

    one: str
    other: str
    difference: float
    low: float
    high: float
    p: float
    p_corrected: float
    seeds: int


def paired_difference(
    one: ArrayLike, other: ArrayLike, rng: np.random.Generator
) -> tuple[float, tuple[float, float], float]:
    """Mean difference over seeds, its bootstrap interval, and the p-value of a sign-flip test.

    If two trackers are alike, each seed's difference is as likely to have the other sign (Fisher 1935): the p-value is
    the share of all sign patterns whose mean is at least as far from 0; of `SIGN_FLIPS` random ones, with the observed
    one among them, beyond 14 seeds. With n seeds it cannot be below 2 / 2^n: 5 seeds never reach 0.05.

    Args:
        one: `(N,)` scores, one per seed.
        other: `(N,)` scores on the same seeds.
        rng: For the bootstrap and the random sign flips.

    Returns:
        Mean of one - other; lower and upper end of its 95% interval; two-sided p-value. NaN without seeds.

    Raises:
        ParameterError: The lengths differ.
    """
    first, second = np.asarray(one, dtype=np.float64), np.asarray(other, dtype=np.float64)
    if first.ndim != 1 or first.shape != second.shape:
        raise ParameterError(f"paired scores must have one number per seed, got {first.shape} and {second.shape}")
    gaps = (first - second)[np.isfinite(first) & np.isfinite(second)]
    if not gaps.size:
        return math.nan, (math.nan, math.nan), math.nan
    interval = bootstrap_interval(gaps, rng)
    return float(gaps.mean()), interval, _sign_flip_p(gaps, rng)


def _sign_flip_p(gaps: Numbers, rng: np.random.Generator) -> float:
    exhaustive = gaps.size <= _ALL_FLIPS_UP_TO
    if exhaustive:
        patterns: NDArray[np.int64] = np.indices((2,) * gaps.size).reshape(gaps.size, -1).T
        signs: Numbers = np.float64(1.0) - 2.0 * patterns
    else:
        signs = rng.choice([-1.0, 1.0], (SIGN_FLIPS, gaps.size))
    # Rounding must not tell apart patterns with the same sum.
    reached = np.abs(signs @ gaps) >= abs(gaps.sum()) - 1e-12 * np.abs(gaps).sum()
    if exhaustive:
        return float(reached.mean())
    return (int(reached.sum()) + 1) / (SIGN_FLIPS + 1)


def holm(p_values: ArrayLike) -> Numbers:
    """P-values corrected for many comparisons, step-down (Holm 1979).

    Args:
        p_values: `(N,)`; NaN stay NaN and do not count.

    Returns:
        `(N,)` corrected, in the same order, at most 1.

    Raises:
        ParameterError: Not a row of numbers.

    >>> holm([0.01, 0.04, 0.03]).round(6).tolist()
    [0.03, 0.06, 0.06]
    """
    given = np.asarray(p_values, dtype=np.float64)
    if given.ndim != 1:
        raise ParameterError(f"p_values must have shape (N,), got {given.shape}")
    out = np.full(given.shape, math.nan)
    known = np.flatnonzero(~np.isnan(given))
    order = known[np.argsort(given[known], kind="stable")]
    factors = np.arange(order.size, 0, -1)
    out[order] = np.minimum(np.maximum.accumulate(given[order] * factors), 1.0)
    return out


def compare(scores: Mapping[str, ArrayLike], rng: np.random.Generator) -> list[Comparison]:
    """Every pair of trackers, once, corrected for the number of pairs.

    Args:
        scores: For each tracker `(N,)` scores, one per seed, in the same order of seeds for all; NaN where it has none.
        rng: For bootstraps and sign flips.

    Raises:
        ParameterError: The lengths differ.
    """
    names = list(scores)
    rows = {name: np.asarray(scores[name], dtype=np.float64) for name in names}
    pairs = [(one, other) for index, one in enumerate(names) for other in names[index + 1 :]]
    found = [paired_difference(rows[one], rows[other], rng) for one, other in pairs]
    corrected = holm([p for _, _, p in found])
    return [
        Comparison(one, other, difference, *interval, p, float(after), int(np.isfinite(rows[one] + rows[other]).sum()))
        for (one, other), (difference, interval, p), after in zip(pairs, found, corrected, strict=True)
    ]


def wins(comparisons: Sequence[Comparison], names: Sequence[str], *, level: float = 0.05) -> NDArray[np.int8]:
    """Who beats whom.

    Args:
        comparisons: From `compare`.
        names: Order of rows and columns.
        level: Corrected p-value below which a difference counts.

    Returns:
        `(T, T)`: 1 where the row's tracker is better than the column's, -1 where it is worse, 0 where neither is shown.
    """
    place = {name: index for index, name in enumerate(names)}
    table = np.zeros((len(names), len(names)), dtype=np.int8)
    for one in comparisons:
        if one.p_corrected < level:
            sign = 1 if one.difference > 0.0 else -1
            table[place[one.one], place[one.other]] = sign
            table[place[one.other], place[one.one]] = -sign
    return table
