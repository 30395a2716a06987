"""How long a frame takes on this machine, by renderer."""

from __future__ import annotations

import time

import numpy as np

from pftrack_sim.scenario import load
from pftrack_sim.simulation.simulation import Simulation

SIZE_PX = 320, 240
_FRAMES = 5


def frame_ms(backend: str) -> float:
    """Median time of a frame of `plaza-walk` with its full truth, at `SIZE_PX` [ms].

    Args:
        backend: As `pftrack_sim.render.selection.NAMES`.

    Raises:
        RenderError: It cannot draw here.
    """
    scenario = load("plaza-walk", {"camera.width_px": SIZE_PX[0], "camera.height_px": SIZE_PX[1]})
    with Simulation(scenario, backend=backend) as simulation:
        simulation.reset(0)
        simulation.advance()
        times = []
        for _ in range(_FRAMES):
            start = time.perf_counter()
            simulation.advance()
            times.append(time.perf_counter() - start)
    return 1e3 * float(np.median(times))
