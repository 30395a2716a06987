"""Renderers of this machine: which of them work, and the time of a frame."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from pftrack_sim.cli.tables import print_lines
from pftrack_sim.core.errors import RenderError
from pftrack_sim.scenario import load
from pftrack_sim.simulation.simulation import Simulation

if TYPE_CHECKING:
    from pftrack_sim.render.doctor import Report

SIZE_PX = 320, 240
_FRAMES = 5


def print_doctor(report: Report) -> None:
    """Print which renderers work with the remedies for the others, and the time of a frame with each that works."""
    print_lines(report.lines())
    working = [report.chosen.backend] if report.chosen else []
    for name in [*working, *(["warp"] if report.warp else [])]:
        try:
            result = f"takes {frame_ms(name):.0f} ms"
        except RenderError as error:
            result = f"fails: {error}"
        print_lines([f"{name}: a frame of {SIZE_PX[0]}x{SIZE_PX[1]} with its truth {result}"])


def frame_ms(backend: str) -> float:
    """Median time of a frame of `plaza-walk` with its truth, at `SIZE_PX` [ms]; the first frames are not timed.

    Raises:
        RenderError: The backend does not work here.
    """
    scenario = load("plaza-walk", {"camera.width_px": SIZE_PX[0], "camera.height_px": SIZE_PX[1]})
    with Simulation(scenario, backend=backend) as simulation:
        simulation.reset(0)
        simulation.advance()
        times: list[float] = []
        for _ in range(_FRAMES):
            start = time.perf_counter()
            simulation.advance()
            times.append(time.perf_counter() - start)
    return 1e3 * float(np.median(times))
