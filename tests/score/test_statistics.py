"""Intervals and comparisons against scipy, and the laws that they obey."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from pftrack_sim import score
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.score import statistics


def rng() -> np.random.Generator:
    return np.random.default_rng(7)


def test_interval_agrees_with_scipys_percentile_bootstrap():
    values = np.random.default_rng(3).normal(0.6, 0.1, 25)
    low, high = score.bootstrap_interval(values, rng(), resamples=20_000)
    theirs = stats.bootstrap((values,), np.mean, n_resamples=20_000, method="percentile", rng=rng()).confidence_interval
    assert abs(low - theirs.low) < 2e-3
    assert abs(high - theirs.high) < 2e-3


@pytest.mark.slow
def test_interval_holds_the_mean_about_as_often_as_it_says():
    draws = np.random.default_rng(5)
    held = 0
    for _ in range(400):
        low, high = score.bootstrap_interval(draws.normal(0.0, 1.0, 20), draws, resamples=500)
        held += low <= 0.0 <= high
    assert 0.88 < held / 400 < 0.98


def test_many_seeds_are_sampled_and_come_close_to_the_exact_test():
    draws = np.random.default_rng(1)
    gaps = draws.normal(0.03, 0.1, 30)
    _, _, p = score.paired_difference(gaps, np.zeros(30), rng())
    assert abs(p - stats.ttest_1samp(gaps, 0.0).pvalue) < 0.02


def test_fewest_seeds_cannot_be_significant():
    assert score.paired_difference(np.ones(5), np.zeros(5), rng())[2] == 2 / 2**5
    assert score.paired_difference(np.ones(6), np.zeros(6), rng())[2] == 2 / 2**6


@given(st.lists(st.floats(0, 1), min_size=1, max_size=12))
def test_holm_agrees_with_its_definition(p_values: list[float]):
    ours = statistics.holm(p_values)
    order = sorted(range(len(p_values)), key=p_values.__getitem__)
    highest = 0.0
    for place, index in enumerate(order):
        highest = max(highest, min(1.0, p_values[index] * (len(order) - place)))
        assert ours[index] == pytest.approx(highest)


def test_nan_is_left_out_everywhere():
    assert np.array_equal(statistics.holm([0.01, math.nan]), [0.01, math.nan], equal_nan=True)
    assert score.bootstrap_interval([0.5, math.nan], rng()) == pytest.approx((math.nan, math.nan), nan_ok=True)
    mean, _, _ = score.paired_difference([1.0, math.nan, 3.0], [0.0, 0.0, 1.0], rng())
    assert mean == 1.5


def test_who_beats_whom():
    draws = np.random.default_rng(2)
    good = 0.8 + 0.02 * draws.random(12)
    scores = {"good": good, "same": good + 1e-3 * draws.normal(size=12), "bad": good - 0.3}
    compared = score.compare(scores, rng())
    assert [(one.first, one.second) for one in compared] == [("good", "same"), ("good", "bad"), ("same", "bad")]
    assert all(one.p_corrected >= one.p for one in compared)
    assert all(one.seeds == 12 for one in compared)
    table = score.win_matrix(compared, list(scores))
    assert table.tolist() == [[0, 0, 1], [0, 0, 1], [-1, -1, 0]]


def test_same_generator_same_bits():
    values = np.random.default_rng(0).random(20)
    assert score.bootstrap_interval(values, rng()) == score.bootstrap_interval(values, rng())
    assert score.paired_difference(values, values[::-1], rng()) == score.paired_difference(values, values[::-1], rng())


def test_bad_input():
    with pytest.raises(ParameterError, match="per seed"):
        score.paired_difference([1.0], [1.0, 2.0], rng())
    with pytest.raises(ParameterError, match="shape"):
        statistics.holm([[0.1]])


@pytest.mark.parametrize(("held", "count"), [(0, 10), (10, 10), (3, 8), (24, 25), (1, 1)])
def test_shares_agree_with_scipys_wilson_interval(held: int, count: int):
    theirs = stats.binomtest(held, count).proportion_ci(method="wilson")
    values = np.array([1.0] * held + [0.0] * (count - held) + [math.nan])
    assert score.proportion_interval(values) == pytest.approx((theirs.low, theirs.high))


def test_no_share_of_other_numbers():
    assert np.isnan(score.proportion_interval([])).all()
    for wrong in ([0.5], [[1.0]], [2.0]):
        with pytest.raises(ParameterError):
            score.proportion_interval(wrong)
