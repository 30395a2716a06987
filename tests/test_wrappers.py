"""Boxes instead of pixels."""

from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from observing import TINY

from pftrack_sim.core.errors import ParameterError, UnknownNameError
from pftrack_sim.core.proprioception import PROPRIO_INDEX
from pftrack_sim.core.records import Truth
from pftrack_sim.wrappers import SENSES, BoxObservation

SMALL = {**TINY, "duration_s": 1, "distractors.count": 0}
STILL = np.zeros(4, np.float32)


@pytest.fixture
def follow() -> Iterator[gym.Env[Any, Any]]:
    with gym.make("pftrack_sim/Follow-v0", scenario="corridor", overrides=SMALL) as env:
        yield env


def test_the_wrapper_passes_the_gymnasium_checker(follow: gym.Env[Any, Any]):
    env = BoxObservation(follow)
    check_env(env, skip_render_check=True)
    assert env.spec is not None
    assert env.spec.additional_wrappers[-1].name == "BoxObservation"


def test_the_oracle_gives_the_true_box_relative_to_the_image(follow: gym.Env[Any, Any]):
    env = BoxObservation(follow, "oracle")
    seen, info = env.reset(seed=3)
    for _ in range(5):
        truth: Truth = info["truth"]
        x, y, w, h = truth.box
        expected = [(x + w / 2 - 48) / 48, (y + h / 2 - 36) / 36, w / 96, h / 72, 1.0]
        assert np.allclose(seen[:5], expected, rtol=0, atol=1e-6)
        seen, reward, terminated, truncated, info = env.step(STILL)
        assert 0.0 <= reward <= 1.0
        assert not terminated
        assert not truncated


def test_the_observation_has_the_requested_senses(follow: gym.Env[Any, Any]):
    env = BoxObservation(follow, senses=("pan_rad", "wheel_left_m_s"))
    plain, _ = follow.reset(seed=1)
    seen, _ = env.reset(seed=1)
    assert seen[5:].tolist() == [plain["proprio"][PROPRIO_INDEX[name]] for name in ("pan_rad", "wheel_left_m_s")]
    assert seen.shape == env.observation_space.shape == (7,)


@pytest.mark.slow
def test_every_episode_has_a_new_tracker(follow: gym.Env[Any, Any]):
    env = BoxObservation(follow, "ko2012", particle_count=30)

    def episode() -> list[np.ndarray]:
        return [env.reset(seed=5)[0], *(env.step(STILL)[0] for _ in range(4))]

    first = episode()
    env.reset(seed=6)
    assert all(np.array_equal(one, other) for one, other in zip(first, episode(), strict=True))
    assert first[0].shape == (5 + len(SENSES),)


def test_other_environments_are_errors(follow: gym.Env[Any, Any]):
    track = gym.make("pftrack_sim/Track-v0", scenario="corridor", overrides=SMALL)
    with track, pytest.raises(ParameterError, match="wraps pftrack_sim/Follow-v0, got TrackEnv"):
        BoxObservation(track)
    with pytest.raises(UnknownNameError, match=r"unknown tracker 'orakel'; did you mean 'oracle'\?"):
        BoxObservation(follow, "orakel")
    with pytest.raises(UnknownNameError, match=r"unknown sense 'pan'; did you mean 'pan_rad'\?"):
        BoxObservation(follow, senses=("pan",))
