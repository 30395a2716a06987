"""Several cameras on one mast: each has its image and exact truth, and they agree with OpenCV's geometry."""

import pickle
from pathlib import Path
from typing import Any

import cv2
import gymnasium as gym
import numpy as np
import pytest

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim import policies, scenario, trackers
from pftrack_sim.benchmark import make_plan, run
from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ScenarioError, TrackerError, UnknownNameError
from pftrack_sim.core.records import Frame, Truth
from pftrack_sim.simulation.simulation import Simulation
from tests.observing import SMALL_WALK
from tests.simulation.test_calibration import FISHEYE, LENS, K, box_by_opencv, ros

BASELINE_M = 0.3
STEREO: dict[str, Any] = {
    **SMALL_WALK,
    "duration_s": 3.0,
    "cameras": [
        {"name": "right", "left_m": -BASELINE_M},
        {
            "name": "back",
            "ahead_m": -0.3,
            "up_m": 0.1,
            "pan_deg": 170.0,
            "width_px": 96,
            "height_px": 64,
            "fovy_deg": 70.0,
        },
    ],
}
EFFECTS = {f"axes.{name}.severity": 1.0 for name in ("jitter", "blur", "rolling_shutter", "noise", "distortion")}


def frames(overrides: dict[str, Any], count: int = 4, *, image: bool = False) -> list[Frame]:
    with Simulation(scenario.load(STEREO, overrides), image=image, cameras=True) as simulation:
        return [simulation.reset(3), *(simulation.advance() for _ in range(count - 1))]


def projection(truth: Truth) -> np.ndarray:
    """`(3, 4)` from the world to pixels."""
    return truth.K @ np.linalg.inv(truth.T_world_camera)[:3]


@pytest.mark.parametrize("axes", [{}, EFFECTS])
def test_a_camera_keeps_its_place_beside_the_first_one_under_every_vibration(axes: dict[str, float]):
    rigs = np.array([np.linalg.inv(one.truth.T_world_camera) @ one.cameras["right"].truth.T_world_camera
                     for one in frames(axes)])  # fmt: skip
    expected = np.eye(4)
    expected[0, 3] = BASELINE_M
    assert np.abs(rigs - expected).max() < 1e-9


def test_pan_tilt_and_roll_turn_it_as_the_keys_say():
    turned = {
        "pan_deg": [[0, 0, -1], [0, 1, 0], [1, 0, 0]],  # looks to the left: its axis is -x of the first one
        "tilt_deg": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],  # up: -y
        "roll_deg": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],  # its right side goes down
    }
    for key, axes in turned.items():
        settings = scenario.load(STEREO, {f"cameras.0.{key}": 90.0, "cameras.0.ahead_m": 0.5}).resolve(3)
        pose = settings.T_camera("right")
        assert np.abs(pose[:3, :3] - axes).max() < 1e-12, key
        assert pose[:3, 3].tolist() == [BASELINE_M, 0.0, 0.5]


@pytest.mark.parametrize("lens", [None, LENS, FISHEYE])
def test_boxes_in_each_camera_are_where_opencv_projects_the_target(lens: np.ndarray | None, tmp_path: Path):
    overrides: dict[str, Any] = {}
    if lens is not None:
        (tmp_path / "right.yaml").write_text(ros(lens))
        overrides["cameras.0.calibration"] = str(tmp_path / "right.yaml")
    overrides["cameras.1.pan_deg"] = 12.0
    with Simulation(scenario.load(STEREO, overrides), image=False, cameras=True) as simulation:
        simulation.reset(3)
        for _ in range(3):
            cameras = simulation.advance().cameras
            for truth in (cameras[name].truth for name in ("right", "back")):
                assert np.abs(truth.amodal_box - box_by_opencv(simulation.world, truth)).max() < 0.05
            if lens is not None:
                assert np.abs(cameras["right"].truth.K - K - 0.5 * np.outer([1, 1, 0], [0, 0, 1])).max() < 1e-9


def test_the_baseline_is_what_opencv_triangulates_the_target_with():
    for frame in frames({}):
        left, right = frame.truth, frame.cameras["right"].truth
        pixels = [boxes.centre(one.amodal_box)[:, None] for one in (left, right)]
        x, y, _, w = cv2.triangulatePoints(projection(left), projection(right), *pixels).ravel()
        off_m = np.array([x, y]) / w - left.T_world_target[:2, 3]
        assert np.hypot(*off_m) < 0.005 * left.distance_m
        assert left.T_world_target.tolist() == right.T_world_target.tolist()


def test_depth_in_one_camera_is_where_the_other_sees_it():
    """Disparity is f B / Z, at every pixel but where something hides what the other one sees."""
    found: dict[str, np.ndarray] = {}
    for name in ("camera", "right"):
        with Simulation(scenario.load(STEREO, {"viewed": name}), image=False) as simulation:
            simulation.reset(3)
            truth = simulation.advance().truth
            found[name] = simulation.depth().astype(np.float64)
    left, right = found["camera"], found["right"]
    rows, columns = np.nonzero(np.isfinite(left))
    places = columns + 0.5 - truth.K[0, 0] * BASELINE_M / left[rows, columns]
    seen = places >= 0.0
    other = right[rows[seen], np.floor(places[seen]).astype(int)]
    assert seen.sum() > 5000
    assert np.mean(np.abs(other / left[rows[seen], columns[seen]] - 1.0) < 0.03) > 0.95


@pytest.mark.parametrize("axes", [{}, EFFECTS])
def test_each_camera_takes_what_it_takes_alone(axes: dict[str, float]):
    together = frames(axes, image=True)
    for name in ("camera", "right", "back"):
        alone = scenario.load(STEREO, {**axes, "viewed": name})
        with Simulation(alone) as simulation:
            frame = simulation.reset(3)
            for number, whole in enumerate(together):
                other = whole if name == "camera" else whole.cameras[name]
                assert np.array_equal(frame.image, other.image), (name, number)
                assert frame.people == other.people
                frame = simulation.advance()
    clean = frames(axes | {"axes.noise.severity": 0.0}, image=True)
    noises = [one.image.astype(int) - two.image for one, two in zip(together, clean, strict=True)]
    assert all(noise.any() == bool(axes) for noise in noises)


def test_a_resumed_and_a_retuned_episode_have_all_cameras():
    loaded = scenario.load(STEREO, EFFECTS)
    with Simulation(loaded, cameras=True) as simulation:
        frame = simulation.reset(3)
        for _ in range(4):
            frame = simulation.advance()
        resumed = simulation.resume(3, [None] * 4)
        for name, one in frame.cameras.items():
            assert np.array_equal(resumed.cameras[name].image, one.image)
            assert resumed.cameras[name].people == one.people
        simulation.switch_target("distractor-1")
        simulation.retune(scenario.load(loaded, {"axes.distortion.severity": 2.0, "axes.blur.severity": 0.0}), 3)
        frame = simulation.advance()
        assert {one.truth.name for one in (frame, *frame.cameras.values())} == {"distractor-1"}
        assert (frame.cameras["right"].truth.distortion == frame.truth.distortion).all()
        assert set(pickle.loads(pickle.dumps(simulation)).reset(3).cameras) == {"right", "back"}


def test_observation_and_information_tell_of_each_by_name():
    env = gym.make("pftrack_sim/Track-v0", scenario=STEREO)
    observation, info = env.reset(seed=3)
    names = {name: policies.TrackingPolicy(trackers.make("oracle"), camera=name) for name in info["cameras"]}
    assert env.observation_space.contains(observation)
    assert {name: one.shape for name, one in observation["images"].items()} == {
        "right": (120, 160, 3),
        "back": (64, 96, 3),
    }
    assert not np.array_equal(observation["images"]["right"], observation["image"])
    for _ in range(5):
        answer = {name: policy(observation, info) for name, policy in names.items()}
        assert boxes.iou(info["cameras"]["right"]["truth"].box, answer["right"]) == 1.0
        assert info["cameras"]["back"]["truth"].state == "out_of_view"
        assert set(info["cameras"]["right"]) == {"truth", "people", "targets", "detections"}
        assert len(info["cameras"]["right"]["detections"].boxes) >= 1
        observation, *_, info = env.step(info["truth"].box)
    with pytest.raises(UnknownNameError, match="unknown camera 'left'"):
        policies.TrackingPolicy(trackers.make("oracle"), camera="left")(observation, info)
    with pytest.raises(TrackerError, match="to follow 'right', call the policy with"):
        policies.TrackingPolicy(trackers.make("oracle"), camera="right")(observation)
    env.close()


def test_errors_of_detectors_differ_between_cameras_and_are_those_of_each_alone():
    """Of two that stand at one place with one lens."""
    same = {**STEREO, "cameras": [{"name": "right"}], "axes": {"detector": {"severity": 1.0}}}
    found: dict[str, dict[str, list[Any]]] = {}
    for viewed, other in (("camera", "right"), ("right", "camera")):
        env = gym.make("pftrack_sim/Track-v0", scenario=same, overrides={"viewed": viewed}, image=False)
        _, info = env.reset(seed=3)
        found[viewed] = {viewed: [], other: []}
        for _ in range(10):
            assert info["truth"].box.tolist() == info["cameras"][other]["truth"].box.tolist()
            found[viewed][viewed].append(info["detections"].boxes.tolist())
            found[viewed][other].append(info["cameras"][other]["detections"].boxes.tolist())
            *_, info = env.step(np.zeros(4))
        env.close()
    assert found["camera"] == found["right"]
    assert any(found["camera"]["camera"])
    assert found["camera"]["camera"] != found["camera"]["right"]


def test_a_run_scores_trackers_through_each_camera(tmp_path: Path):
    store = run(make_plan([STEREO], ["oracle"], [3], overrides={"duration_s": 0.5}), tmp_path / "run", videos="none")
    results = {one.condition.name: one.values["mean_overlap"] for one in store.results}
    assert list(results) == ["base", "right base", "back base"]
    assert results["base"] == results["right base"] == 1.0


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "two of one name": ({"cameras.1.name": "right"}, "cameras.1.name: 'right' is the name of another camera"),
    "the first one's": ({"cameras.0.name": "camera"}, "cameras.0.name: 'camera' is the name of another camera"),
    "unknown": ({"viewed": "rihgt"}, "viewed: unknown camera 'rihgt'; did you mean 'right'"),
    "unknown key": ({"cameras.0.height_m": 1.0}, "cameras.0.height_m: unknown key"),
    "too small": ({"cameras.0.width_px": 2}, "cameras.0.width_px: got 2"),
    "no file": ({"cameras.0.calibration": "none.yaml"}, "cameras.0.calibration: none.yaml"),
}


@pytest.mark.parametrize("what", WRONG)
def test_mistakes_are_told_when_the_scenario_is_read(what: str):
    change, words = WRONG[what]
    with pytest.raises(ScenarioError) as error:
        scenario.load(STEREO, change)
    assert words in str(error.value)


def test_an_image_of_another_size_than_the_calibration_is_refused_with_its_place(tmp_path: Path):
    (tmp_path / "one.yaml").write_text(ros(LENS))
    with pytest.raises(ScenarioError, match=r"cameras\.0: the calibration is of images of 320 x 240"):
        scenario.load(STEREO, {"cameras.0.calibration": str(tmp_path / "one.yaml"), "cameras.0.width_px": 160})
    with Simulation(scenario.load(STEREO, {"cameras.0.width_px": {"choice": [64, 96]}}), image=False) as simulation:
        simulation.reset(0)
        sizes = {seed: simulation.scenario.resolve(seed).seen_by("right").camera.width_px for seed in range(9)}
        other = next(seed for seed, width in sizes.items() if width != sizes[0])
        with pytest.raises(ScenarioError, match="right: the image size must not change with the seed"):
            simulation.reset(other)
