"""Learn to follow with PPO, on boxes instead of pixels, and compare it with the servo that was derived by hand.

    pip install 'pftrack-sim[rl]'
    python examples/train_ppo.py --out runs/ppo

Prints the mean reward of an episode of both on the same seeds, and draws the learning curve. `--tracker ko2012` learns
on what a tracker says instead of the true box.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from matplotlib.figure import Figure
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import SubprocVecEnv, VecNormalize

from pftrack_sim import controllers, trackers
from pftrack_sim.policies import FollowPolicy, rig_of
from pftrack_sim.wrappers import BoxObservation

SEEDS = range(900, 910)  # compared on; episodes that are learnt from have random ones, far from these


def make_env(scenario: str, tracker: str) -> gym.Env[Any, Any]:
    """An episode of 20 s in a small image: nothing but the box is looked at."""
    changes = {"camera.width_px": 84, "camera.height_px": 63, "lights.shadows": False, "duration_s": 20.0}
    env = gym.make("pftrack_sim/Follow-v0", scenario=scenario, overrides=changes)
    return Monitor(BoxObservation(env, tracker))


class Curve(BaseCallback):
    """Collects the reward of every episode that ends."""

    def __init__(self) -> None:
        super().__init__()
        self.steps: list[int] = []
        self.rewards: list[float] = []

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "episode" in info:
                self.steps.append(self.num_timesteps)
                self.rewards.append(info["episode"]["r"])
        return True


def learn(scenario: str, tracker: str, steps: int, seed: int, workers: int) -> tuple[PPO, VecNormalize, Curve]:
    """PPO with its usual numbers, but for a longer view and a first guess that hardly moves."""
    envs = VecNormalize(SubprocVecEnv([lambda: make_env(scenario, tracker)] * workers), norm_reward=False)
    envs.seed(seed)
    policy = {"log_std_init": -1.0}
    model = PPO(
        "MlpPolicy", envs, n_steps=512, batch_size=128, gamma=0.98, policy_kwargs=policy, seed=seed, device="cpu"
    )
    curve = Curve()
    model.learn(steps, callback=curve, progress_bar=True)
    envs.training = False
    return model, envs, curve


def of_ppo(model: PPO, envs: VecNormalize, scenario: str, tracker: str) -> list[float]:
    """Its reward in the episodes of `SEEDS`."""
    rewards: list[float] = []
    with make_env(scenario, tracker) as env:
        for seed in SEEDS:
            seen, _ = env.reset(seed=seed)
            rewards.append(0.0)
            over = False
            while not over:
                action, _ = model.predict(envs.normalize_obs(seen), deterministic=True)
                seen, reward, terminated, truncated, _ = env.step(action)
                rewards[-1] += float(reward)
                over = terminated or truncated
    return rewards


def of_servo(scenario: str, tracker: str) -> list[float]:
    """The reward of the controller `servo` in the same episodes."""
    rewards: list[float] = []
    with make_env(scenario, tracker) as wrapped:
        env = wrapped.unwrapped
        for seed in SEEDS:
            seen, info = env.reset(seed=seed)
            rig = rig_of(env.simulation.settings)
            policy = FollowPolicy(trackers.make(tracker, seed=seed), controllers.make("servo"), rig)
            rewards.append(0.0)
            over = False
            while not over:
                seen, reward, terminated, truncated, info = env.step(policy(seen, info))
                rewards[-1] += float(reward)
                over = terminated or truncated
    return rewards


def draw(curve: Curve, servo: float, path: Path) -> None:
    """Reward of the episodes over the steps learnt from, and the servo's."""
    window = min(20, len(curve.rewards))
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.subplots()
    axes.plot(curve.steps, curve.rewards, ".", color="#9fb4c7", label="an episode")
    smooth = np.convolve(curve.rewards, np.ones(window) / window, "valid")
    axes.plot(curve.steps[window - 1 :], smooth, color="#0072b2", label=f"PPO, mean of {window} episodes")
    axes.axhline(servo, color="#d55e00", label="servo")
    axes.set(xlabel="steps learnt from", ylabel="reward of an episode of 20 s", ylim=(0, None))
    axes.legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)


def main() -> None:
    """Learn, compare, draw."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scenario", default="corridor")
    parser.add_argument("--tracker", default="oracle")
    parser.add_argument("--steps", type=int, default=150_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("runs/ppo"))
    given = parser.parse_args()
    model, envs, curve = learn(given.scenario, given.tracker, given.steps, given.seed, given.workers)
    ours = float(np.mean(of_ppo(model, envs, given.scenario, given.tracker)))
    servo = float(np.mean(of_servo(given.scenario, given.tracker)))
    envs.close()
    draw(curve, servo, given.out / "learning-curve.png")
    model.save(given.out / "policy.zip")
    envs.save(str(given.out / "scales.pkl"))
    print(f"{given.scenario}, mean reward of {len(SEEDS)} episodes: PPO {ours:.1f}, servo {servo:.1f}")


if __name__ == "__main__":
    main()
