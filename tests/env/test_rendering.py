"""Render modes, and Gymnasium's own wrappers."""

import sys
import warnings
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import wrappers
from observing import ALONE, TINY

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.wrappers import PixelsOnly

SMALL = {**TINY, **ALONE, "duration_s": 0.5}
STILL = np.zeros(4, np.float32)


@pytest.fixture(autouse=True)
def _no_warnings() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def make(render_mode: str | None = None, env_id: str = "pftrack_sim/Follow-v0", **overrides: Any) -> gym.Env[Any, Any]:
    settings = {**SMALL, **overrides}
    return gym.make(env_id, scenario="easy/plaza-walk", overrides=settings, render_mode=render_mode)


def test_a_window_shows_what_rgb_array_returns(monkeypatch: pytest.MonkeyPatch):
    pygame = pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    shown, returned = make("human"), make("rgb_array")
    assert shown.render_mode == "human"
    for env in (shown, returned):
        env.reset(seed=1)
        env.step(STILL)
    assert shown.render() is None
    screen = np.swapaxes(pygame.surfarray.array3d(pygame.display.get_surface()), 0, 1)
    np.testing.assert_array_equal(screen, returned.render())
    shown.close()
    shown.close()
    returned.close()
    assert pygame.display.get_surface() is None


def test_without_a_display_or_pygame_one_error_names_the_ways_out(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(ParameterError, match=r"pip install 'pftrack-sim\[human\]'.*pftrack-sim studio.*rgb_array"):
        make("human")


def test_a_missing_display_is_named(monkeypatch: pytest.MonkeyPatch):
    pygame = pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "none-such")
    pygame.display.quit()
    with pytest.raises(ParameterError, match=r"there is no display .*pftrack-sim studio"):
        make("human")


def test_a_driver_without_a_window_is_no_display(monkeypatch: pytest.MonkeyPatch):
    pygame = pytest.importorskip("pygame")
    for variable in ("SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setattr(pygame.display, "init", lambda: None)
    monkeypatch.setattr(pygame.display, "get_driver", lambda: "offscreen")
    with pytest.raises(ParameterError, match=r"there is no display \(SDL has only its driver 'offscreen'\).*studio"):
        make("human")


def test_an_unknown_render_mode_names_those_that_are_known():
    from pftrack_sim.env import TrackEnv

    with pytest.raises(ParameterError, match="'depth_array', 'human' or None, got 'ansi'"):
        TrackEnv(render_mode="ansi")


@pytest.mark.parametrize("axis", [{}, {"axes.distortion.severity": 1.0}])
def test_depth_is_that_of_the_frame_in_the_last_observation(axis: dict[str, float]):
    """What it is of each pixel, `test_depth` shows."""
    env = make("depth_array", **axis)
    env.reset(seed=1)
    depth = env.render()
    assert depth.shape == (72, 96)
    assert depth.dtype == np.float32
    np.testing.assert_array_equal(depth, env.unwrapped.simulation.depth())
    assert np.isinf(depth).any(), "the sky"
    env.step(STILL)
    assert (env.render() != depth).any()
    env.close()


def test_gymnasium_collects_pictures_of_an_episode():
    env = make("rgb_array_list")
    env.reset(seed=1)
    for _ in range(3):
        env.step(STILL)
    pictures = env.render()
    assert [one.shape for one in pictures] == [(72, 96, 3)] * 4
    env.close()


def test_human_rendering_wraps_pictures_where_there_is_a_display(monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with wrappers.HumanRendering(make("rgb_array")) as env:
        env.reset(seed=1)
        env.step(STILL)


def test_stacking_statistics_and_limits_compose():
    env = wrappers.FrameStackObservation(
        wrappers.RecordEpisodeStatistics(wrappers.TimeLimit(PixelsOnly(make()), max_episode_steps=4)), 3
    )
    observation, _ = env.reset(seed=1)
    assert observation.shape == (3, 72, 96, 3)
    assert env.observation_space.contains(observation)
    steps = 0
    truncated, info = False, {}
    while not truncated:
        observation, _, _, truncated, info = env.step(STILL)
        steps += 1
    assert steps == info["episode"]["l"] == 4
    env.close()


@pytest.mark.parametrize("channels_first", [False, True])
def test_pixels_only_gives_the_image(channels_first: bool):
    env = PixelsOnly(make(), channels_first=channels_first)
    expected = env.env.reset(seed=1)[0]["image"]
    observation, _ = env.reset(seed=1)
    np.testing.assert_array_equal(observation, np.moveaxis(expected, -1, 0) if channels_first else expected)
    assert env.observation_space.contains(observation)
    with pytest.raises(ParameterError, match="PixelsOnly wraps environments whose observation has an image"):
        PixelsOnly(env)
    env.close()


def test_vector_environments_take_wrappers():
    envs = gym.make_vec(
        "pftrack_sim/Follow-v0",
        num_envs=2,
        vectorization_mode="sync",
        wrappers=[lambda env: PixelsOnly(env, channels_first=True)],
        scenario="easy/plaza-walk",
        overrides=SMALL,
    )
    envs = wrappers.vector.RecordEpisodeStatistics(envs)
    observation, _ = envs.reset(seed=[1, 2])
    assert observation.shape == (2, 3, 72, 96)
    observation, reward, *_ = envs.step(np.zeros((2, 4), np.float32))
    assert reward.shape == (2,)
    envs.close()
