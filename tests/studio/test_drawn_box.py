"""A rectangle in the 3D view becomes a box on the picture, without a browser."""

from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
from scipy.spatial.transform import Rotation

from pftrack_sim.core.records import Frame
from pftrack_sim.studio.recording import RecordedMoment, _truth
from pftrack_sim.studio.scene_view import SceneView

IMAGE = np.zeros((72, 96, 3), dtype=np.uint8)


def test_a_rectangle_seen_through_the_camera_and_from_aside_is_the_same_box():
    drawn: list[np.ndarray] = []
    truth = _truth(np.full(4, np.nan), IMAGE, 0.0)
    nothing = np.zeros((0, 3))
    view = SceneView(MagicMock(), MagicMock(), MagicMock(), drawn.append)
    view.build_recording(RecordedMoment(Frame(0, 0.0, IMAGE, truth, ()), truth, {}, {}, 0, 0, nothing, nothing))
    camera = SimpleNamespace(aspect=2.0)
    view.look_through(SimpleNamespace(camera=camera))
    pose = truth.T_world_camera
    np.testing.assert_allclose(camera.position, pose[:3, 3], atol=1e-12)
    assert np.dot(camera.look_at - camera.position, pose[:3, 2]) > 0.0
    camera.wxyz = Rotation.from_matrix(pose[:3, :3]).as_quat(scalar_first=True)

    # The picture is 4/3 as wide as high, the view twice: there is room at the sides, and a margin above.
    margin = np.tan(0.5 * camera.fov) / np.tan(np.deg2rad(25.0))
    assert 1.0 < margin < 1.2
    corners = np.array([[0.25, 0.1], [0.75, 0.6]])
    screen = 0.5 + (corners - 0.5) / (margin * np.array([2.0 * 3.0 / 4.0, 1.0]))
    event = SimpleNamespace(client=SimpleNamespace(camera=camera), screen_min=screen[0], screen_max=screen[1])
    view._drawn(event)
    np.testing.assert_allclose(drawn[-1], [0.25, 0.1, 0.5, 0.5], atol=1e-9)

    # From half as near, everything looks twice as large.
    camera.position = pose[:3, 3] + 0.4 * pose[:3, 2]
    event.screen_min, event.screen_max = 0.5 + 2.0 * (screen - 0.5)
    view._drawn(event)
    np.testing.assert_allclose(drawn[-1], [0.25, 0.1, 0.5, 0.5], atol=1e-9)

    # A rectangle behind the picture's plane is none.
    camera.position = pose[:3, 3] + 2.0 * pose[:3, 2]
    view._drawn(event)
    assert len(drawn) == 2
