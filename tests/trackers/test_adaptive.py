"""The adaptive parts of a filter know no pixels: they are tested on numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pftrack_sim.errors import ParameterError
from pftrack_sim.trackers.filter.adaptive import AdaptiveSpread, shift, slopes

SPREAD = AdaptiveSpread(noise=1.0, noise_min=0.5, noise_max=2.5, count=200, count_max=400)


@given(st.floats(0.0, 1e6))
def test_noise_grows_with_the_root_of_the_error_between_its_limits(error: float):
    assert SPREAD.factor(error) == pytest.approx(np.clip(np.sqrt(error), 0.5, 2.5))


@pytest.mark.parametrize(("factor", "count"), [(0.5, 100), (1.0, 200), (1.7, 340), (2.5, 400)])
def test_number_of_particles_follows_the_noise(factor: float, count: int):
    assert SPREAD.particles(factor) == count


def test_limits_must_rise():
    with pytest.raises(ParameterError, match="noise"):
        AdaptiveSpread(1.0, 2.0, 2.5, 100, 200)
    with pytest.raises(ParameterError, match="particles"):
        AdaptiveSpread(1.0, 0.5, 2.5, 300, 200)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_slopes_and_shift_of_a_linear_observation_are_exact(kind: type):
    rng = np.random.default_rng(3)
    scales = np.array([10.0, 3.0, 0.02, 0.05])  # pixels beside radians
    truth = rng.normal(size=(4, 60)) / scales[:, None]
    states = rng.normal(size=(100, 4)) * scales
    found = slopes(states, (states @ truth).astype(kind))
    assert np.abs(found / truth - 1.0).max() < (1e-2 if kind == np.float32 else 1e-9)
    moved = 0.3 * scales
    # The image has moved by `moved`: seen at the old state, it shows what the model has at the state minus it.
    wanted = shift(found, (-moved @ truth).astype(kind))
    assert np.abs(wanted / moved - 1.0).max() < 1e-3


def test_weights_leave_out_what_they_do_not_count():
    rng = np.random.default_rng(4)
    slope = rng.normal(size=(2, 30))
    surprise = -np.array([1.0, -2.0]) @ slope
    surprise[:5] = 100.0
    weights = np.ones(30)
    weights[:5] = 0.0
    assert np.abs(shift(slope, surprise, weights) - [1.0, -2.0]).max() < 1e-9
    assert np.abs(shift(slope, surprise) - [1.0, -2.0]).max() > 1.0


def test_what_cannot_be_seen_does_not_move():
    slope = np.array([[1.0, 2.0, 0.5], [0.0, 0.0, 0.0]])
    assert shift(slope, np.array([-1.0, -2.0, -0.5])) == pytest.approx([1.0, 0.0])
    assert slopes(np.zeros((5, 2)), np.zeros((5, 3))).tolist() == np.zeros((2, 3)).tolist()
