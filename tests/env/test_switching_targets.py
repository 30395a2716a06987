"""One target is handed over for another while an episode runs."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim.core.errors import ScenarioError, UnknownNameError

SMALL: dict[str, Any] = {"camera.width_px": 160, "camera.height_px": 120, "lights.shadows": False, "duration_s": 12}


def track(name: str | None = None, switch_at: int = 20, steps: int = 60) -> tuple[list[Any], list[dict[str, Any]]]:
    env = gym.make("pftrack_sim/Track-v0", scenario="plaza-walk", overrides=SMALL, image=False)
    observation, info = env.reset(seed=3)
    observations, infos = [observation], [info]
    for step in range(steps):
        if name is not None and step == switch_at:
            env.unwrapped.switch_target(name)
        observation, *_, info = env.step(np.array([1.0, 1.0, 9.0, 9.0]))
        observations.append(observation)
        infos.append(info)
    env.close()
    return observations, infos


def test_the_other_person_is_told_of_as_in_an_episode_without_a_switch():
    _, plain = track()
    name, seen = plain[25]["people"][1].name, 0
    observations, switched = track(name)
    for index, (before, after) in enumerate(zip(plain, switched, strict=True)):
        if index <= 20:
            assert after["truth"].name == "target"
            assert before["truth"] == after["truth"]
            continue
        assert after["truth"].name == after["people"][0].name == name
        assert {one.name for one in after["people"]} >= {one.name for one in before["people"]} - {"target"}
        known = {one.name: one for one in before["people"]}
        if name in known:
            seen += 1
            assert known[name] == after["truth"]
        if "target" in known:
            others = {one.name: one for one in after["people"]}
            assert known["target"] == others["target"]
        else:
            assert after["truth"].state == "out_of_view"
    assert seen > 10
    first = [index for index, one in enumerate(observations) if one["first"]]
    assert first[0] == 0
    assert len(first) == 2
    assert first[1] > 20
    assert np.array_equal(observations[first[1]]["init_box"], switched[first[1]]["truth"].box)
    assert switched[-1]["overlap"] == pytest.approx(0.0, abs=0.2)


def test_a_new_episode_has_the_scenarios_target_and_unknown_people_are_refused():
    env = gym.make("pftrack_sim/Track-v0", scenario="plaza-walk", overrides=SMALL, image=False)
    with pytest.raises(ScenarioError, match="no episode is running"):
        env.unwrapped.switch_target("distractor-1")
    env.reset(seed=3)
    with pytest.raises(UnknownNameError, match="unknown person 'distractor-9'; did you mean 'distractor"):
        env.unwrapped.switch_target("distractor-9")
    env.unwrapped.switch_target("distractor-2")
    *_, info = env.step(np.zeros(4))
    assert info["truth"].name == "distractor-2"
    _, info = env.reset(seed=3)
    assert info["truth"].name == "target"
    env.close()
