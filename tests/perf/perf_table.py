"""What a step and a reset cost, in one table, against the table of `tests/perf/table.json`.

    python tests/perf/perf_table.py [--parts A,B] [--rounds N] [--json FILE] [--commit]

Every row is measured once a round, the rows in turn, so that a noisy machine disturbs all alike. The value is the
median over the rounds, its noise half the distance of the quartiles. All times are processor times, with OpenGL in the
calling thread where it is Mesa's; only the part `vector` takes the time of the clock, and needs two idle cores.
`--commit` makes the rows of this run those that the next ones are compared with.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("MUJOCO_GL", "egl")
os.environ["LP_NUM_THREADS"] = "0"
for _library in ("OMP", "OPENBLAS", "MKL"):
    os.environ[f"{_library}_NUM_THREADS"] = "1"

import cv2
import gymnasium as gym
import mujoco
import numpy as np
from perf_trackers import Walk, costs_ms, make
from perf_vector import steps_per_s, steps_per_s_apart

import pftrack_sim  # noqa: F401 - registers the environments

STEPS, SEED = 10, 1
COMMITTED = Path(__file__).with_name("table.json")
SIZES = {"640x480, shadows": (640, 480, True), "320x240": (320, 240, False), "84x84": (84, 84, False)}
TRACKERS = ("ko2012", "lee2012-color-hog", "lee2012")
ANSWER = np.array([0.0, 0.0, 10.0, 10.0])
DRAWING = ("mjr_render", "mjr_readPixels", "mjr_uploadTexture", "mj_step")

Row = dict[str, float]
spent = {"s": 0.0, "draws": 0.0}


def clock_drawing() -> None:
    """Add up the processor time of drawing and physics, and the number of draws."""
    for name in DRAWING:
        real = getattr(mujoco, name)

        def timed(*arguments: Any, real: Callable[..., Any] = real, draws: bool = name == "mjr_render") -> Any:
            began = time.process_time()
            try:
                return real(*arguments)
            finally:
                spent["s"] += time.process_time() - began
                spent["draws"] += draws

        setattr(mujoco, name, timed)


class Steps:
    """One environment, and MuJoCo's own renderer beside it."""

    def __init__(self, name: str) -> None:
        width, height, shadows = SIZES[name]
        size = {"camera.width_px": width, "camera.height_px": height, "lights.shadows": shadows, "duration_s": 600}
        self._name, self._env = name, gym.make("pftrack_sim/Track-v0", scenario="plaza-walk", overrides=size).unwrapped
        self._size = width, height

    def measure(self) -> Row:
        """One round, from the start of the episode, so that every round shows the same frames."""
        env, times, rest = self._env, [], []
        env.reset(seed=SEED)
        draws = spent["draws"]
        for _ in range(STEPS):
            before, began = spent["s"], time.process_time()
            env.step(ANSWER)
            times.append(time.process_time() - began)
            rest.append(times[-1] - (spent["s"] - before))
        draws = (spent["draws"] - draws) / STEPS
        theirs = []
        world = env.simulation.world
        with mujoco.Renderer(world.model, *self._size[::-1]) as renderer:
            for _ in range(STEPS):
                began = time.process_time()
                renderer.update_scene(world.data, camera="robot/camera")
                renderer.render()
                theirs.append(time.process_time() - began)
        return {
            f"beside drawing and mj_step, {self._name} [ms]": 1e3 * float(np.median(rest)),
            f"step / mujoco.Renderer, {self._name}": float(np.median(times) / np.median(theirs)),
            f"draws per step, {self._name}": draws,
        }


class Resets:
    """Resets of the next seed of the same place."""

    def __init__(self, scenario: str) -> None:
        size = {"camera.width_px": 84, "camera.height_px": 84}
        self._scenario, self._env = scenario, gym.make("pftrack_sim/Track-v0", scenario=scenario, overrides=size)
        self._seed = SEED

    def measure(self) -> Row:
        """One round: the next seed."""
        self._seed += 1
        began = time.process_time()
        self._env.reset(seed=self._seed)
        return {f"reset of the next seed, {self._scenario} [s]": time.process_time() - began}


class WithoutPixels:
    """Steps of an environment that draws nothing, with 6 people."""

    def __init__(self) -> None:
        self._env = gym.make("pftrack_sim/Track-v0", scenario="plaza-walk", image=False)

    def measure(self) -> Row:
        """One round, from the start of the episode."""
        self._env.reset(seed=SEED)
        began = time.process_time()
        for _ in range(3 * STEPS):
            self._env.step(ANSWER)
        return {"steps/s without pixels": 3 * STEPS / (time.process_time() - began)}


def trackers() -> Row:
    """Default presets with 100 particles against TrackerMIL: 640x480, a box of 80x160."""
    ms = costs_ms({name: make(name) for name in ("opencv-mil", *TRACKERS)}, Walk(), 12)
    return {f"{name} / cv2.TrackerMIL": ms[name] / ms["opencv-mil"] for name in TRACKERS}


def vector() -> Row:
    """Eight environments in processes of their own against one; and what two that exchange nothing reach here."""
    return {
        "steps/s, 8 environments / 1": steps_per_s("async", 8) / steps_per_s("async", 1),
        "steps/s, 2 processes that exchange nothing / 1": steps_per_s_apart(2) / steps_per_s_apart(1),
    }


def start() -> Row:
    """The benchmark from the command to its first short episode."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        few = ["--seeds", "0:1", "--trackers", "stay", "--set", "duration_s=0.1", "--workers", "1"]
        command = [sys.executable, "-m", "pftrack_sim", "bench", "quick", *few, "--out", f"{folder}/run"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"bench quick, one seed of 0.1 s, whole [s]": spent_s}


PARTS: dict[str, Callable[[], list[Callable[[], Row]]]] = {
    "steps": lambda: [Steps(name).measure for name in SIZES],
    "resets": lambda: [Resets(name).measure for name in ("plaza-walk", "corridor", "warehouse")],
    "pixels": lambda: [WithoutPixels().measure],
    "trackers": lambda: [trackers],
    "vector": lambda: [vector],
    "start": lambda: [start],
}


def table(names: list[str], count: int) -> dict[str, Row]:
    """Median and noise of every row of these parts over so many rounds."""
    cv2.setNumThreads(1)
    clock_drawing()
    parts = [part for name in names for part in PARTS[name]()]
    rounds: dict[str, list[float]] = {}
    for number in range(1 + count):
        for part in parts:
            for name, value in part().items():
                if number:  # What is compiled or read at first use is not what a step costs.
                    rounds.setdefault(name, []).append(value)
    return {
        name: {"value": float(np.median(values)), "noise": 0.5 * float(np.subtract(*np.percentile(values, [75, 25])))}
        for name, values in rounds.items()
    }


def main() -> None:
    """Measure, print and write the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--parts", default=",".join(PARTS), help="of " + ", ".join(PARTS))
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--json", type=Path, default=Path("build/perf.json"))
    parser.add_argument("--commit", action="store_true")
    given = parser.parse_args()
    committed: dict[str, Row] = json.loads(COMMITTED.read_text()) if COMMITTED.exists() else {}
    names = given.parts.split(",")
    if unknown := sorted(set(names) - set(PARTS)):
        parser.error(f"unknown parts {', '.join(unknown)}; there are {', '.join(PARTS)}")
    found = table(names, given.rounds)
    print(f"{'':<56} {'now':>9} {'noise':>8} {'before':>9} {'change':>8}")
    for name, row in found.items():
        line = f"{name:<56} {row['value']:>9.3f} {row['noise']:>8.3f}"
        if before := committed.get(name):
            change = row["value"] / before["value"] - 1.0
            beyond = abs(row["value"] - before["value"]) > row["noise"] + before["noise"]
            line += f" {before['value']:>9.3f} {change:>+8.0%}{'' if beyond else ' within noise'}"
        print(line)
    given.json.parent.mkdir(parents=True, exist_ok=True)
    given.json.write_text(json.dumps(found, indent=2) + "\n")
    if given.commit:
        COMMITTED.write_text(json.dumps(committed | found, indent=2) + "\n")


if __name__ == "__main__":
    main()
