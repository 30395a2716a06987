"""Thresholds by adaptive trials: QUEST+ for a success rate that falls as a level rises.

The success rate at level x is `p(x) = b S(z(x))`, with `S` the falling logistic function, `b = 1 - lapse` the rate
without stress, and `z = (u(x) - t) / s + S^-1(at / b)`: u is the level's coordinate (its logarithm, or the level), t
the coordinate at which the rate is `at`, and s the spread. Where b is below `at` the rate is too low from the start.
The posterior of t, s and b is held on a grid (Watson, "QUEST+: a general multidimensional Bayesian adaptive
psychometric method", Journal of Vision 17(3):10, 2017); the guess rate is 0. The next level is the one whose outcome is
expected to say most about t, spread and lapse being averaged over (Prins, "The psi-marginal adaptive method", Journal
of Vision 13(7):3, 2013). Counts of successes and failures at each level are all that matters, not their order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray

_SHALLOWEST, _RATIO = 0.3, 1.8  # Largest spread, as a share of the range, and of one to the next
_RATES = (1.0, 0.98, 0.95, 0.88, 0.75, 0.6)  # b of trackers that do break
_RATE_PRIOR = (4.0, 4.0, 3.0, 1.0, 0.5, 0.5)
_TOO_LOW = (0.1, 0.5, 0.9)  # b as shares of `at`, of those that are broken from the start
_BROKEN = 0.1  # Their prior probability
_BEYOND = 0.25  # The grid of t reaches so far beyond both ends, as a share of the range
_FLOOR = 1e-4
LEVEL = 0.95
HIGHEST_AT = 0.9
_GROUPS, _DRAWS = 12, 400
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)  # Its multiples fill the range evenly


@dataclass(frozen=True, eq=False)
class Psychometric:
    """The grid: what each combination of parameters says of each level; `psychometric` makes one.

    Attributes:
        at: Success rate that defines the threshold.
        coordinates: `(L,)` of the levels, rising; the first may be -inf, the level without stress.
        edges: `(T + 1,)` of the cells of t.
        rates: `(L, T, N)` success rate at each level for each t and each pair of spread and b.
        prior: `(T, N)`.
        breaks: `(N,)` whether b is at least `at`.
    """

    at: float
    coordinates: FloatArray
    edges: FloatArray
    rates: FloatArray
    prior: FloatArray
    breaks: BoolArray

    @property
    def ends(self) -> tuple[float, float]:
        """Coordinates of the lowest level with stress and of the highest."""
        known = self.coordinates[np.isfinite(self.coordinates)]
        return float(known[0]), float(known[-1])


@dataclass(frozen=True)
class Threshold:
    """What the trials say of the threshold.

    Attributes:
        coordinate: Median of the posterior within the range; -inf or inf where it lies outside.
        low: Lower end of the interval that holds 95 % of the posterior; -inf where it is open.
        high: Upper end; inf where it is open.
        broken: Posterior probability that the rate is below `at` without stress.
        below: That the threshold is lower than the lowest level with stress, `broken` not counted.
        above: That it is higher than the highest level.
    """

    coordinate: float
    low: float
    high: float
    broken: float
    below: float
    above: float


def psychometric(coordinates: FloatArray, at: float = 0.5) -> Psychometric:
    """The grid for levels `(L,)`, of which at least three are finite.

    Raises:
        ParameterError: `at` is not a rate that can be sought.
    """
    if not 0.1 <= at <= HIGHEST_AT:
        raise ParameterError(f"the success rate of a breaking point must be in [0.1, {HIGHEST_AT}], got {at:g}")
    known: FloatArray = coordinates[np.isfinite(coordinates)]
    low, high = float(known[0]), float(known[-1])
    span, cells = high - low, max(60, 3 * known.size)
    edges = low - _BEYOND * span + (1.0 + 2.0 * _BEYOND) * span / cells * np.arange(cells + 1.0)
    kept = [(rate, weight) for rate, weight in zip(_RATES, _RATE_PRIOR, strict=True) if rate > at + 0.02]
    base, weights = (np.array(column) for column in zip(*kept, strict=True))
    b = np.concatenate([base, at * np.array(_TOO_LOW)])
    broken = np.full(len(_TOO_LOW), _BROKEN / len(_TOO_LOW))
    steepest = span / (3.0 * (known.size - 1))  # What falls within a step of the levels cannot be told apart
    steps = max(1, math.ceil(math.log(_SHALLOWEST * span / steepest) / math.log(_RATIO)))
    spreads = np.geomspace(steepest, max(_SHALLOWEST * span, steepest), steps + 1)
    weights = np.tile(np.concatenate([(1.0 - _BROKEN) * weights / weights.sum(), broken]), spreads.size)
    spread, rate = np.repeat(spreads, b.size), np.tile(b, spreads.size)
    breaks = rate >= at
    shift = np.where(breaks, scipy.special.logit(np.where(breaks, at / rate, 0.5)), 0.0)
    z = (coordinates[:, None, None] - 0.5 * (edges[:-1] + edges[1:])[:, None]) / spread - shift
    rates = np.clip(rate * scipy.special.expit(-z), _FLOOR, 1.0 - _FLOOR)
    prior = np.broadcast_to(weights / (spreads.size * cells), (cells, weights.size))
    return Psychometric(at, coordinates, edges, rates, prior, breaks)


def posterior(grid: Psychometric, counts: FloatArray) -> FloatArray:
    """`(..., T, N)` posterior after counts `(..., L, 2)` of successes and failures."""
    shape = grid.prior.shape
    rates = grid.rates.reshape(len(grid.coordinates), -1)
    log = counts[..., 0] @ np.log(rates) + counts[..., 1] @ np.log1p(-rates) + np.log(grid.prior.ravel())
    weights = np.exp(log - log.max(axis=-1, keepdims=True))
    return (weights / weights.sum(axis=-1, keepdims=True)).reshape(*counts.shape[:-2], *shape)


def information(grid: Psychometric, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What a trial at each level is expected to say, `(..., L)` [nat], and its success rate there, `(..., L)`.

    The mutual information of outcome and threshold, given a posterior `(..., T, N)`. Where the threshold lies outside
    the range is one hypothesis on either side, the lower of which has the rates that are too low from the start, too.
    """
    own = np.where(grid.breaks, weights, 0.0)
    by_cell = own.reshape(-1, *grid.prior.shape).transpose(1, 0, 2) @ grid.rates.transpose(1, 2, 0)
    hits = by_cell.transpose(1, 0, 2).reshape(*own.shape[:-1], -1)
    centres = 0.5 * (grid.edges[:-1] + grid.edges[1:])
    first, last = np.searchsorted(centres, grid.ends).tolist()
    starts = np.array([0, *range(first, last + 1)], dtype=np.intp)
    mass, hits = np.add.reduceat(own.sum(axis=-1), starts, axis=-1), np.add.reduceat(hits, starts, axis=-2)
    rest = np.where(grid.breaks, 0.0, weights)
    mass[..., 0] += rest.sum(axis=(-2, -1))
    hits[..., 0, :] += np.tensordot(rest, grid.rates, axes=((-2, -1), (1, 2)))
    rate = hits.sum(axis=-2)
    each = hits / np.maximum(mass, 1e-300)[..., None]
    return _entropy(rate) - (mass[..., None] * _entropy(each)).sum(axis=-2), rate


def _entropy(rate: FloatArray) -> FloatArray:
    return scipy.special.entr(rate) + scipy.special.entr(1.0 - rate)


def next_levels(grid: Psychometric, counts: FloatArray, number: int, batch: int) -> IntArray:
    """`(..., number)` indices of the levels of the next trials, which say most of the thresholds of K observers.

    The first one goes through the range batch by batch, whatever is expected there: a rate that rises is seen.

    Args:
        grid: The grid.
        counts: `(..., K, L, 2)` successes and failures of the observers who still need trials; all see the next ones.
        number: How many trials to choose before the outcome of any is known; each is counted by its expected outcome.
        batch: How often trials were chosen before.
    """
    weights, chosen = posterior(grid, counts), list[IntArray]()
    hit, miss = np.log(grid.rates), np.log1p(-grid.rates)
    through = int(len(grid.coordinates) * ((batch + 0.5) * _GOLDEN % 1.0))
    for place in range(number):
        gain, rate = information(grid, weights)
        # Rounded, so that the order of sums does not choose between levels that say the same.
        best = np.argmax(gain.sum(axis=-2).round(9), axis=-1)
        level = best if place else np.full_like(best, through)
        expected = np.take_along_axis(rate, level[..., None, None], axis=-1)[..., None]
        own = (one[level][..., None, :, :] for one in (hit, miss))
        weights = weights * np.exp(sum(share * log for share, log in zip((expected, 1.0 - expected), own, strict=True)))
        weights /= weights.sum(axis=(-2, -1), keepdims=True)
        chosen.append(level)
    return np.stack(chosen, axis=-1)


def threshold(grid: Psychometric, counts: FloatArray) -> Threshold:
    """The threshold after counts `(L, 2)` of successes and failures.

    The ends of the interval leave out 2.5 % of the posterior each; one that lies outside the range is open.
    """
    weights = posterior(grid, counts)
    broken = float(weights[:, ~grid.breaks].sum())
    cumulative = broken + np.concatenate([[0.0], np.cumsum(weights[:, grid.breaks].sum(axis=1))])

    def coordinate(share: float) -> float:
        return float(np.interp(share, cumulative, grid.edges))

    tail = 0.5 * (1.0 - LEVEL)
    below, above = (float(np.interp(end, grid.edges, cumulative)) for end in grid.ends)
    low, high = coordinate(tail), coordinate(1.0 - tail)
    # Beyond the range the grid says nothing but that it is beyond.
    low, high = (low if low > grid.ends[0] else -math.inf), (high if high < grid.ends[1] else math.inf)
    middle = -math.inf if below >= 0.5 else math.inf if above <= 0.5 else coordinate(0.5)
    return Threshold(middle, low, high, broken, below - broken, 1.0 - above)


def rise_p_value(counts: FloatArray, rng: np.random.Generator) -> float:
    """How likely a rate that never rises with the level departs from the best such rate as far as these counts do.

    Levels are joined to twelve groups of neighbours. The statistic is the deviance of their rates from the antitonic
    fit, its distribution that of binomial counts drawn from this fit.

    Args:
        counts: `(L, 2)` successes and failures at each level.
        rng: Draws the counts.
    """
    trials = counts.sum(axis=1)
    group: IntArray = np.arange(trials.size, dtype=np.intp) * _GROUPS // trials.size
    columns = (np.bincount(group, column, _GROUPS) for column in (counts[:, 0], trials))
    hits, number = (column.astype(np.float64) for column in columns)
    hits, number = hits[number > 0.0], number[number > 0.0]

    def fitted(successes: FloatArray) -> FloatArray:
        return scipy.optimize.isotonic_regression(successes / number, weights=number, increasing=False).x

    def deviance(successes: FloatArray) -> float:
        rate, fit = successes / number, np.clip(fitted(successes), 0.0, 1.0)
        terms = scipy.special.rel_entr(rate, fit) + scipy.special.rel_entr(1.0 - rate, 1.0 - fit)
        return float(2.0 * (number * terms).sum())

    found, fit = deviance(hits), np.clip(fitted(hits), 0.0, 1.0)
    drawn = rng.binomial(number.astype(np.int64), fit, (_DRAWS, number.size))
    return (1 + sum(deviance(row.astype(np.float64)) >= found - 1e-9 for row in drawn)) / (1 + _DRAWS)


def thresholds_drawn(
    grid: Psychometric, counts: FloatArray, correlation: float, rng: np.random.Generator
) -> FloatArray:
    """`(2, 4000)` coordinates of two thresholds, from the posteriors after counts `(2, L, 2)`.

    Args:
        grid: The grid of both.
        counts: Of two observers who saw the same trials.
        correlation: Of the errors of the two, see `outcome_correlation`; a normal copula joins the posteriors.
        rng: Draws.
    """
    first, second = rng.standard_normal((2, 4000))
    normal = np.stack([first, correlation * first + math.sqrt(1.0 - correlation**2) * second])
    shares = scipy.special.ndtr(normal)
    weights = np.where(grid.breaks, posterior(grid, counts), 0.0).sum(axis=-1)
    cumulative = np.concatenate([np.zeros((2, 1)), np.cumsum(weights, axis=1)], axis=1)
    cumulative /= cumulative[:, -1:]
    drawn = np.empty_like(shares)
    for own, share, known in zip(drawn, shares, cumulative, strict=True):
        own[:] = np.interp(share, known, grid.edges)
    return drawn


def outcome_correlation(grid: Psychometric, counts: FloatArray, levels: IntArray, answers: FloatArray) -> float:
    """Correlation of what two observers do in the same trials beyond what the levels explain, in [-0.95, 0.95].

    It is that of the errors of their thresholds, since these are sums of such residuals.

    Args:
        grid: The grid of both.
        counts: `(2, L, 2)` successes and failures.
        levels: `(N,)` index of each trial's level.
        answers: `(2, N)` 1 for a success, 0 for a failure, NaN for none.
    """
    expected = np.einsum("ltn,ktn->kl", grid.rates, posterior(grid, counts))[:, levels]
    first, second = (answers - expected)[:, ~np.isnan(answers).any(axis=0)]
    size = math.sqrt(float((first**2).sum() * (second**2).sum()))
    return float(np.clip((first * second).sum() / size, -0.95, 0.95)) if size else 0.0
