"""What pictures and truth cost, as ratios to MuJoCo's own renderer beside it in the same rounds.

    colour    Rasteriser.color                / (mujoco.Renderer.update_scene + render)
    truth     TruthMaker.observe              / Rasteriser.color
    together  both                            / (mujoco.Renderer.update_scene + render)

Rounds are interleaved, so that a noisy machine disturbs all sides alike; medians are shown. Run as a program, with
the names of scenarios if not all are wanted.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from statistics import median
from typing import Any

import mujoco
import numpy as np
from mujoco.rendering.classic import renderer as mujoco_renderer

from pftrack_sim import scenario
from pftrack_sim.camera.pinhole import intrinsics
from pftrack_sim.render.gl.context import open_context
from pftrack_sim.render.gl.rasteriser import Rasteriser
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.truth.observer import TruthObserver

SIZES = ((160, 120), (320, 240), (640, 480))
SCENARIOS = ("plaza-walk", "corridor", "warehouse", "street-night")
FRAMES, ROUNDS = 12, 8


class Borrowed:
    """A context for `mujoco.Renderer`, which would choose one by an environment variable."""

    def __init__(self, width: int, height: int) -> None:
        self._context = open_context(size=(width, height))

    def make_current(self) -> None:
        self._context._context.make_current()

    def as_current(self) -> Any:
        return self._context.current()

    def free(self) -> None:
        self._context.close()


def measure(name: str, width: int, height: int, shadows: bool) -> dict[str, float]:
    """Median ms of each side over frames spread along an episode."""
    changes = {"camera.width_px": width, "camera.height_px": height, "lights.shadows": shadows}
    simulation = Simulation(scenario.load(name, changes))
    simulation.reset(1)
    world, settings = simulation.world, simulation.settings
    fovy = float(np.deg2rad(settings.camera.fovy_deg))
    ours = Rasteriser(world.model, width, height, exclusive=True)
    maker = TruthObserver(world.model, world.people, ours, intrinsics(width, height, fovy))
    theirs = mujoco_renderer.Renderer(world.model, height, width)
    camera = mujoco.mj_name2id(world.model, mujoco.mjtObj.mjOBJ_CAMERA, "robot/camera")
    taken: dict[str, list[float]] = {"colour": [], "truth": [], "mujoco": []}
    seen: list[int] = []
    for _ in range(FRAMES):
        for _ in range(8):
            simulation.advance()
        pose, image = world.camera_pose(), ours.color(world.data, world.camera_pose(), fovy)
        world.data.cam_xpos[camera] = pose[:3, 3]
        world.data.cam_xmat[camera] = (pose[:3, :3] @ np.diag([1.0, -1.0, -1.0])).ravel()

        def reference() -> None:
            theirs.update_scene(world.data, camera=camera)
            theirs.render()

        sides: dict[str, Callable[[], Any]] = {
            "colour": lambda pose=pose: ours.color(world.data, pose, fovy),
            "truth": lambda pose=pose, image=image: maker.observe(world.data, pose, image, 0.0, world.root_poses()),
            "mujoco": reference,
        }
        for _ in range(ROUNDS):
            for side, call in sides.items():
                began = time.perf_counter()
                call()
                taken[side].append(1e3 * (time.perf_counter() - began))
        seen.append(len(maker.observe(world.data, pose, image, 0.0, world.root_poses())))
    for one in (ours, theirs, simulation):
        one.close()
    return {side: median(values) for side, values in taken.items()} | {"people": sum(seen) / len(seen)}


def main() -> None:
    """Print a table."""
    mujoco_renderer.gl_context.GLContext = Borrowed  # type: ignore[misc]
    line = "{:<14} {:>9} {:>7} {:>7} {:>9} {:>9} {:>9}   {:>7} {:>7} {:>9}\n"
    write = sys.stdout.write
    write(line.format("scenario", "size", "shadow", "people", "mujoco ms", "colour ms", "truth ms", *RATIOS))
    for name in sys.argv[1:] or SCENARIOS:
        for width, height in SIZES:
            for shadows in (False, True):
                ms = measure(name, width, height, shadows)
                ratios = (
                    ms["colour"] / ms["mujoco"],
                    ms["truth"] / ms["colour"],
                    (ms["colour"] + ms["truth"]) / ms["mujoco"],
                )
                numbers = [f"{ms[side]:.2f}" for side in ("mujoco", "colour", "truth")]
                size, shadow = f"{width}x{height}", "yes" if shadows else "no"
                write(line.format(name, size, shadow, f"{ms['people']:.1f}", *numbers, *(f"{r:.2f}" for r in ratios)))
                sys.stdout.flush()


RATIOS = ("colour", "truth", "together")

if __name__ == "__main__":
    main()
