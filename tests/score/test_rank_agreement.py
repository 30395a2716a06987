"""Rank correlation against scipy, and its interval over seeds."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from pftrack_sim import score
from pftrack_sim.core.errors import ParameterError

levels = st.integers(0, 4).map(lambda number: 0.25 * number)


def rng() -> np.random.Generator:
    return np.random.default_rng(3)


@given(st.lists(st.tuples(levels, levels), min_size=3, max_size=12))
def test_correlation_is_scipys_with_ties_too(pairs: list[tuple[float, float]]):
    first, second = np.array(pairs).T
    ours = score.rank_agreement(first[:, None], second[:, None], rng()).rho
    if np.ptp(first) == 0.0 or np.ptp(second) == 0.0:
        assert math.isnan(ours)
    else:
        assert ours == pytest.approx(stats.spearmanr(first, second).statistic)


@pytest.mark.slow
def test_interval_agrees_with_scipys_bootstrap_of_paired_seeds():
    draws = np.random.default_rng(1)
    first = np.linspace(0.2, 0.8, 8)[:, None] + draws.normal(0.0, 0.3, (8, 12))
    second = np.linspace(0.2, 0.8, 8)[:, None] + draws.normal(0.0, 0.5, (8, 12))
    ours = score.rank_agreement(first, second, rng())
    theirs = stats.bootstrap(
        (np.arange(12),),
        lambda seeds: stats.spearmanr(first[:, seeds].mean(axis=1), second[:, seeds].mean(axis=1)).statistic,
        n_resamples=5000, method="percentile", vectorized=False, rng=rng(),
    ).confidence_interval  # fmt: skip
    assert ours.rho == pytest.approx(stats.spearmanr(first.mean(axis=1), second.mean(axis=1)).statistic)
    assert ours.low == pytest.approx(theirs.low, abs=0.03)
    assert ours.high == pytest.approx(theirs.high, abs=0.03)
    assert ours.low < ours.rho < ours.high


def test_missing_scores_are_left_out():
    first = np.repeat([[0.1, np.nan], [0.5, 0.5], [0.9, 0.7]], 3, axis=1)
    agreement = score.rank_agreement(first, np.repeat([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0]], 3, axis=1), rng())
    assert agreement.rho == pytest.approx(1.0)
    assert agreement.low > 0.8


@pytest.mark.parametrize("seeds", [1, 4])
def test_few_seeds_say_nothing_of_others(seeds: int):
    agreement = score.rank_agreement([[0.1] * seeds, [0.2] * seeds], [[0.3] * seeds, [0.4] * seeds], rng())
    assert agreement.rho == pytest.approx(1.0)
    assert math.isnan(agreement.low)
    assert math.isnan(agreement.high)


def test_what_is_no_pair_of_scores_is_refused():
    with pytest.raises(ParameterError, match="same shape"):
        score.rank_agreement(np.zeros((2, 3)), np.zeros((2, 4)), rng())
    with pytest.raises(ParameterError, match="method 1 has no score"):
        score.rank_agreement([[0.1], [np.nan]], [[0.3], [0.4]], rng())
