"""Many robots at once: steps per second of vector environments, one after the other and in processes of their own.

    python tests/perf/perf_vector.py

Each step counts once for each environment in it. The observations are boxes of the oracle, the frames small. The ratio
to one environment is what to compare between machines.
"""

from __future__ import annotations

import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import gymnasium as gym

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim.wrappers import BoxObservation

OVERRIDES = {"camera.width_px": 64, "camera.height_px": 48, "lights.shadows": False, "distractors.count": 0}
STEPS = 60


def make() -> gym.Env[Any, Any]:
    """Boxes instead of pixels, as a learner sees it."""
    return BoxObservation(gym.make("pftrack_sim/Follow-v0", scenario="corridor", overrides=OVERRIDES))


def steps_per_s(name: str, count: int) -> float:
    """Steps per second of all environments together, in episodes in which the robot stands still."""
    # A process that was forked from one that has drawn cannot open OpenGL again.
    envs: Any = (
        gym.vector.SyncVectorEnv([make] * count)
        if name == "sync"
        else gym.vector.AsyncVectorEnv([make] * count, context="forkserver")
    )
    envs.reset(seed=3)
    still = 0.0 * envs.action_space.sample()
    envs.step(still)
    start = time.perf_counter()
    for _ in range(STEPS):
        envs.step(still)
    seconds = time.perf_counter() - start
    envs.close()
    return STEPS * count / seconds


def steps_per_s_apart(count: int) -> float:
    """Steps per second of single environments at once, in processes that exchange nothing: what a machine allows."""
    processes = multiprocessing.get_context("forkserver")
    with processes.Manager() as manager, ProcessPoolExecutor(count, processes) as pool:
        return sum(pool.map(_steps_per_s_alone, [manager.Barrier(count)] * count))


def _steps_per_s_alone(others: Any) -> float:
    """Steps per second of one environment in this process, from the moment at which all others are ready."""
    env = make()
    env.reset(seed=3)
    still = 0.0 * env.action_space.sample()
    env.step(still)
    others.wait()
    start = time.perf_counter()
    for _ in range(STEPS):
        env.step(still)
    return STEPS / (time.perf_counter() - start)


def main() -> None:
    """Print the table."""
    alone: float | None = None
    print(f"{'envs':>4} {'kind':>6} {'steps/s':>8} {'ratio':>6}")
    for name in ("sync", "async"):
        for count in (1, 2, 4):
            speed = steps_per_s(name, count)
            alone = speed if alone is None else alone
            print(f"{count:>4} {name:>6} {speed:8.1f} {speed / alone:6.2f}", flush=True)
    for count in (1, 2):
        speed = steps_per_s_apart(count)
        print(f"{count:>4} {'apart':>6} {speed:8.1f} {speed / alone:6.2f}", flush=True)


if __name__ == "__main__":
    main()
