"""Truth of one frame of a stage, and of many frames of an episode."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from render_stage import K, Stage

from pftrack_sim import scenario
from pftrack_sim.core.records import Truth
from pftrack_sim.render.gl.rasteriser import Rasteriser
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.truth.observer import TruthObserver

Drawing = Callable[[Stage], Rasteriser]


def observed(stage: Stage, renderer: Rasteriser, pose: np.ndarray) -> dict[str, Truth]:
    """Truth by name, from a new observer."""
    observer = TruthObserver(stage.model, stage.people, renderer, K)
    image = renderer.color(stage.data, pose, K)
    people = observer.observe(stage.data, pose, image, 0.0, stage.roots())
    assert people[0].name == stage.people[0]
    return {truth.name: truth for truth in people}


def truths(name: str, overrides: Mapping[str, Any], seed: int, from_s: float, until_s: float) -> list[Truth]:
    """Truth of the target in the first frame, and in those from a time on; before it nothing is rendered."""
    with Simulation(scenario.load(name, overrides)) as simulation:
        observed, rate_hz = [simulation.reset(seed).truth], simulation.settings.camera.rate_hz
        for _ in range(round(from_s * rate_hz) - 1):
            simulation.world.advance()
        return observed + [simulation.advance().truth for _ in range(round((until_s - from_s) * rate_hz))]
