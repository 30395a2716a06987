"""Learn to follow from pixels with TorchRL: its `GymEnv`, a collector, and its clipped loss of PPO.

    pip install 'pftrack-sim[learn]'
    python examples/train_torchrl.py --minutes 1

A minute shows that it runs; that pixels teach following takes hours.
"""

from __future__ import annotations

import argparse
import time

import torch
from tensordict.nn import NormalParamExtractor, TensorDictModule
from torch import nn
from torchrl.collectors import Collector
from torchrl.envs import GymEnv, ToTensorImage, TransformedEnv
from torchrl.modules import ConvNet, ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

import pftrack_sim  # noqa: F401 - registers the environments

SMALL = {"camera.width_px": 64, "camera.height_px": 48, "camera.rate_hz": 10, "lights.shadows": False}
OVERRIDES = {**SMALL, "duration_s": 6, "distractors.count": 0}


def network(outputs: int) -> nn.Sequential:
    """Convolutions over the image, and a layer on top."""
    cells = ConvNet(in_features=3, num_cells=[16, 32, 32], kernel_sizes=[8, 4, 3], strides=[4, 2, 1])
    return nn.Sequential(cells, nn.LazyLinear(128), nn.ReLU(), nn.LazyLinear(outputs))


def main() -> None:
    """Train, and print the mean reward of a step of every batch."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--steps", type=int, default=240, help="of a batch")
    given = parser.parse_args()
    torch.manual_seed(1)
    torch.set_num_threads(1)
    env = TransformedEnv(
        GymEnv("pftrack_sim/Follow-v0", scenario="follow/plaza", overrides=OVERRIDES, device="cpu"),
        ToTensorImage(in_keys=["image"], out_keys=["pixels"]),
    )
    actions = env.action_spec.shape[-1]
    policy = TensorDictModule(
        nn.Sequential(network(2 * actions), NormalParamExtractor()), in_keys=["pixels"], out_keys=["loc", "scale"]
    )
    actor = ProbabilisticActor(
        policy,
        spec=env.action_spec,
        in_keys=["loc", "scale"],
        distribution_class=TanhNormal,
        return_log_prob=True,
    )
    critic = ValueOperator(network(1), in_keys=["pixels"])
    first = env.reset(seed=0)
    actor(first), critic(first)  # the lazy layers take their shapes
    loss_of = ClipPPOLoss(actor, critic, clip_epsilon=0.2, entropy_coeff=1e-3)
    advantages = GAE(gamma=0.95, lmbda=0.95, value_network=critic)
    optimiser = torch.optim.Adam(loss_of.parameters(), lr=3e-4)
    end_s, steps = time.monotonic() + 60.0 * given.minutes, 0
    collector = Collector(
        env, actor, frames_per_batch=given.steps, total_frames=-1, auto_register_policy_transforms=True
    )
    for batch in collector:
        for _ in range(4):
            advantages(batch)
            for part in torch.randperm(len(batch)).chunk(4):
                losses = loss_of(batch[part])
                loss = losses["loss_objective"] + losses["loss_critic"] + losses["loss_entropy"]
                optimiser.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(loss_of.parameters(), 0.5)
                optimiser.step()
        steps += len(batch)
        print(f"{steps:6} steps: mean reward of a step {batch['next', 'reward'].mean():.3f}", flush=True)
        if time.monotonic() > end_s:
            break
    collector.shutdown()


if __name__ == "__main__":
    main()
