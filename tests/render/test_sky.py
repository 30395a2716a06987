"""OpenGL's sky hides what lies deeper than 82 m (docs/renderers.md)."""

import numpy as np

from pftrack_sim.scenario import load
from pftrack_sim.simulation.simulation import Simulation

SKY_M = 82.0


def test_the_fixed_camera_of_plaza_dock_sees_nothing_behind_the_sky() -> None:
    small = {"camera.width_px": 160, "camera.height_px": 120, "lights.shadows": False}
    with Simulation(load("plaza-dock", small)) as simulation:
        simulation.reset(0)
        depth_m = simulation.depth()
    seen = depth_m[np.isfinite(depth_m)]
    assert 70.0 < seen.max() < SKY_M, "the houses at the end of the far road"
