"""With ground-truth boxes a controller follows the target in every shipped scenario."""

import itertools
import math

import gymnasium as gym
import numpy as np
import pytest
from driving import always, driven
from observing import PLACES

from pftrack_sim import controllers, policies, scenario, trackers
from pftrack_sim.env.tasks import following_reward

SMALL = {"camera.width_px": 160, "camera.height_px": 120, "lights.shadows": False, "duration_s": 10}


@pytest.mark.parametrize("name", PLACES)
def test_oracle_and_servo_follow_to_the_end(name: str):
    policy = policies.FollowPolicy(trackers.make("oracle"), controllers.make("servo"))
    infos = driven(name, SMALL, policy, 4)
    assert infos[-1]["outcome"] == "finished", (infos[-1]["collision"], infos[-1]["lost_s"])
    assert len(infos) == 300
    assert np.mean([info["reward"] for info in infos]) > 0.75


def test_the_nearest_bystander_is_measured_from_the_robot():
    env = gym.make("pftrack_sim/Follow-v0", scenario="plaza-walk", overrides=SMALL, image=False)
    env.reset(seed=0)
    for _ in range(5):
        _, _, _, _, info = env.step(np.zeros(4))
    others = [one.T_world_target[:2, 3] for one in info["people"] if one.name != "target"]
    assert others
    distances = [math.dist(env.unwrapped.simulation.world.robot_pose()[:2], place) for place in others]
    assert info["bystander_m"] == pytest.approx(min(distances), abs=1e-6)
    env.close()


def test_servo_at_a_short_distance_does_not_run_into_the_target():
    overrides = {**SMALL, "duration_s": 20, "follow.distance_m": 1.5, "target.actions": []}
    robot = policies.robot_parameters(scenario.load("follow/plaza", overrides).resolve(0))
    policy = policies.FollowPolicy(trackers.make("oracle"), controllers.make("servo"), robot)
    infos = driven("follow/plaza", overrides, policy, 0)
    assert infos[-1]["outcome"] == "finished"
    distances = [info["distance_m"] for info in infos]
    assert min(distances) > 0.8
    assert np.median(distances) < 2.3


def test_a_robot_that_stands_still_loses_the_target():
    assert driven("easy/plaza-walk", {**SMALL, "duration_s": 16}, always(0, 0, 0, 0), 4)[-1]["reward"] < 0.1


def test_a_policy_that_drives_into_the_target_ends_the_episode():
    overrides = {**SMALL, "robot.route": {"kind": "trail", "distance_m": 1.5}, "occluders": []}
    last = driven("easy/corridor", overrides, always(1, 0, 0, 0), 4)[-1]
    assert (last["outcome"], last["collision"]) == ("collision", "target")


def test_the_reward_is_one_at_the_goal_and_falls_to_zero_at_the_edges():
    assert following_reward(0.0, 0.0) == 1.0
    assert following_reward(1.0, 0.0) == following_reward(0.0, 1.0) == following_reward(3.0, 3.0) == 0.0
    steps = [following_reward(error, 0.0) for error in np.linspace(0, 1, 11)]
    assert all(one > two for one, two in itertools.pairwise(steps))
