"""Nobody is sent through what stands in their way, in any scenario that ships."""

from dataclasses import replace

import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.scene.build import build_stage

BODY_M = 0.25
"""Half the width of a person's shoulders."""


@pytest.mark.parametrize("name", scenario.names())
def test_the_targets_way_leads_past_everything_that_stands_there(name: str):
    for seed in (0, 1):
        loaded = scenario.load(name)
        settings = loaded.resolve(seed)
        full = settings.model_copy(update={"place": settings.place.model_copy(update={"clutter": 1.0})})
        path = Path(settings.target.path_m)
        walked_m = settings.target.speed_m_s * settings.duration_s
        way = np.array([path.at(s)[:2] for s in np.arange(0.0, min(path.length_m, walked_m), 0.1)])
        layout = replace(build_stage(full, seed, 0.002).layout, bounds_m=(-1e3, -1e3, 1e3, 1e3))
        clearance = ObstacleMap(layout).clearance_m(way)
        worst = int(clearance.argmin())
        assert clearance[worst] > BODY_M, f"seed {seed}: {clearance[worst]:.2f} m at {way[worst].round(1)}"
