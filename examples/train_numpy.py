"""Learn to follow in one file without a framework: vector environments, a linear policy, and its gradient in NumPy.

    python examples/train_numpy.py --updates 60

Advantages are those of generalised advantage estimation (Schulman et al. 2016) over a linear value function; the policy
is a Gaussian with a linear mean, and takes one normalised step for each batch (REINFORCE; Williams 1992).
"""

import argparse
from dataclasses import dataclass, field

import gymnasium as gym
import numpy as np

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim.wrappers import BoxObservation

SMALL = {"camera.width_px": 64, "camera.height_px": 48, "camera.rate_hz": 10, "lights.shadows": False}
OVERRIDES = {**SMALL, "duration_s": 12, "distractors.count": 0}
GAMMA, LAMBDA = 0.95, 0.9
STEP, SIGMA = 0.1, 0.3


@dataclass
class Batch:
    """What happened in a number of steps, `(steps, envs, ...)`."""

    features: list[np.ndarray] = field(default_factory=list)
    noise: list[np.ndarray] = field(default_factory=list)
    rewards: list[np.ndarray] = field(default_factory=list)
    over: list[np.ndarray] = field(default_factory=list)


def features_of(observation: np.ndarray) -> np.ndarray:
    """Observation, and a constant."""
    return np.concatenate([observation, np.ones((len(observation), 1))], axis=1)


def advantages_of(batch: Batch, last: np.ndarray, value: np.ndarray) -> np.ndarray:
    """`(steps, envs)` generalised advantages."""
    values = np.array([*(one @ value for one in batch.features), last @ value])
    found, ahead = np.zeros((len(batch.rewards), len(last))), np.zeros(len(last))
    for step in reversed(range(len(batch.rewards))):
        goes_on = 1.0 - batch.over[step]
        delta = batch.rewards[step] + GAMMA * values[step + 1] * goes_on - values[step]
        ahead = delta + GAMMA * LAMBDA * goes_on * ahead
        found[step] = ahead
    return found


def main() -> None:
    """Train, and print the mean reward of a step of every batch."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--updates", type=int, default=60)
    parser.add_argument("--envs", type=int, default=4)
    parser.add_argument("--steps", type=int, default=120)
    given = parser.parse_args()
    same_step = {"autoreset_mode": gym.vector.AutoresetMode.SAME_STEP}
    settings = {"scenario": "follow/plaza", "overrides": OVERRIDES}
    envs = gym.make_vec(
        "pftrack_sim/Follow-v0", given.envs, "sync", vector_kwargs=same_step, wrappers=[BoxObservation], **settings
    )
    rng = np.random.default_rng(1)
    observation, _ = envs.reset(seed=list(range(given.envs)))
    size = features_of(observation).shape[1]
    mean, value = np.zeros((size, 4)), np.zeros(size)
    for update in range(given.updates):
        batch = Batch()
        for _ in range(given.steps):
            features, noise = features_of(observation), rng.normal(size=(given.envs, 4))
            actions = np.clip(features @ mean + SIGMA * noise, -1.0, 1.0).astype(np.float32)
            observation, reward, terminated, truncated, _ = envs.step(actions)
            batch.features.append(features)
            batch.noise.append(noise)
            batch.rewards.append(reward)
            batch.over.append((terminated | truncated).astype(float))
        advantages = advantages_of(batch, features_of(observation), value)
        features, noise = np.concatenate(batch.features), np.concatenate(batch.noise)
        returns = advantages.ravel() + features @ value
        value = np.linalg.solve(features.T @ features + np.eye(size), features.T @ returns)
        scaled = (advantages.ravel() - advantages.mean()) / (advantages.std() + 1e-6)
        gradient = features.T @ (scaled[:, None] * noise) / (SIGMA * len(features))
        mean += STEP * gradient / (np.linalg.norm(gradient) + 1e-6)
        print(f"update {update:3}: mean reward of a step {np.mean(batch.rewards):.3f}", flush=True)
    envs.close()


if __name__ == "__main__":
    main()
