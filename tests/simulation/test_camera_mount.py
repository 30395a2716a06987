"""The shaken camera does not see the mast and the head that it stands on."""

import numpy as np
from observing import TINY

from pftrack_sim import scenario
from pftrack_sim.scene.layout import owner_name
from pftrack_sim.simulation import Simulation

SHAKEN = {**TINY, "duration_s": 2.0, "axes.jitter.severity": 4.0}


def test_no_pixel_shows_the_mount_of_a_shaken_camera():
    with Simulation(scenario.load("plaza-walk", SHAKEN)) as simulation:
        simulation.reset(0)
        model = simulation.world.model
        robot = [geom for geom in range(model.ngeom) if owner_name(model.body(model.geom_bodyid[geom]).name) == "robot"]
        farthest_back_m = 0.0
        for _ in range(59):
            frame = simulation.advance()
            rest, pose = simulation.world.camera_pose(), frame.truth.T_world_camera
            farthest_back_m = max(farthest_back_m, float((rest[:3, 3] - pose[:3, 3]) @ pose[:3, 2]))
            assert not np.isin(simulation.scene_geometry().ids, robot).any()
            assert all("robot" not in truth.occluders for truth in frame.people)
    assert farthest_back_m > 0.06  # So far that the lens at rest lies beyond the near plane
