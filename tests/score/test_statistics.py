"""Intervals and comparisons against scipy, and the laws that they obey."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from pftrack_sim import score
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.score import statistics

SIMULATIONS = 10_000
SEEDS = (5, 6, 10, 20, 50)
SCORES: dict[str, tuple[Callable[[np.random.Generator, tuple[int, int]], FloatArray], float]] = {
    "normal": (lambda rng, shape: rng.normal(0.5, 0.15, shape), 0.5),
    "mostly low, a long tail": (lambda rng, shape: rng.lognormal(-1.5, 0.5, shape), math.exp(-1.5 + 0.5**3)),
    "good, 1 is the most": (lambda rng, shape: rng.beta(8.0, 2.0, shape), 0.8),
    "very good": (lambda rng, shape: rng.beta(5.0, 1.0, shape), 5.0 / 6.0),
    "anything from 0 to 1": (lambda rng, shape: rng.beta(2.0, 2.0, shape), 0.5),
}
"""Scores of seeds, and their true means."""


@pytest.mark.parametrize("seeds", SEEDS)
@pytest.mark.parametrize("name", SCORES)
def test_intervals_hold_the_mean_in_93_to_97_of_100_simulations(name: str, seeds: int):
    draw, mean = SCORES[name]
    low, high, p = statistics.mean_intervals(draw(np.random.default_rng(seeds), (SIMULATIONS, seeds)) - mean)
    assert 0.93 < np.mean((low <= 0.0) & (high >= 0.0)) < 0.97
    assert ((p < score.LEVEL) == ((low > 0.0) | (high < 0.0))).mean() > 0.9999, "the test is that of the interval"


@pytest.mark.parametrize("seeds", [10, 20, 50])
@pytest.mark.parametrize("name", SCORES)
def test_a_claim_of_three_differences_that_do_not_exist_errs_in_at_most_5_of_100_cases(name: str, seeds: int):
    draws, (draw, _) = np.random.default_rng(seeds), SCORES[name]
    own, *others = (draw(draws, (SIMULATIONS, seeds)) for _ in range(4))
    p_values = np.sort([statistics.mean_intervals(own - other)[2] for other in others], axis=0)
    assert np.mean(p_values[0] * 3 < score.LEVEL) <= 0.05, "Holm's first step decides whether any is shown"


def test_an_interval_agrees_with_halls_formula_and_is_no_narrower_than_student_s():
    values = np.random.default_rng(3).lognormal(-1.5, 0.8, 25)
    found = score.mean_over_seeds(values)
    ends = np.array([found.low, found.high])
    student = stats.t.interval(0.95, 24, values.mean(), stats.sem(values))
    assert ends[0] <= student[0]
    assert ends[1] >= student[1]
    # At the upper end the transformed t of the true mean is the lower quantile.
    skewness = stats.skew(values)
    t = (values.mean() - ends[1]) / stats.sem(values)
    transformed = t + skewness * t**2 / (3 * 5) + skewness**2 * t**3 / (27 * 25) + skewness / (6 * 5)
    assert transformed == pytest.approx(stats.t.ppf(0.025, 24))
    assert found.mean == pytest.approx(values.mean())
    assert found.spread == pytest.approx(values.std(ddof=1))


def test_no_interval_leaves_what_a_score_can_be():
    values = [0.0, 0.02, 0.95, 0.97, 1.0]
    wide, clipped = score.mean_over_seeds(values), score.mean_over_seeds(values, score.bounds_of("mean_overlap"))
    assert wide.low < 0.0
    assert wide.high > 1.0
    assert (clipped.low, clipped.high, clipped.mean) == (0.0, 1.0, wide.mean)
    difference = score.paired_difference([1.0] * 5, [0.0, 0.0, 0.0, 0.0, 1.0], score.bounds_of("success"))
    assert difference.high == 1.0
    assert score.bounds_of("follow_distance_rms_m") == (0.0, np.inf)


def test_equal_values_leave_no_room():
    same = score.mean_over_seeds([0.25] * 12)
    assert (same.low, same.high, same.p, same.verdict) == (0.25, 0.25, 0.0, "above")
    assert score.mean_over_seeds([0.0] * 12).verdict == "undecided"


@pytest.mark.parametrize("seeds", [0, 1, 4, 5, 9, 10])
@pytest.mark.parametrize("of", [score.mean_over_seeds, score.proportion_over_seeds])
def test_five_seeds_for_an_interval_and_ten_for_a_verdict(of: Callable[[FloatArray], score.SeedMean], seeds: int):
    found = of(np.ones(seeds))
    assert found.seeds == seeds
    assert math.isnan(found.low) == (seeds < 5)
    assert math.isnan(found.p) == (seeds < 10)
    assert found.verdict == ("above" if seeds >= 10 else "needs 10 seeds")


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
    assert score.paired_difference([1.0, math.nan, 3.0], [0.0, 0.0, 1.0]).values == (1.0, 2.0)


def test_who_beats_whom():
    draws = np.random.default_rng(2)
    good = 0.8 + 0.02 * draws.random(12)
    scores = {"good": good, "same": good + 1e-3 * draws.normal(size=12), "bad": good - 0.3}
    compared = score.compare(scores)
    alone = [score.paired_difference(scores[one.first], scores[one.second]) for one in compared]
    assert [(one.first, one.second) for one in compared] == [("good", "same"), ("good", "bad"), ("same", "bad")]
    assert [one.difference.p for one in compared] == statistics.holm([one.p for one in alone]).tolist()
    assert all(one.difference.seeds == 12 for one in compared)
    assert [one.difference.verdict for one in compared] == ["undecided", "above", "above"]


def test_bad_input():
    with pytest.raises(ParameterError, match="per seed"):
        score.paired_difference([1.0], [1.0, 2.0])
    with pytest.raises(ParameterError, match="shape"):
        statistics.holm([[0.1]])
    with pytest.raises(ParameterError, match="shape"):
        score.mean_over_seeds([[0.1]])


@pytest.mark.parametrize(("held", "count"), [(0, 10), (10, 10), (3, 8), (24, 25)])
def test_shares_agree_with_scipys_wilson_interval(held: int, count: int):
    theirs = stats.binomtest(held, count).proportion_ci(method="wilson")
    values = np.array([1.0] * held + [0.0] * (count - held) + [math.nan])
    found = score.proportion_over_seeds(values, 0.5)
    assert (found.low + 0.5, found.high + 0.5) == pytest.approx((theirs.low, theirs.high))
    assert found.mean == pytest.approx(held / count - 0.5)


def test_no_share_of_other_numbers():
    for wrong in ([0.5], [[1.0]], [2.0]):
        with pytest.raises(ParameterError):
            score.proportion_over_seeds(wrong)


def test_the_skill_of_all_seeds_is_that_of_their_means_and_its_interval_covers_it():
    draws = np.random.default_rng(0)
    # Means over 12 scenarios of unequal difficulty; in many of them the target is lost at some time.
    tracked = np.clip(np.linspace(0.6, 0.9, 12) + draws.normal(0.0, 0.05, (2000, 10, 12)), 0.0, 1.0)
    lost = draws.random(tracked.shape) < np.linspace(0.0, 0.6, 12)
    overlaps = np.where(lost, tracked * draws.random(tracked.shape), tracked).mean(axis=-1)
    stays = np.clip(draws.beta(2, 10, tracked.shape), 0.0, 1.0).mean(axis=-1)
    true = (overlaps.mean() - stays.mean()) / (1.0 - stays.mean())
    found = [score.skill_over_seeds(*one) for one in zip(overlaps, stays, strict=True)]
    assert found[0].mean == pytest.approx((overlaps[0].mean() - stays[0].mean()) / (1.0 - stays[0].mean()))
    assert 0.93 < np.mean([one.low <= true <= one.high for one in found]) < 0.98


def test_skill_is_0_for_a_box_that_stays_and_leaves_out_seeds_that_one_of_both_lacks():
    stays = [0.1, 0.3, 0.2, 0.5, 0.4]
    assert score.skill_over_seeds(stays, stays).values == (0.0,) * 5
    assert score.skill_over_seeds([1.0] * 5, stays).mean == 1.0
    with_gaps = score.skill_over_seeds([0.5, math.nan, 0.9, 0.2], [0.1, 0.3, math.nan, 0.1])
    assert with_gaps.values == pytest.approx(score.skill_over_seeds([0.5, 0.2], [0.1, 0.1]).values)
    assert math.isnan(score.skill_over_seeds([1.0], [1.0]).mean)


@pytest.mark.parametrize("shared", [0.0, 0.5])
@pytest.mark.parametrize("rate", [0.1, 0.5, 0.9])
def test_the_interval_of_a_success_rate_over_drives_in_four_places_covers_it(rate: float, shared: float):
    draws = np.random.default_rng(0)
    places = np.clip(rate + min(rate, 1.0 - rate) * np.array([-0.6, -0.2, 0.2, 0.6]), 0.01, 0.99)
    odds = np.log(places / (1.0 - places))
    # Drives of one seed have a part of their odds in common.
    rates = 1.0 / (1.0 + np.exp(-(odds + draws.normal(0.0, shared, (20_000, 18, 1)))))
    drives = (draws.random((1000, 18, 4)) < rates[:1000]).reshape(1000, 72).astype(np.float64)
    found = [score.proportion_over_seeds(one) for one in drives]
    assert 0.92 < np.mean([one.low <= rates.mean() <= one.high for one in found]) < 0.99
