"""Learn to follow in one file of PyTorch, in the style of CleanRL: proximal policy optimisation, every step in sight.

    pip install 'pftrack-sim[learn]'
    python examples/train_cleanrl.py --minutes 1

Schulman et al. 2017, with generalised advantage estimation, on the oracle's boxes without images.
"""

from __future__ import annotations

import argparse
import time

import gymnasium as gym
import torch
from torch import nn
from torch.distributions import Normal

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim.wrappers import BoxObservation

OVERRIDES = {"camera.rate_hz": 10, "duration_s": 12, "distractors.count": 0}
GAMMA, LAMBDA, CLIP, EPOCHS, PARTS = 0.95, 0.95, 0.2, 4, 4


class Agent(nn.Module):
    """A Gaussian policy and a value function."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.critic = nn.Sequential(nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, 1))
        self.actor = nn.Sequential(
            nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, outputs)
        )
        self.log_sigma = nn.Parameter(torch.full((outputs,), -0.7))

    def policy(self, seen: torch.Tensor) -> Normal:
        """Distribution of the action."""
        return Normal(self.actor(seen), self.log_sigma.exp())


def main() -> None:
    """Train, and print the mean reward of a step of every batch."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--envs", type=int, default=4)
    parser.add_argument("--steps", type=int, default=120, help="of each environment in a batch")
    given = parser.parse_args()
    torch.manual_seed(1)
    torch.set_num_threads(1)
    envs = gym.make_vec(
        "pftrack_sim/Follow-v0",
        num_envs=given.envs,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": gym.vector.AutoresetMode.SAME_STEP},
        wrappers=[BoxObservation],
        scenario="follow/plaza",
        overrides=OVERRIDES,
        image=False,
    )
    agent = Agent(envs.single_observation_space.shape[0], envs.single_action_space.shape[0])
    optimiser = torch.optim.Adam(agent.parameters(), lr=1e-3)
    observation = torch.as_tensor(envs.reset(seed=list(range(given.envs)))[0])
    end_s, steps, late = time.monotonic() + 60.0 * given.minutes, 0, False
    while not late:
        kept: list[tuple[torch.Tensor, ...]] = []
        for _ in range(given.steps):
            with torch.no_grad():
                policy = agent.policy(observation)
                action, value = policy.sample(), agent.critic(observation)[:, 0]
                chance = policy.log_prob(action).sum(-1)
            after, reward, terminated, truncated, _ = envs.step(action.clamp(-1.0, 1.0).numpy())
            over = torch.as_tensor(terminated | truncated).float()
            kept.append((observation, action, chance, value, torch.as_tensor(reward).float(), over))
            observation = torch.as_tensor(after)
        seen, actions, chances, values, rewards, overs = (torch.stack(part) for part in zip(*kept, strict=True))
        with torch.no_grad():
            ahead, gain = agent.critic(observation)[:, 0], torch.zeros(given.envs)
            advantages = torch.zeros_like(rewards)
            for step in reversed(range(given.steps)):
                goes_on = 1.0 - overs[step]
                gain = rewards[step] + GAMMA * ahead * goes_on - values[step] + GAMMA * LAMBDA * goes_on * gain
                advantages[step], ahead = gain, values[step]
        returns = (advantages + values).flatten()
        scaled = ((advantages - advantages.mean()) / (advantages.std() + 1e-8)).flatten()
        seen, actions, chances = seen.flatten(0, 1), actions.flatten(0, 1), chances.flatten()
        for _ in range(EPOCHS):
            for part in torch.randperm(len(returns)).chunk(PARTS):
                ratio = (agent.policy(seen[part]).log_prob(actions[part]).sum(-1) - chances[part]).exp()
                gained = torch.min(ratio * scaled[part], ratio.clamp(1.0 - CLIP, 1.0 + CLIP) * scaled[part])
                missed = (agent.critic(seen[part])[:, 0] - returns[part]).square()
                loss = 0.5 * missed.mean() - gained.mean()
                optimiser.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
                optimiser.step()
        steps += rewards.numel()
        print(f"{steps:6} steps: mean reward of a step {rewards.mean():.3f}", flush=True)
        late = time.monotonic() > end_s
    envs.close()


if __name__ == "__main__":
    main()
