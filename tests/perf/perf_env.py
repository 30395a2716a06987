"""What a step with full truth costs, as a ratio to MuJoCo's own renderer beside it in the same rounds.

    env.step / (mujoco.Renderer.update_scene + render of the same model and size)

Rounds are interleaved, so that a noisy machine disturbs both sides alike; medians are shown.
"""

from __future__ import annotations

import os
import time
from statistics import median
from typing import Any

# MuJoCo's own renderer needs to be told; ours does not.
os.environ.setdefault("MUJOCO_GL", "egl")

import gymnasium as gym
import mujoco
import numpy as np

import pftrack_sim  # noqa: F401 - registers the environments

ROUNDS, STEPS = 12, 10


def measure(width: int, height: int, shadows: bool, scenario: str = "plaza-walk") -> tuple[float, float, float]:
    """Median ms of `env.step`, of `mujoco.Renderer`, and their ratio."""
    overrides: dict[str, Any] = {
        "camera.width_px": width,
        "camera.height_px": height,
        "lights.shadows": shadows,
        "duration_s": 60,
    }
    env = gym.make("pftrack_sim/Track-v0", scenario=scenario, overrides=overrides).unwrapped
    env.reset(seed=1)
    world = env.simulation.world
    renderer = mujoco.Renderer(world.model, height, width)
    camera = mujoco.mj_name2id(world.model, mujoco.mjtObj.mjOBJ_CAMERA, "robot/camera")
    answer = np.array([0.0, 0.0, 10.0, 10.0])
    ours: list[float] = []
    theirs: list[float] = []
    for _ in range(ROUNDS):
        for _ in range(STEPS):
            began = time.perf_counter()
            env.step(answer)
            ours.append(time.perf_counter() - began)
        renderer.render()  # take the context back before timing
        for _ in range(STEPS):
            began = time.perf_counter()
            renderer.update_scene(world.data, camera=camera)
            renderer.render()
            theirs.append(time.perf_counter() - began)
    renderer.close()
    env.close()
    return median(ours) * 1e3, median(theirs) * 1e3, median(ours) / median(theirs)


def measure_reset(scenario: str) -> float:
    """Median seconds of a reset with a new seed."""
    env = gym.make("pftrack_sim/Track-v0", scenario=scenario).unwrapped
    env.reset(seed=0)
    taken: list[float] = []
    for seed in range(1, 6):
        began = time.perf_counter()
        env.reset(seed=seed)
        taken.append(time.perf_counter() - began)
    env.close()
    return median(taken)


def main() -> None:
    """Print the table."""
    print(f"{'size':>9} {'shadows':>8} {'step ms':>8} {'mujoco ms':>10} {'ratio':>6} {'frames/s':>9}")
    for width, height in ((160, 120), (320, 240), (640, 480)):
        for shadows in (False, True):
            ours, theirs, ratio = measure(width, height, shadows)
            print(
                f"{width:>5}x{height:<3} {shadows!s:>8} {ours:>8.2f} {theirs:>10.2f} {ratio:>6.2f} {1e3 / ours:>9.0f}"
            )
    for name in ("plaza-walk", "corridor", "warehouse", "street-night"):
        print(f"reset {name}: {measure_reset(name):.2f} s")


if __name__ == "__main__":
    main()
