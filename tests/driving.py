"""Episodes in closed loop."""

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

import pftrack_sim  # noqa: F401 - registers the environments

Policy = Callable[[dict[str, Any], dict[str, Any]], np.ndarray]


def always(*command: float) -> Policy:
    """The same command at every frame."""
    return lambda observation, info: np.array(command)


def driven(scenario: Any, overrides: dict[str, Any], policy: Policy, seed: int) -> list[dict[str, Any]]:
    """Information after each step of a whole episode of following, with the reward, without images."""
    env = gym.make("pftrack_sim/Follow-v0", scenario=scenario, overrides=overrides, image=False)
    (observation, info), infos = env.reset(seed=seed), list[dict[str, Any]]()
    over = False
    while not over:
        observation, reward, terminated, truncated, info = env.step(policy(observation, info))
        infos.append({**info, "reward": float(reward)})
        over = terminated or truncated
    env.close()
    return infos
