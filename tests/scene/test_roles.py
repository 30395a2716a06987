"""What in a robot's file carries its camera."""

from pathlib import Path

import numpy as np
from robot_files import write_urdf

from pftrack_sim.scenario.robot import Robot, StillRoute
from pftrack_sim.scene.robot_file.fitting import fit
from pftrack_sim.scene.robot_file.roles import Roles


def test_a_link_looks_along_x_and_an_optical_one_along_z(tmp_path: Path):
    file = str(write_urdf(tmp_path))
    link, optical = (
        fit(Roles.of(Robot(route=StillRoute(kind="still"), model=file, camera_site=site))).T_base_camera
        for site in ("camera_link", "camera_optical_frame")
    )
    np.testing.assert_allclose(link, optical, atol=1e-6)
    np.testing.assert_allclose(link[:3, 2], [1.0, 0.0, 0.0], atol=1e-6)
