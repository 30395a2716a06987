"""Adaptive noise and particle number, and the velocity of linear models."""

import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.trackers.filters import adaptive_velocity, fit_slopes
from pftrack_sim.trackers.papers.kwon2005 import Kwon2005Parameters

SPREAD = Kwon2005Parameters(particle_count_max=450)


@pytest.mark.parametrize(
    ("error", "factor", "count"),
    [(1.0, 1.0, 200), (2.25, 1.5, 300), (0.36, 0.6, 120), (0.0, 0.5, 100), (100.0, 2.5, 450), (6.0, 6.0**0.5, 450)],
)
def test_noise_and_particle_number_match_hand_computed_values(error: float, factor: float, count: int):
    """Eq. 9 and 11 with their limits."""
    assert SPREAD.noise_factor(error) == pytest.approx(factor)
    assert SPREAD.particle_number(SPREAD.noise_factor(error)) == count


def test_the_particle_number_is_at_least_one():
    assert Kwon2005Parameters(noise=10, noise_min=0.01, noise_max=10, particle_count=1).particle_number(0.01) == 1


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"noise_min": 1.1}, "noise_min <= noise <= noise_max, got 1.1, 1, 2.5"),
        ({"noise_max": 0.9}, "noise_min <= noise <= noise_max"),
        ({"particle_count": 600}, "particle_count <= particle_count_max, got 600, 500"),
    ],
)
def test_unordered_limits_are_refused(given: dict[str, float], words: str):
    with pytest.raises(ParameterError, match=words):
        trackers.make("kwon2005", preset="paper", **given)


UNITS = np.array([300.0, 20.0, 0.01, 0.05])


def linear_model(kind: type[np.floating], particle_count: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A linear observation model: its matrix, particles, and their observations."""
    rng = np.random.default_rng(3)
    matrix = (rng.standard_normal((4, 90)) / UNITS[:, None]).astype(kind)
    particles = rng.standard_normal((particle_count, 4)) * UNITS
    return matrix, particles, (particles @ matrix).astype(kind)


@pytest.mark.parametrize(("kind", "digits"), [(np.float64, 1e-9), (np.float32, 1e-4)])
def test_the_velocity_of_a_linear_model_is_exact(kind: type[np.floating], digits: float):
    """Eq. 8, for components with units as different as pixels and radians."""
    matrix, particles, seen = linear_model(kind)
    fitted = fit_slopes(particles, seen)
    assert fitted.dtype == kind
    assert np.allclose(fitted * UNITS[:, None], matrix * UNITS[:, None], rtol=0, atol=10 * digits)
    moved = UNITS * [0.3, -2.0, 0.5, 1.5]
    # The target has moved: what is seen at the old state is what was there before, less the shift's effect.
    found = adaptive_velocity(fitted, (-moved @ matrix).astype(kind))
    assert np.allclose(found / UNITS, moved / UNITS, rtol=0, atol=10 * digits)


def test_zero_innovation_gives_zero_velocity():
    _, particles, seen = linear_model(np.float64)
    assert np.array_equal(adaptive_velocity(fit_slopes(particles, seen), np.zeros(90)), np.zeros(4))


def test_unobservable_components_get_zero_velocity():
    """Components without spread, or without effect on the observation, do not disturb the others."""
    matrix, particles, _ = linear_model(np.float64)
    still = particles.copy()
    still[:, 1] = 0.0
    moved = UNITS * [0.3, 0.0, 0.5, 1.5]
    found = adaptive_velocity(fit_slopes(still, still @ matrix), -moved @ matrix)
    assert np.allclose(found / UNITS, moved / UNITS, rtol=0, atol=1e-9)
    blind = matrix.copy()
    blind[1] = 0.0
    found = adaptive_velocity(fit_slopes(particles, particles @ blind), -moved @ blind)
    assert np.allclose(found / UNITS, moved / UNITS, rtol=0, atol=1e-9)


def test_one_particle_gives_zero_velocity():
    assert np.array_equal(adaptive_velocity(fit_slopes(np.zeros((1, 4)), np.zeros((1, 9))), np.ones(9)), np.zeros(4))


def test_observation_noise_averages_out():
    matrix, particles, seen = linear_model(np.float64, 400)
    noisy = seen + 0.3 * np.random.default_rng(0).standard_normal(seen.shape)
    moved = UNITS * [0.3, -0.2, 0.5, 1.0]
    assert np.abs(adaptive_velocity(fit_slopes(particles, noisy), -moved @ matrix) / UNITS - moved / UNITS).max() < 0.05
