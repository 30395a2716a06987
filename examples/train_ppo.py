"""Learn to follow by reinforcement: proximal policy optimisation on the oracle's boxes, unchanged Stable-Baselines3.

    pip install 'pftrack-sim[learn]'
    python examples/train_ppo.py --minutes 2 --out ppo

Minutes are those of the processor: the environments run without images, all in this process. Writes the policy,
`curve.json` and `curve.png`, and prints the mean reward of a step, beside that of `servo` and `still`, over a whole
episode's length: an episode that ends early earns nothing for the rest.

It learns under wider limits than it is tested under: an episode that ends as soon as the target is lost shows a
beginner almost nothing. The policy is linear in its ten inputs, as a visual servo is.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim import controllers, trackers
from pftrack_sim.policies import FollowPolicy, robot_parameters
from pftrack_sim.wrappers import BoxObservation

SCENARIO = "follow/plaza"
SMALL = {"camera.width_px": 64, "camera.height_px": 48, "camera.rate_hz": 10, "lights.shadows": False}
OVERRIDES = {**SMALL, "duration_s": 12, "distractors.count": 0}
WIDE_LIMITS = {"follow.distance_limit_m": 8.0, "follow.bearing_limit_deg": 90.0, "follow.lost_after_s": 1.0}
STEPS = 120
GAMMA = 0.95
"""Two seconds ahead: what a turn of the head or the base is good for shows within one."""

TEST_SEEDS = range(1900, 1905)


def make_env(first_seed: int = 0, **limits: float) -> gym.Env[Any, Any]:
    """The oracle's boxes, ten a second, without images."""
    env = Monitor(BoxObservation(make_follow(**limits)))
    env.reset(seed=first_seed)
    return env


def make_follow(**limits: float) -> gym.Env[Any, Any]:
    """The environment under it."""
    return gym.make("pftrack_sim/Follow-v0", scenario=SCENARIO, overrides={**OVERRIDES, **limits}, image=False)


def score_of(act: Callable[[Any], Any]) -> float:
    """Mean reward of a step of a learnt policy over the test seeds."""
    with make_env() as env:
        return float(np.mean([_episode(env, act, seed) for seed in TEST_SEEDS]))


def _episode(env: gym.Env[Any, Any], act: Callable[[Any], Any], seed: int) -> float:
    observation, _ = env.reset(seed=seed)
    total, over = 0.0, False
    while not over:
        observation, reward, terminated, truncated, _ = env.step(act(observation))
        total, over = total + float(reward), terminated or truncated
    return total / STEPS


def score_of_controller(name: str) -> float:
    """The same of a controller that ships."""
    scores: list[float] = []
    with make_follow() as env:
        for seed in TEST_SEEDS:
            observation, info = env.reset(seed=seed)
            rig = robot_parameters(env.unwrapped.simulation.settings)  # type: ignore[attr-defined]
            policy = FollowPolicy(trackers.make("oracle"), controllers.make(name), rig)
            total, over = 0.0, False
            while not over:
                observation, reward, terminated, truncated, info = env.step(policy(observation, info))
                total, over = total + float(reward), terminated or truncated
            scores.append(total / STEPS)
    return float(np.mean(scores))


class Clock(BaseCallback):
    """Stops when time is up, and keeps the mean reward of a step of the episodes that ended."""

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self._seconds, self._start = seconds, time.process_time()
        self.curve: list[tuple[float, int, float]] = []

    def _on_step(self) -> bool:
        return time.process_time() - self._start < self._seconds

    def _on_rollout_end(self) -> None:
        recent = [episode["r"] / STEPS for episode in self.model.ep_info_buffer or []]
        if recent:
            self.curve.append((time.process_time() - self._start, self.num_timesteps, float(np.mean(recent[-20:]))))
            print(
                f"{self.curve[-1][0]:6.0f} s {self.num_timesteps:8} steps  reward {self.curve[-1][2]:.3f}", flush=True
            )


def main() -> None:
    """Train, then compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=2.0)
    parser.add_argument("--envs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("ppo"))
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    makers = [lambda number=number: make_env(number, **WIDE_LIMITS) for number in range(given.envs)]
    envs = VecNormalize(DummyVecEnv(makers), gamma=GAMMA)
    model = PPO(
        "MlpPolicy", envs, n_steps=128, batch_size=64, learning_rate=3e-3, gamma=GAMMA,
        policy_kwargs={"log_std_init": -0.7, "net_arch": {"pi": [], "vf": [64, 64]}}, seed=1, device="cpu",
    )  # fmt: skip
    clock = Clock(60.0 * given.minutes)
    model.learn(10_000_000, callback=clock)
    envs.close()
    model.save(given.out / "policy")
    envs.save(str(given.out / "scales.pkl"))
    scores = {name: score_of_controller(name) for name in ("servo", "still")}
    scores["ppo"] = score_of(lambda seen: model.predict(envs.normalize_obs(seen), deterministic=True)[0])
    (given.out / "curve.json").write_text(json.dumps({"curve": clock.curve, "scores": scores}, indent=1))
    print("mean reward of a step:", ", ".join(f"{name} {score:.3f}" for name, score in scores.items()))
    draw(clock.curve, scores, given.out / "curve.png")


def draw(curve: list[tuple[float, int, float]], scores: dict[str, float], path: Path) -> None:
    """The learning curve, with what it is measured against."""
    figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
    minutes, _, rewards = zip(*curve, strict=True)
    axes.plot(np.array(minutes) / 60.0, rewards, label="PPO, while it explores, under wide limits")
    for name, style in (("servo", "--"), ("ppo", "-."), ("still", ":")):
        axes.axhline(scores[name], linestyle=style, color="0.4", label=f"{name}, on test seeds")
    axes.set(xlabel="minutes of one processor", ylabel="mean reward of a step", ylim=(0.0, 1.0))
    figure.legend(loc="outside upper center", ncols=2, frameon=False)
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main()
