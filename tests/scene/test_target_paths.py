"""The target's path of every shipped scenario keeps clear of obstacles."""

from dataclasses import replace

import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.core.random_streams import stream
from pftrack_sim.scene.places import add_place
from pftrack_sim.scene.scene_spec import SceneSpec

HALF_SHOULDERS_M = 0.25


@pytest.mark.parametrize("name", scenario.names())
def test_target_path_keeps_clear_of_obstacles(name: str) -> None:
    for seed in (0, 1):
        settings = scenario.load(name).resolve(seed)
        place = settings.place.model_copy(update={"clutter": 1.0})
        area = add_place(SceneSpec(), place, settings.lights, stream(seed, "place"))
        path = Path(settings.target.path_m)
        walked_m = min(path.length_m, settings.target.speed_m_s * settings.duration_s)
        points = np.array([path.at(s)[:2] for s in np.arange(0.0, walked_m, 0.1)])
        clearance = ObstacleMap(replace(area, bounds_m=(-1e3, -1e3, 1e3, 1e3))).clearance_m(points)
        worst = int(clearance.argmin())
        assert clearance[worst] > HALF_SHOULDERS_M, f"seed {seed}: {clearance[worst]:.2f} m at {points[worst].round(1)}"
