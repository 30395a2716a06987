"""The particle filter against closed-form results."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from pftrack_sim.trackers.box_filter import clip_states
from pftrack_sim.trackers.filters import ParticleFilter, RandomWalk, systematic_resampling
from pftrack_sim.trackers.relatives.yang2005 import SobolNormals

WEIGHTS = np.array([0.02, 0.2, 0.0, 0.31, 0.07, 0.15, 0.25])


def redrawn(rng: np.random.Generator, *, multinomial: bool) -> np.ndarray:
    """Which particles of a filter with `WEIGHTS` are drawn."""
    particle_filter = ParticleFilter(np.arange(7.0)[:, None], rng)
    with np.errstate(divide="ignore"):
        particle_filter.weigh(np.log(WEIGHTS))
    particle_filter.resample(multinomial=multinomial)
    return particle_filter.states[:, 0].astype(int)


@pytest.mark.parametrize("multinomial", [False, True])
def test_resampling_of_n_particles_is_unbiased(multinomial: bool):
    rng = np.random.default_rng(1)
    counts = np.array([np.bincount(redrawn(rng, multinomial=multinomial), minlength=7) for _ in range(15_000)])
    error = counts.mean(axis=0) - 7 * WEIGHTS
    assert (np.abs(error) <= 4 * counts.std(axis=0) / np.sqrt(len(counts)) + 1e-12).all()


def test_multinomial_draws_are_independent():
    rng = np.random.default_rng(2)
    pairs = np.array([redrawn(rng, multinomial=True)[:2] for _ in range(20_000)])
    together = np.histogram2d(*pairs.T, bins=np.arange(8))[0] / len(pairs)
    assert np.abs(together - np.outer(WEIGHTS, WEIGHTS)).max() < 0.01


@pytest.mark.parametrize(
    ("likelihoods", "share"), [([1, 1, 1, 1], 1.0), ([0, 0, 5, 0], 0.25), ([0, 2, 2, 0], 0.5), ([0, 0, 0, 0], 1.0)]
)
def test_effective_sample_size(likelihoods: list[float], share: float):
    particle_filter = ParticleFilter(np.zeros((4, 1)), np.random.default_rng(0))
    with np.errstate(divide="ignore"):
        particle_filter.weigh(np.log(np.array(likelihoods, dtype=float)))
    assert particle_filter.effective_share == pytest.approx(share)


positive = arrays(np.float64, st.integers(1, 40), elements=st.floats(0, 1)).filter(lambda w: w.sum() > 1e-6)


@given(positive, st.integers(0, 2**32 - 1))
def test_systematic_resampling_counts_differ_by_less_than_one(raw: np.ndarray, seed: int):
    weights = raw / raw.sum()
    chosen = systematic_resampling(weights, np.random.default_rng(seed))
    seen = np.bincount(chosen, minlength=weights.size)
    assert chosen.size == weights.size
    assert (np.diff(chosen) >= 0).all()
    assert (np.abs(seen - weights.size * weights) < 1 + 1e-6).all()
    assert (seen[weights == 0] == 0).all()


def test_random_walk_has_the_given_noise():
    states = np.tile([10.0, 20, 30], (200_000, 1))
    drawn = RandomWalk((1.0, 0.5, 0.0)).draw(states, np.random.default_rng(0)) - states
    assert np.allclose(drawn.mean(axis=0), 0, atol=0.01)
    assert np.allclose(drawn.std(axis=0), [1, 0.5, 0], atol=0.01)
    assert (states == [10, 20, 30]).all()


@pytest.mark.parametrize("wanted", [0.0, 0.6, 1.0])
def test_random_walk_has_the_given_correlation(wanted: float):
    drawn = RandomWalk((1.0, 1.0, 2.0, 0.5), wanted).draw(np.zeros((200_000, 4)), np.random.default_rng(0))
    assert np.allclose(drawn.std(axis=0), [1, 1, 2, 0.5], rtol=0, atol=0.01)
    expected = np.eye(4)
    expected[2, 3] = expected[3, 2] = wanted
    assert np.allclose(np.corrcoef(drawn.T), expected, rtol=0, atol=0.01)


def test_sobol_normals_are_normal_and_more_even_than_independent_draws():
    quasi, rng = SobolNormals(4, np.random.default_rng(0)), np.random.default_rng(0)
    quasi_means, means = (
        np.array([draw() for _ in range(50)]).mean(axis=1)
        for draw in (lambda: quasi.draw(256), lambda: rng.standard_normal((256, 4)))
    )
    assert np.abs(quasi_means).mean() < 0.1 * np.abs(means).mean()
    many = quasi.draw(4096)
    assert np.allclose(np.cov(many.T), np.eye(4), rtol=0, atol=0.02)
    assert stats.kstest(many[:, 2], "norm").statistic < 0.002


def test_sobol_normals_go_on_and_depend_on_their_generator_alone():
    first, second, other = (SobolNormals(2, np.random.default_rng(seed)) for seed in (1, 1, 2))
    draws = [first.draw(count) for count in (5, 8, 1)]
    assert [draw.shape for draw in draws] == [(5, 2), (8, 2), (1, 2)]
    assert all(np.array_equal(draw, second.draw(len(draw))) for draw in draws)
    assert not np.array_equal(draws[0], other.draw(5))
    assert not np.array_equal(draws[0], draws[1][:5])


def test_a_random_walk_takes_its_noise_from_a_given_source():
    states, source = np.arange(12.0).reshape(3, 4), SobolNormals(4, np.random.default_rng(3))
    walk = RandomWalk((1.0, 2.0, 0.0, 0.5), normals=SobolNormals(4, np.random.default_rng(3)).draw)
    expected = states + source.draw(3) * [1.0, 2.0, 0.0, 0.5]
    assert np.allclose(walk.draw(states, np.random.default_rng(0)), expected, rtol=0, atol=1e-12)


def test_filter_agrees_with_the_kalman_filter():
    """x' = x + N(0, q), y = x + N(0, r): mean and variance are known in closed form."""
    q, r, steps, runs = 0.5, 0.8, 15, 40
    truth_rng = np.random.default_rng(3)
    hidden = np.cumsum(truth_rng.normal(0, np.sqrt(q), steps))
    observed = hidden + truth_rng.normal(0, np.sqrt(r), steps)
    mean, variance = 0.0, 1.0
    for y in observed:
        variance += q
        gain = variance / (variance + r)
        mean, variance = mean + gain * (y - mean), (1 - gain) * variance
    means, variances = np.empty(runs), np.empty(runs)
    for run in range(runs):
        rng = np.random.default_rng([11, run])
        moving = ParticleFilter(rng.standard_normal((4000, 1)), rng)
        for step, y in enumerate(observed):
            moving.predict(RandomWalk((float(np.sqrt(q)),)))
            moving.weigh(-0.5 * (y - moving.states[:, 0]) ** 2 / r)
            means[run] = moving.mean()[0]
            variances[run] = moving.weights @ (moving.states[:, 0] - means[run]) ** 2
            if step % 2:  # weights carried over one step must count as well
                moving.resample()
    for found, exact in ((means, mean), (variances, variance)):
        assert abs(found.mean() - exact) < 3 * found.std(ddof=1) / np.sqrt(runs)


def test_weights_do_not_underflow():
    moving = ParticleFilter(np.arange(3.0)[:, None], np.random.default_rng(0))
    moving.weigh(np.array([-5000.0, -5000 + np.log(3), -np.inf]))
    assert np.allclose(moving.weights, [0.25, 0.75, 0], atol=1e-12)
    assert moving.mean()[0] == pytest.approx(0.75)


def test_weights_are_equal_when_every_likelihood_is_zero():
    moving = ParticleFilter(np.arange(4.0)[:, None], np.random.default_rng(0))
    moving.weigh(np.full(4, -np.inf))
    assert moving.weights.tolist() == [0.25] * 4
    moving.resample()
    assert moving.states.ravel().tolist() == [0, 1, 2, 3]


def test_top_mean_matches_hand_computed_values():
    moving = ParticleFilter(np.array([[0.0], [10.0], [20.0], [40.0]]), np.random.default_rng(0))
    moving.weigh(np.log([0.1, 0.4, 0.2, 0.3]))
    assert moving.mean(1)[0] == 10
    assert moving.mean(2)[0] == pytest.approx((0.4 * 10 + 0.3 * 40) / 0.7)
    assert moving.mean()[0] == moving.mean(9)[0] == pytest.approx(0 + 4 + 4 + 12)


def test_resampling_and_restarting_reset_the_weights():
    given_states = np.arange(5.0)[:, None]
    moving = ParticleFilter(given_states, np.random.default_rng(0))
    moving.weigh(np.log([1e-9, 1e-9, 1.0, 1e-9, 1e-9]))
    moving.resample()
    assert moving.states.shape == (5, 1)
    assert moving.states.mean() == pytest.approx(2, abs=0.01)
    assert np.allclose(moving.weights, 1 / 5, atol=1e-15)
    moving.restart(np.array([7.0]))
    assert moving.states.ravel().tolist() == [7.0] * 5
    assert given_states.ravel().tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("top", [None, 20])
def test_identical_particles_have_exactly_that_mean(top: int | None):
    state = np.array([28.1, 41.0, 20.7, 32.3])
    moving = ParticleFilter(np.tile(state, (400, 1)), np.random.default_rng(0))
    moving.weigh(np.random.default_rng(1).normal(size=400))
    assert moving.mean(top).tolist() == state.tolist()


@pytest.mark.parametrize("min_size", [2.0, np.array([7.5, 20.0])])
def test_clipped_states_have_their_centre_in_the_image_and_a_bounded_size(min_size: float | np.ndarray):
    states = np.random.default_rng(0).uniform(-100.0, 500.0, (50, 6))
    before = states.copy()
    clip_states(states, np.zeros((120, 160, 3), np.uint8), min_size)
    assert ((states[:, :2] >= 0) & (states[:, :2] <= [160, 120])).all()
    assert ((states[:, 2:4] >= min_size) & (states[:, 2:4] <= [320, 240])).all()
    assert np.array_equal(states[:, 4:], before[:, 4:])
