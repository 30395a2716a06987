"""What the 3D view shows and where it starts, without a browser."""

import io
from types import SimpleNamespace
from unittest.mock import MagicMock

import mujoco
import numpy as np
import pytest

from pftrack_sim.render.renderer import geoms_drawn
from pftrack_sim.studio import Session, Settings
from pftrack_sim.studio.page import Page
from pftrack_sim.studio.scene_view import SceneView

trimesh = pytest.importorskip("trimesh", reason="the extra studio is not installed")
SMALL = {"camera.width_px": 96, "camera.height_px": 72, "lights.shadows": False, "duration_s": 1.0}


def test_the_view_starts_inside_the_room_and_shows_its_textures_and_the_peoples_colours():
    session, server = Session(Settings("corridor", 3, SMALL)), MagicMock()
    model, moment = session.simulation.world.model, session.moment
    view = SceneView(server, MagicMock(), MagicMock(), MagicMock())
    view.build(model, moment, session.people, np.zeros((2, 2)))
    session.close()

    eye, towards = view.overview()
    camera, back = moment.truth.T_world_camera[:3, 3], (eye - towards) * (1.0, 1.0, 0.0)
    hit = np.zeros(1, dtype=np.int32)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    start = camera + 0.5 * back / np.linalg.norm(back)  # outside of the robot
    far_m = mujoco.mj_ray(model, data, start, back / np.linalg.norm(back), None, 1, -1, hit)
    assert 0.5 + far_m < 4.0, "a wall stands where the view started"
    assert np.linalg.norm((eye - camera)[:2]) < 0.5 + far_m

    scene = trimesh.load(io.BytesIO(server.scene.add_glb.call_args.args[1]), file_type="glb")
    textures = [one.visual.material.baseColorTexture for one in scene.geometry.values()]
    assert max(np.asarray(one).std() for one in textures if one is not None) > 10.0

    colours = {
        call.args[0]: call.kwargs["batched_colors"] for call in server.scene.add_batched_meshes_simple.call_args_list
    }
    person = np.concatenate([one for name, one in colours.items() if name.startswith("/moving/target/")])
    assert len(person) == sum(model.geom(i).name.startswith("target/") for i in np.flatnonzero(geoms_drawn(model)))
    assert np.ptp(person.astype(int), axis=0).max() > 30, "hair, shirt and trousers differ"


def test_the_picture_gets_a_share_of_the_window_but_never_too_little():
    page = object.__new__(Page)
    for window_px, width_px in ((1400, 644), (600, 420)):
        client = MagicMock(camera=SimpleNamespace(image_width=window_px))
        page._fit(client)
        assert client.gui.main_panel.set_width.call_args.args[0] == pytest.approx(width_px)
