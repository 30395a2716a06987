"""Environments that are drawn together: each is the single one of its seed, in both autoresets."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim.core.errors import CommandError, ParameterError, RenderError, UnknownNameError
from pftrack_sim.env import batch

pytest.importorskip("mujoco_warp")
pytest.importorskip("greenlet")

SMALL = {
    "camera.width_px": 64,
    "camera.height_px": 48,
    "camera.rate_hz": 10,
    "duration_s": 0.2,
    "distractors.count": 1,
}
COMMAND = np.array([0.5, 0.2, -0.1, 0.0], dtype=np.float32)


def make_batch(name: str = "Follow", num_envs: int = 2, **more: Any) -> Any:
    return gym.make_vec(f"pftrack_sim/{name}Batch-v0", num_envs, **{"scenario": "corridor", "overrides": SMALL, **more})


def make_single(name: str = "Follow", **more: Any) -> gym.Env:
    more = {"scenario": "corridor", "overrides": SMALL, **more}
    return gym.make(f"pftrack_sim/{name}-v0", backend="warp", **more)


def assert_equal(seen: dict[str, Any], information: dict[str, Any], index: int, expected: tuple[Any, Any]) -> None:
    """Environment `index` of a batch observes what a single one does: images, boxes, visible fractions, the lot."""
    observation, known = expected
    for key, value in observation.items():
        np.testing.assert_array_equal(seen[key][index], value, err_msg=key)
    assert information["truth"][index] == known["truth"]
    assert tuple(information["people"][index]) == tuple(known["people"])
    assert information["detections"][index] == known["detections"]
    assert information["seed"][index] == known["seed"]


def compare(mode: str, num_envs: int, steps: int, **more: Any) -> None:
    """Step a batch and single environments with the same seeds; everything must be equal to the bit."""
    envs = make_batch(num_envs=num_envs, autoreset_mode=mode, **more)
    singles = [make_single(**more) for _ in range(num_envs)]
    observation, info = envs.reset(seed=7)
    expected = [single.reset(seed=7 + index) for index, single in enumerate(singles)]
    over, episodes = np.zeros(num_envs, dtype=bool), 0
    for _ in range(steps):
        envs.complete_truth(info)
        envs.complete_truth(info, people=True)
        for index in range(num_envs):
            assert_equal(observation, info, index, expected[index])
        observation, reward, terminated, truncated, info = envs.step(np.tile(COMMAND, (num_envs, 1)))
        for index, single in enumerate(singles):
            if over[index] and mode == "NextStep":
                expected[index] = single.reset()
                assert (reward[index], terminated[index], truncated[index]) == (0.0, False, False)
                continue
            seen, *outcome, known = single.step(COMMAND)
            assert [reward[index], terminated[index], truncated[index]] == outcome
            expected[index] = seen, known
            if mode == "SameStep" and (outcome[1] or outcome[2]):
                np.testing.assert_array_equal(info["final_obs"][index]["image"], seen["image"])
                assert info["final_info"]["truth"][index] == known["truth"]
                expected[index] = single.reset()
        over = terminated | truncated
        episodes += int(over.sum())
    assert episodes > 0
    wrong = np.tile(COMMAND, (num_envs, 1))
    wrong[-1, 0] = np.nan
    with pytest.raises(CommandError, match="finite"):
        envs.step(wrong)
    assert envs.closed
    assert envs._pool._groups == []
    assert not envs._pool._shared._known
    for single in singles:
        single.close()


def test_two_worlds_are_two_single_environments():
    compare("SameStep", 2, 3, overrides={**SMALL, "distractors.count": 0, "duration_s": 0.1})


@pytest.mark.slow
def test_the_next_episode_begins_in_the_next_step():
    compare("NextStep", 2, 4)


@pytest.mark.slow
def test_sixteen_worlds_are_sixteen_single_environments():
    compare("SameStep", 16, 4, overrides={**SMALL, "distractors.count": 3, "duration_s": 0.3})


@pytest.mark.slow
def test_worlds_with_exposure_readout_lens_and_auto_exposure_are_drawn_together():
    axes = {f"axes.{name}.severity": 1.0 for name in ("blur", "rolling_shutter", "distortion", "light", "stream")}
    compare("SameStep", 3, 3, scenario="plaza-walk", overrides={**SMALL, **axes})


@pytest.mark.slow
def test_boxes_are_scored_and_pictures_drawn():
    envs, single = (
        make_batch("TrackAndFollow", render_mode="rgb_array"),
        make_single("TrackAndFollow", render_mode="rgb_array"),
    )
    envs.reset(seed=[4, 9])
    observation, _ = single.reset(seed=9)
    boxes = np.tile(observation["init_box"], (2, 1))
    _, reward, _, _, info = envs.step({"box": boxes, "command": np.tile(COMMAND, (2, 1))})
    _, expected, _, _, known = single.step({"box": boxes[1], "command": COMMAND})
    assert reward[1] == expected
    assert info["overlap"][1] == known["overlap"] > 0.9
    np.testing.assert_array_equal(envs.render()[1], single.render())
    envs.close()
    single.close()


def test_a_mask_resets_some_environments():
    envs = make_batch(autoreset_mode="Disabled", overrides={**SMALL, "duration_s": 0.1, "distractors.count": 0})
    with pytest.raises(gym.error.ResetNeeded, match="after one of all"):
        envs.reset(seed=3, options={"reset_mask": np.array([True, False])})
    first, _ = envs.reset(seed=3)
    over = [False]
    while not all(over):
        stepped, _, _, over, _ = envs.step(np.tile(COMMAND, (2, 1)))
    again, info = envs.reset(seed=[None, 4], options={"reset_mask": np.array([False, True])})
    np.testing.assert_array_equal(again["image"], [stepped["image"][0], first["image"][1]])
    assert info["_truth"].tolist() == [False, True]
    with pytest.raises(gym.error.ResetNeeded, match=r"\[0\] are over"):
        envs.step(np.tile(COMMAND, (2, 1)))
    for options in ({"reset_mask": np.zeros(2, dtype=bool)}, {"reset_mask": np.ones(3, dtype=bool)}, {"mask": None}):
        with pytest.raises(ParameterError, match="reset"):
            envs.reset(options=options)
    with pytest.raises(ParameterError, match="as many seeds, got 3"):
        envs.reset(seed=[1, 2, 3])
    envs.close()


def test_wrong_arguments_are_one_clear_error(monkeypatch: pytest.MonkeyPatch):
    with pytest.raises(ParameterError, match="num_envs=0"):
        make_batch(num_envs=0)
    with pytest.raises(ParameterError, match="NextStep"):
        make_batch(autoreset_mode="next")
    with pytest.raises(UnknownNameError, match="did you mean 'corridor'"):
        make_batch(scenario="coridor")
    with pytest.raises(ParameterError, match=r"got backend, image\..*pftrack_sim/Follow-v0"):
        make_batch(backend="gl", image=False)
    with pytest.raises(ParameterError, match="one environment"):
        make_batch(render_mode="human")
    monkeypatch.setattr(batch, "warp_installed", lambda: False)
    with pytest.raises(RenderError, match=r"pip install 'pftrack-sim\[warp\]'"):
        make_batch()
