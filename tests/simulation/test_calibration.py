"""A camera from a calibration file: the picture and the truth are where OpenCV puts them."""

from pathlib import Path

import cv2
import mujoco
import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.core.calibration import read_calibration
from pftrack_sim.core.errors import ParameterError, ScenarioError
from pftrack_sim.core.records import Truth
from pftrack_sim.scene.layout import body_owners
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.simulation.world import World

ROS = """image_width: 320
image_height: 240
camera_name: narrow
camera_matrix: {rows: 3, cols: 3, data: [219.4, 0.0, 148.3, 0.0, 231.7, 126.9, 0.0, 0.0, 1.0]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.36, 0.11, 0.001, 0.0005, 0.0]}
"""
KALIBR = """cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.36, 0.11, 0.001, 0.0005]
  distortion_model: radtan
  intrinsics: [219.4, 231.7, 148.3, 126.9]
  resolution: [320, 240]
  T_cam_imu:
  - [1.0, 0.0, 0.0, 0.1]
  - [0.0, 1.0, 0.0, 0.2]
"""
SIZE = {"camera.width_px": 320, "camera.height_px": 240}
K = np.array([[219.4, 0.0, 148.3], [0.0, 231.7, 126.9], [0.0, 0.0, 1.0]])
LENS = np.array([-0.36, 0.11, 0.001, 0.0005, 0.0])
RATIONAL = np.array([0.7, 0.1, 0.001, -0.002, 0.01, 1.1, 0.3, 0.02])
FISHEYE = np.array([0.03, -0.01, 0.004, -0.0008])


def ros(lens: np.ndarray) -> str:
    """The calibration with another lens."""
    text = ROS.replace("[-0.36, 0.11, 0.001, 0.0005, 0.0]", str(lens.tolist()))
    return text.replace("plumb_bob", {4: "equidistant", 5: "plumb_bob", 8: "rational_polynomial"}[len(lens)])


BY_OPENCV = ros(FISHEYE).replace("distortion_model: equidistant", "fisheye_model: 1")
BY_KALIBR = KALIBR.replace("[-0.36, 0.11, 0.001, 0.0005]", str(FISHEYE.tolist())).replace("radtan", "equidistant")


def written(folder: Path, text: str = ROS) -> dict[str, object]:
    """Overrides that name a calibration file with this text."""
    (folder / "camera.yaml").write_text(text)
    return {"camera.calibration": str(folder / "camera.yaml"), **SIZE}


@pytest.mark.parametrize(
    ("text", "lens"),
    [(ROS, LENS), (KALIBR, LENS), (ros(FISHEYE), FISHEYE), (BY_OPENCV, FISHEYE), (BY_KALIBR, FISHEYE)],
)
def test_files_of_ros_opencv_and_kalibr_are_read(text: str, lens: np.ndarray, tmp_path: Path):
    written(tmp_path, text)
    found = read_calibration(tmp_path / "camera.yaml")
    np.testing.assert_array_equal(found.K, K)
    assert found.size_px == (320, 240)
    assert found.lens == tuple(lens)
    assert found.equidistant == (len(lens) == 4)


@pytest.mark.parametrize("lens", [LENS, np.zeros(5), RATIONAL, FISHEYE, np.zeros(4)])
def test_boxes_are_where_opencv_projects_the_target(lens: np.ndarray, tmp_path: Path):
    with Simulation(scenario.load("plaza-walk", written(tmp_path, ros(lens))), image=False) as simulation:
        simulation.reset(3)
        for _ in range(3):
            truth = simulation.advance().truth
            np.testing.assert_allclose(truth.K, K + 0.5 * np.outer([1, 1, 0], [0, 0, 1]))
            np.testing.assert_array_equal(truth.distortion, lens)
            assert np.abs(truth.amodal_box - box_by_opencv(simulation.world, truth)).max() < 0.05


def box_by_opencv(world: World, truth: Truth) -> np.ndarray:
    """`(4,)` extent of the vertices of the target, as OpenCV projects them with the camera of a frame."""
    model, data = world.model, world.data
    own = np.array([one == "target" for one in body_owners(model)])[model.geom_bodyid]
    points = np.vstack([vertices(model, data, geom) for geom in np.flatnonzero(own & (model.geom_dataid >= 0))])
    camera = (points - truth.T_world_camera[:3, 3]) @ truth.T_world_camera[:3, :3]
    matrix = truth.K - 0.5 * np.outer([1, 1, 0], [0, 0, 1])  # our pixels begin at their corners
    project = cv2.fisheye.projectPoints if len(truth.distortion) == 4 else cv2.projectPoints
    found, _ = project(camera[:, None], np.zeros(3), np.zeros(3), matrix, truth.distortion)
    places = found.reshape(-1, 2) + 0.5
    return np.hstack([places.min(axis=0), np.ptp(places, axis=0)])


def vertices(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> np.ndarray:
    mesh = model.geom_dataid[geom]
    first = model.mesh_vertadr[mesh]
    own = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
    return own @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


def test_a_file_beside_a_scenario_is_found_and_its_size_is_the_cameras(tmp_path: Path):
    written(tmp_path)
    (tmp_path / "mine.toml").write_text('extends = "corridor"\n[camera]\ncalibration = "camera.yaml"\n')
    camera = scenario.load(tmp_path / "mine.toml").resolve(0).camera
    assert (camera.width_px, camera.height_px) == (320, 240)
    assert camera.K.tolist() == [[219.4, 0.0, 148.8], [0.0, 231.7, 127.4], [0.0, 0.0, 1.0]]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: [1,,\n b", "cannot be read as a calibration"),
        (ROS.replace("plumb_bob", "equidistant"), "of the model plumb_bob .* is needed, got equidistant with 5"),
        (ROS.replace("0.0005, 0.0]", "0.0005, 0.0, 0.1, 0.0, 0.0, 0.1, 0, 0, 0]"), "got plumb_bob with 12 coeff"),
        (KALIBR.replace("model: pinhole", "model: omni"), "camera_model is omni"),
        (ROS.replace("219.4, 0.0, 148.3", "219.4, 1.5, 148.3"), "none of a pinhole without skew"),
        (ROS.replace("126.9, 0.0, 0.0, 1.0", "126.9, 0.0, 0.0, 0.0"), "none of a pinhole without skew"),
        (ROS.replace("219.4", "0.0"), r"focal lengths \[0.0\]"),
        (ROS.replace("image_width: 320\nimage_height: 240\n", ""), "tells no width and height"),
        (ROS.replace("219.4, 0.0, 148.3", "1.0e+9, 0.0, 148.3"), "camera.calibrated.fx"),
    ],
)
def test_what_a_camera_cannot_be_made_of_is_said(text: str, said: str, tmp_path: Path):
    with pytest.raises(ScenarioError, match=said):
        scenario.load("corridor", written(tmp_path, text))


def test_a_lens_that_folds_the_image_is_named_with_its_calibration(tmp_path: Path):
    one = Simulation(scenario.load("corridor", written(tmp_path, ROS.replace("-0.36, 0.11", "-3.6, 0.0"))))
    with one, pytest.raises(ScenarioError, match=r"camera\.calibrated with axes\.distortion: .* is not invertible"):
        one.reset(0)


def test_the_axis_of_distortion_is_refused_on_an_equidistant_lens(tmp_path: Path):
    with pytest.raises(ScenarioError, match=r"axes\.distortion: is of Brown's model"):
        scenario.load("corridor", written(tmp_path, ros(FISHEYE)) | {"axes.distortion.severity": 1.0})


def test_another_size_of_the_image_is_refused_with_the_remedy(tmp_path: Path):
    large = {"camera.width_px": 640, "camera.height_px": 480}
    with pytest.raises(ScenarioError, match="images of 320 x 240: set camera"):
        scenario.load("corridor", written(tmp_path) | large)
    with pytest.raises(ParameterError, match="cannot be read: No such file"):
        read_calibration(tmp_path / "none.yaml")
