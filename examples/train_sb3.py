"""Learn to follow from pixels with unchanged Stable-Baselines3.

    pip install 'pftrack-sim[learn]'
    python examples/train_sb3.py --policy CnnPolicy --minutes 1
    python examples/train_sb3.py --policy MultiInputPolicy --minutes 1

`CnnPolicy` sees the image alone, `MultiInputPolicy` the environment's whole observation: the image, the box of the
selection, and the robot's sensors. A minute shows that it runs; that pixels teach following takes hours.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim.wrappers import PixelsOnly

SMALL = {"camera.width_px": 64, "camera.height_px": 48, "camera.rate_hz": 10, "lights.shadows": False}
OVERRIDES = {**SMALL, "duration_s": 6, "distractors.count": 0}


def make_env(policy: str, seed: int) -> gym.Env[Any, Any]:
    """An environment with the observation that a policy takes."""
    env = gym.make("pftrack_sim/Follow-v0", scenario="follow/plaza", overrides=OVERRIDES)
    env = Monitor(PixelsOnly(env) if policy == "CnnPolicy" else env)
    env.reset(seed=seed)
    return env


class Clock(BaseCallback):
    """Prints the mean reward of a step of every batch, and stops after one when time is up."""

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self._end_s, self._over = time.monotonic() + seconds, False

    def _on_step(self) -> bool:
        return not self._over

    def _on_rollout_end(self) -> None:
        self._over = time.monotonic() > self._end_s
        rewards = float(np.mean(self.model.rollout_buffer.rewards))  # type: ignore[attr-defined]
        print(f"{self.num_timesteps:6} steps: mean reward of a step {rewards:.3f}", flush=True)


def main() -> None:
    """Train for some time."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--policy", choices=["CnnPolicy", "MultiInputPolicy"], default="CnnPolicy")
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--envs", type=int, default=2)
    parser.add_argument("--steps", type=int, default=128, help="of each environment in a batch")
    given = parser.parse_args()
    torch.set_num_threads(1)
    envs = DummyVecEnv([lambda seed=seed: make_env(given.policy, seed) for seed in range(given.envs)])
    batch = given.steps * given.envs // 4
    model = PPO(given.policy, envs, n_steps=given.steps, batch_size=batch, n_epochs=4, gamma=0.95, seed=1, device="cpu")
    model.learn(10_000_000, callback=Clock(60.0 * given.minutes))
    envs.close()


if __name__ == "__main__":
    main()
