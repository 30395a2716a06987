"""Outcomes of an episode in closed loop."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from driving import driven
from observing import ALONE, TINY

from pftrack_sim import controllers, policies, trackers
from pftrack_sim.core.errors import ParameterError

SMALL = {**TINY, **ALONE, "duration_s": 8.0}


def make(overrides: dict[str, Any], env_id: str = "pftrack_sim/Follow-v0") -> gym.Env[Any, Any]:
    return gym.make(env_id, scenario="plaza-walk", overrides={**SMALL, **overrides}, image=False)


def follow(overrides: dict[str, Any], controller: str) -> list[dict[str, Any]]:
    """The information after each step."""
    policy = policies.FollowPolicy(trackers.make("oracle"), controllers.make(controller))
    return driven("plaza-walk", {**SMALL, **overrides}, policy, 3)


BACKWARDS = {"camera.mount": "back", "robot.gaze": "forward"}


def test_a_target_behind_a_camera_that_does_not_turn_is_lost():
    infos = follow({**BACKWARDS, "follow.lost_after_s": 3.0}, "still")
    assert infos[-1]["outcome"] == "lost"
    assert len(infos) == 91  # lost_after_s and one frame


def test_a_target_that_starts_out_of_view_is_selected_when_first_visible():
    env = make(BACKWARDS)
    observation, info = env.reset(seed=3)
    assert observation["first"] == 0
    assert not observation["init_box"].any()
    selected = []
    for _ in range(180):
        observation, _, terminated, _, info = env.step(np.array([0.0, 0.0, -0.6, 0.0]))
        assert not terminated
        if observation["first"]:
            selected.append(info["frame"])
            np.testing.assert_array_equal(observation["init_box"], info["truth"].box)
            assert info["truth"].scored
    assert len(selected) == 1
    env.close()


def test_a_searching_controller_finds_a_target_that_starts_out_of_view():
    assert follow(BACKWARDS, "servo")[-1]["outcome"] == "finished"


def test_a_wall_between_robot_and_target_ends_in_a_collision_with_it():
    beside = {"kind": "beside", "distance_m": 3.0}
    env = make({"robot.route": beside, "occluders": [{"kind": "wall", "at_s": 2.0, "duration_s": 1.0}]})
    env.reset(seed=3)
    world = env.unwrapped.simulation.world  # type: ignore[attr-defined]
    wall = world.model.body("occluder-wall-1").id
    info: dict[str, Any] = {"outcome": None}
    while info["outcome"] is None:
        x, y, heading = world.robot_pose()
        ahead = world.data.xpos[wall, :2] - (x, y)
        error = np.arctan2(ahead[1], ahead[0]) - heading
        _, _, _, _, info = env.step(np.array([1.0, np.clip(error, -1.0, 1.0), -0.5, 0.0]))
    assert info["outcome"] == "collision"
    assert info["collision"] == "occluder-wall-1"
    env.close()


def test_commands_beyond_the_limits_are_clipped_and_counted():
    env = make({})
    env.reset(seed=3)
    counts = [
        env.step(np.array(command))[-1]["clipped"] for command in ([5.0, 0, 0, 0], [1.0, 0, 0, 0], [0, -1.1, 0, 9])
    ]
    assert counts == [1, 1, 2]
    env.reset(seed=3)
    assert env.step(np.zeros(4))[-1]["clipped"] == 0
    env.close()


@pytest.mark.parametrize("late_s", [-0.1, float("inf"), "soon", float("nan")])
def test_the_delay_of_a_command_must_be_finite_and_not_negative(late_s: Any):
    env = make({}, "pftrack_sim/TrackAndFollow-v0")
    env.reset(seed=3)
    with pytest.raises(ParameterError, match="late_s"):
        env.unwrapped.step({"box": np.ones(4), "command": np.zeros(4), "late_s": late_s})
    env.close()


def test_a_command_that_is_due_after_the_next_frame_is_not_given_yet():
    env = make({}, "pftrack_sim/TrackAndFollow-v0").unwrapped
    env.reset(seed=3)
    given = [(0.5, 0.0), (1.0, 0.05), (1.0, 0.02)]
    in_force = [env.step({"box": np.ones(4), "command": np.full(4, value), "late_s": late_s})[-1]["command"][0]
                for value, late_s in given]  # fmt: skip
    assert in_force == [0.5, 0.5, 1.0]
    env.close()
