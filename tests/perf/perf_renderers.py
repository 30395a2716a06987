"""OpenGL and, where it is installed, the ray caster: a frame with the full truth, by size, with and without shadows.

    python tests/perf/perf_renderers.py

Prints milliseconds of each; their ratio is what to compare between machines.
"""

from __future__ import annotations

import time

import numpy as np

from pftrack_sim.render.renderer import warp_installed
from pftrack_sim.scenario import load
from pftrack_sim.simulation.simulation import Simulation

SIZES = ((84, 84), (160, 120), (320, 240), (640, 480))
FRAMES = 5


def frame_ms(backend: str, size: tuple[int, int], shadows: bool) -> float:
    """Median time of drawing and truth, without the world's own motion."""
    scenario = load("plaza-walk", {"camera.width_px": size[0], "camera.height_px": size[1]})
    with Simulation(scenario, backend=backend) as simulation:
        simulation.reset(3)
        if not shadows:
            simulation.world.model.light_castshadow[:] = False
        # What a renderer has copied of the model is read anew.
        assert simulation._camera.renderer is not None
        simulation._camera.renderer.rebind(simulation.world.model)
        simulation._take_frame()
        times = []
        for _ in range(FRAMES):
            simulation.world.advance(None)
            start = time.perf_counter()
            simulation._take_frame()
            times.append(time.perf_counter() - start)
    return 1e3 * float(np.median(times))


def main() -> None:
    """Print the table."""
    names = ("gl", "warp") if warp_installed() else ("gl",)
    print(f"{'size':>9} {'shadows':>8}", *(f"{name + ' ms':>8}" for name in names))
    for size in SIZES:
        for shadows in (True, False):
            times = [frame_ms(name, size, shadows) for name in names]
            print(
                f"{size[0]:>5}x{size[1]:<3} {'yes' if shadows else 'no':>8}", *(f"{time_ms:8.1f}" for time_ms in times)
            )


if __name__ == "__main__":
    main()
