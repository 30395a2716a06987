"""Pixel mixtures: likelihood, learning and outliers."""

import numpy as np
import pytest

from pftrack_sim.trackers.features.pixel_mixture import MixtureParameters, OutlierRule, PixelMixture, huber

PARAMETERS = MixtureParameters(
    half_life=20.0,
    sigma_wandering=0.5,
    sigma_stable=0.5,
    sigma_fixed=0.5,
    sigma_min=0.1,
    share_min=0.001,
    outlier_c=1.3,
)


def test_huber_matches_hand_computed_values():
    """Eq. 12."""
    x = np.array([0.0, 1.0, -1.0, 1.3, 2.0, -2.0])
    expected = [0, 0.5, 0.5, 0.845, 1.3 * 2 - 0.845, 1.3 * 2 - 0.845]
    assert np.allclose(huber(x, 1.3), expected, rtol=0, atol=1e-12)
    assert huber(np.array([1.3 + 1e-9]), 1.3)[0] == pytest.approx(0.845, abs=1e-8)


def mixture(first: np.ndarray, **changed: float) -> PixelMixture:
    return PixelMixture(first.astype(np.float32), PARAMETERS.model_copy(update=changed))


# Limits are 0.65 away: W explains 0.35..1.65, S 1.35..2.65, F 2.35..3.65.
@pytest.mark.parametrize(
    ("patch", "most", "stable", "none"),
    [
        ([1.0] * 10, 1.0, 1.0, 0.0),
        ([2.0] * 10, 1.0, 0.0, 0.0),
        ([2.5] * 10, 1.0, 0.0, 0.0),
        ([1.5] * 5 + [2.5] * 5, 0.5, 0.0, 0.0),
        ([2.0] * 7 + [9.0] * 3, 1.0, 0.3, 0.3),
        ([1.64] * 9 + [3.66], 1.0, 0.1, 0.1),
        ([-5.0] * 10, 1.0, 1.0, 1.0),
    ],
)
def test_outliers_are_counted(patch: list[float], most: float, stable: float, none: float):
    model = mixture(np.zeros(10))
    model.means[:] = np.array([[1.0], [2.0], [3.0]])
    rules: tuple[tuple[OutlierRule, float], ...] = (("most", most), ("stable", stable), ("all", none))
    for rule, expected in rules:
        assert model.outlier_share(np.array(patch, np.float32), rule) == pytest.approx(expected)


def test_the_prediction_error_is_one_at_one_sigma():
    """Eq. 10."""
    first = np.linspace(-1, 1, 50).astype(np.float32)
    model = mixture(first)
    assert model.prediction_error(first) == pytest.approx(0, abs=1e-9)
    assert model.prediction_error(first + np.float32(0.5)) == pytest.approx(1, abs=1e-5)
    x = 2.0 * np.ones(50)
    assert model.prediction_error(first + np.float32(1.0)) == pytest.approx(2 * huber(x, 1.3)[0], abs=1e-5)


def test_the_likelihood_of_one_pixel_matches_hand_computed_values():
    model = mixture(np.zeros(1))
    model.means[:] = np.array([[0.0], [1.0], [9.0]])
    near, far = np.exp(-0.5), np.exp(-(1.3 * 3 - 0.845))
    for z, robust, weight in ((0.5, False, 2 * near), (0.0, False, 1 + np.exp(-2)), (-0.5, True, near + far)):
        found = model.log_likelihood(np.array([[z]], np.float32), robust=robust)
        assert found[0] == pytest.approx(np.log(weight * 2 / 3), abs=1e-5)


def test_likelihoods_of_extreme_patches_are_finite():
    model = mixture(np.zeros(40))
    found = model.log_likelihood(np.array([[0.0] * 40, [1e6] * 40], np.float32), robust=False)
    assert np.isfinite(found).all()
    assert found[0] > found[1]


def test_the_stable_component_finds_mean_and_spread():
    """Patches that vary about a mean other than the first: S learns mean and spread, F is the first, W the last."""
    rng = np.random.default_rng(5)
    picture, spread = rng.standard_normal(300), 0.3
    first = (picture + rng.normal(0, spread, 300)).astype(np.float32)
    model = mixture(first, half_life=60.0, sigma_min=0.05)
    for _ in range(400):
        patch = (picture + rng.normal(0, spread, 300)).astype(np.float32)
        model.learn(patch)
    assert abs(np.mean(model.means[1] - picture)) < 0.02
    assert np.sqrt(np.mean((model.means[1] - picture) ** 2)) < 0.1
    assert model.sigmas[1].mean() == pytest.approx(spread, abs=0.06)
    assert np.array_equal(model.means[2], first)
    assert np.array_equal(model.means[0], patch)
    assert np.array_equal(model.sigmas[[0, 2]], np.full((2, 300), 0.5))


def test_two_alternating_images_get_a_component_each():
    """The first image returns every third frame: it belongs to F, the others to S."""
    rng = np.random.default_rng(6)
    first, other = np.full(200, -1.0, np.float32), 1.0
    model = mixture(first, half_life=60.0, sigma_wandering=0.05, sigma_fixed=0.2, sigma_min=0.05)
    for frame in range(600):
        centre = -1.0 if frame % 3 == 0 else other
        model.learn((centre + rng.normal(0, 0.15, 200)).astype(np.float32))
    assert model.means[1].mean() == pytest.approx(other, abs=0.1)
    assert model.shares[2].mean() == pytest.approx(1 / 3, abs=0.08)


def test_shares_stay_normalised_and_bounded():
    rng = np.random.default_rng(7)
    model = mixture(np.zeros(60))
    for frame in range(200):
        model.learn((rng.normal(0, 10.0 ** rng.integers(-2, 3), 60) + frame % 7).astype(np.float32))
        assert np.allclose(model.shares.sum(axis=0), 1, rtol=0, atol=1e-12)
        assert model.shares.min() >= 0.99 * PARAMETERS.share_min
        assert model.sigmas.min() >= PARAMETERS.sigma_min
        assert np.isfinite(model.means).all()


@pytest.mark.parametrize("half_life", [1.0, 5.0, 40.0])
def test_the_weight_of_an_observation_halves_after_the_half_life(half_life: float):
    """The share of a component without pixels halves."""
    sigmas = {"sigma_wandering": 0.1, "sigma_stable": 0.1, "sigma_fixed": 0.1}
    model = mixture(np.zeros(3), half_life=half_life, share_min=1e-9, **sigmas)
    for _ in range(round(half_life)):
        model.learn(np.full(3, 8.0, np.float32))
        # W is the last patch: it takes all from the second frame on; in the first, all three are as far off.
        model.means[0] = 8.0
    lost = model.shares[2, 0] - (1 - 0.5 ** (1 / half_life)) / 3 * 0.5 ** (1 - 1 / half_life)
    assert lost == pytest.approx(0.5 / 3, rel=1e-6)


def test_similarity_is_a_correlation():
    first = np.random.default_rng(0).standard_normal(50).astype(np.float32)
    model = mixture(first)
    assert model.similarity(first) == pytest.approx(1)
    assert model.similarity(3 * first) == pytest.approx(1)
    assert model.similarity(-first) == 0
    assert model.similarity(np.zeros(50, np.float32)) == 0
