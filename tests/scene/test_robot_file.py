"""What in a robot's file carries its camera, and its meshes of COLLADA."""

from pathlib import Path

import numpy as np
import pytest
from robot_files import dae, write_urdf

from pftrack_sim.scenario.robot import Robot, StillRoute
from pftrack_sim.scene.robot_file.collada import read_collada
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


def test_polygons_are_placed_by_the_scene_in_metres():
    vertices, faces = read_collada(dae((0.3, 0.2, 0.1)).encode())
    np.testing.assert_allclose(vertices.min(axis=0), [-0.3, -0.2, -0.1], atol=1e-6)
    np.testing.assert_allclose(vertices.max(axis=0), [0.3, 0.2, 0.1], atol=1e-6)
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert 0.5 * np.linalg.norm(normals, axis=1).sum() == pytest.approx(8 * (0.06 + 0.03 + 0.02), abs=1e-6)
    assert (np.einsum("ni,ni->n", normals, corners.mean(axis=1)) > 0.0).all()


@pytest.mark.parametrize("content", [b"solid", b"<COLLADA/>"])
def test_files_without_triangles_are_an_error(content: bytes):
    with pytest.raises(ValueError, match=r"no COLLADA|no triangles"):
        read_collada(content)
