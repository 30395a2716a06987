"""Breaking points of simulated observers: laws of the posterior, and how often its interval holds the truth."""

import math

import numpy as np
import pytest
from observers import coordinates, covered, search, success_rates

from pftrack_sim.benchmark.limits.psychometric import (
    information,
    next_levels,
    outcome_correlation,
    posterior,
    psychometric,
    rise_p_value,
    threshold,
    thresholds_drawn,
)
from pftrack_sim.core.errors import ParameterError

GRID = psychometric(coordinates())
LEVELS = len(GRID.coordinates)


def counted(rate: np.ndarray, trials: int = 20) -> np.ndarray:
    hits = np.round(trials * rate)
    return np.stack([hits, trials - hits], axis=-1)


@pytest.mark.parametrize("at", [0.5, 0.75, 0.9])
def test_the_rate_falls_with_the_level_and_is_the_wanted_one_at_the_threshold(at):
    grid = psychometric(coordinates(), at)
    assert (np.diff(grid.rates, axis=0) <= 0.0).all()
    assert abs(grid.prior.sum() - 1.0) < 1e-12
    centres = 0.5 * (grid.edges[:-1] + grid.edges[1:])
    for cell in range(20, len(centres) - 20, 7):
        rates = np.array([np.interp(centres[cell], grid.coordinates[1:], one) for one in grid.rates[1:, cell].T])
        shallow = grid.breaks & (np.arange(rates.size) >= rates.size // 2)  # interpolation bends the steep ones
        assert np.abs(rates[shallow] - at).max() < 0.02


@pytest.mark.parametrize("at", [0.0, 0.95, math.nan])
def test_a_rate_that_cannot_be_sought_is_an_error(at):
    with pytest.raises(ParameterError, match="success rate of a breaking point"):
        psychometric(coordinates(), at)


def test_many_trials_find_the_threshold_of_an_observer():
    rates = success_rates(GRID, at=0.4, spread=0.06, lapse=0.02)
    found = threshold(GRID, counted(rates, 400))
    low, high = GRID.ends
    assert abs(found.coordinate - (low + 0.4 * (high - low))) < 0.01 * (high - low)
    assert found.low < found.coordinate < found.high
    assert found.broken + found.below + found.above < 1e-6


@pytest.mark.parametrize(
    ("rate", "name", "open_low", "open_high"), [(0.98, "above", False, True), (0.1, "broken", True, False)]
)
def test_what_lies_outside_the_range_is_open_and_not_extrapolated(rate, name, open_low, open_high):
    found = threshold(GRID, counted(np.full(LEVELS, rate), 4))
    assert getattr(found, name) > 0.975
    assert math.isinf(found.coordinate)
    assert math.isinf(found.high) or not open_high
    assert math.isinf(found.low) or not open_low


def test_without_outcomes_the_interval_is_open_on_both_sides():
    found = threshold(GRID, np.zeros((LEVELS, 2)))
    assert (found.low, found.high) == (-math.inf, math.inf)


def test_information_is_that_of_one_bit_at_most_and_none_where_the_outcome_is_certain():
    gain, rate = information(GRID, posterior(GRID, counted(success_rates(GRID, 0.5, 0.06, 0.0))))
    assert (gain > -1e-12).all()
    assert (gain < math.log(2.0)).all()
    assert gain[-1] < 0.01 * gain.max()
    assert (np.diff(rate) <= 1e-12).all()


def test_the_next_levels_lie_near_the_threshold_and_depend_on_no_order_of_observers():
    counts = np.stack([counted(success_rates(GRID, at, 0.04, 0.0), 6) for at in (0.3, 0.7)])
    chosen = next_levels(GRID, counts, 8, 0)
    assert chosen.tolist() == next_levels(GRID, counts[::-1], 8, 0).tolist()
    places = np.interp(GRID.coordinates[chosen[1:]], GRID.ends, (0.0, 1.0))
    assert {round(10 * one) for one in places} <= {2, 3, 4, 6, 7, 8}
    alone = next_levels(GRID, counts[:1], 8, 0)[1:]
    assert np.abs(np.interp(GRID.coordinates[alone], GRID.ends, (0.0, 1.0)) - 0.3).max() < 0.2


def test_a_rate_that_rises_is_told_from_one_that_falls():
    rng = np.random.default_rng(0)
    falling = counted(success_rates(GRID, 0.5, 0.08, 0.02), 3)
    assert rise_p_value(falling, rng) > 0.5
    rising = counted(np.where(np.abs(np.arange(LEVELS) - 12) < 5, 0.0, 1.0), 3)
    assert rise_p_value(rising, rng) < 0.01
    assert rise_p_value(np.zeros((LEVELS, 2)), rng) == 1.0


def test_the_first_level_of_each_batch_goes_through_the_whole_range():
    counts = counted(success_rates(GRID, 0.5, 0.04, 0.0), 6)[None]
    levels = sorted(int(next_levels(GRID, counts, 1, batch)[0]) for batch in range(12))
    assert levels[0] < 4
    assert levels[-1] > LEVELS - 4
    assert np.diff(levels).max() < 6


def test_outcomes_that_agree_beyond_the_levels_are_correlated_and_narrow_the_difference():
    rng = np.random.default_rng(1)
    rates = success_rates(GRID, 0.5, 0.1, 0.0)
    levels = np.repeat(np.arange(8, 26), 10)
    draws = rng.random(levels.size)
    same = np.stack([draws < rates[levels]] * 2).astype(float)
    other = np.stack([same[0], rng.random(levels.size) < rates[levels]]).astype(float)
    lengths = []
    for answers in (same, other):
        counts = np.zeros((2, LEVELS, 2))
        for own, mine in zip(counts, answers, strict=True):
            np.add.at(own, (levels, (1 - mine).astype(int)), 1.0)
        correlation = outcome_correlation(GRID, counts, levels, answers)
        drawn = thresholds_drawn(GRID, counts, correlation, np.random.default_rng(2))
        lengths.append((correlation, np.ptp(np.quantile(drawn[0] - drawn[1], [0.025, 0.975]))))
    assert lengths[0][0] == 0.95
    assert abs(lengths[1][0]) < 0.3
    assert lengths[0][1] < 0.5 * lengths[1][1]


def coverage(at: float, spread: float, lapse: float, observers: int, shape: str = "logistic") -> float:
    rates = np.tile(success_rates(GRID, at, spread, lapse, shape), (observers, 1))
    return float(covered(GRID, search(GRID, rates, 64, np.random.default_rng(3)), at).mean())


def test_the_interval_holds_the_threshold_of_a_few_observers():
    assert coverage(0.5, 0.06, 0.02, 60) > 0.85


@pytest.mark.slow
@pytest.mark.parametrize("at", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("lapse", [0.0, 0.05])
def test_the_interval_holds_the_threshold_in_95_of_100_observers(at, lapse):
    # 1,000 observers: the standard error is 0.7 %.
    assert 0.93 <= coverage(at, 0.06, lapse, 1000) <= 0.985


@pytest.mark.slow
def test_a_grid_of_levels_needs_more_trials_for_the_same_interval():
    rates = success_rates(GRID, 0.4, 0.03, 0.02)
    adaptive = search(GRID, np.tile(rates, (100, 1)), 64, np.random.default_rng(4))
    rng, places = np.random.default_rng(5), np.arange(1, LEVELS, 4)
    grid = np.zeros((100, LEVELS, 2))
    hits = rng.binomial(16, rates[places], (100, places.size))
    grid[:, places] = np.stack([hits, 16 - hits], axis=-1)
    lengths = [[found.high - found.low for found in (threshold(GRID, one) for one in own)] for own in (adaptive, grid)]
    assert np.median(lengths[0]) < 0.9 * np.median(lengths[1])
