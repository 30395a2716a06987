"""States of particle filters on a box."""

import numpy as np
import pytest

from pftrack_sim.trackers.box_state import clip_states

IMAGE = np.zeros((120, 160, 3), np.uint8)


def random_states(components: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-100.0, 500.0, (50, components))


@pytest.mark.parametrize("components", [4, 6])
@pytest.mark.parametrize("min_size", [2.0, np.array([7.5, 20.0])])
def test_clipped_states_are_those_of_numpy(components: int, min_size: float | np.ndarray):
    states = random_states(components, seed=components)
    expected = states.copy()
    low = np.concatenate([np.zeros(2), np.broadcast_to(min_size, 2)])
    expected[:, :4] = np.clip(states[:, :4], low, [160.0, 120.0, 320.0, 240.0])
    clip_states(states, IMAGE, min_size)
    assert np.array_equal(states, expected)
