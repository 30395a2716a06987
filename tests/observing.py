"""Truth of one frame, for the tests of the truth."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from render_stage import K, Stage

from pftrack_sim.core.records import Truth
from pftrack_sim.render.gl.rasteriser import Rasteriser
from pftrack_sim.truth.observer import TruthObserver

Drawing = Callable[[Stage], Rasteriser]


def observed(stage: Stage, renderer: Rasteriser, pose: np.ndarray) -> dict[str, Truth]:
    """Truth by name, from a new observer."""
    observer = TruthObserver(stage.model, stage.people, renderer, K)
    image = renderer.color(stage.data, pose, K)
    people = observer.observe(stage.data, pose, image, 0.0, stage.roots())
    assert people[0].name == stage.people[0]
    return {truth.name: truth for truth in people}
