"""A robot of a file: what is true of the robot that ships is true of it."""

import json
import math
import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import mujoco
import numpy as np
import pytest
from driving import driven
from observing import box_of, mujocos_renderer
from robot_files import EYE, LENS_AT, MJCF, PAN_AT, TILT_AT, URDF, stl, write_mjcf, write_urdf
from scipy.spatial.transform import Rotation

from pftrack_sim import controllers, policies, scenario, trackers
from pftrack_sim.core.data_files import assets_dir
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.core.proprioception import PROPRIO_INDEX, RANGE_M, RANGES
from pftrack_sim.scene.layout import ROBOT_GROUP, body_owners
from pftrack_sim.simulation.simulation import Simulation

QUIET = {
    "distractors.count": 0,
    "duration_s": 12,
    "camera.width_px": 320,
    "camera.height_px": 240,
    "jitter.angular_rms_deg": 0,
    "jitter.translational_rms_mm": 0,
}
WHEELS = {"robot.drive": "differential", "robot.wheels": ["wheel_l", "wheel_r"], "robot.odometry_error_percent": 0}
WRITERS = {"mjcf": write_mjcf, "urdf": write_urdf}


def simulation(file: Path, keys: dict[str, object] | None = None, name: str = "plaza-walk") -> Simulation:
    return Simulation(scenario.load(name, {**QUIET, "robot.model": str(file), **(keys or {})}), image=False)


def turned(axis: int, angle: float) -> np.ndarray:
    return Rotation.from_euler("xyz"[axis], angle).as_matrix()


def reading(world: object, name: str) -> float:
    return float(world.proprio()[PROPRIO_INDEX[name]])


@pytest.mark.parametrize("kind", WRITERS)
def test_the_camera_is_where_the_joints_of_the_file_put_it(kind: str, tmp_path: Path):
    with simulation(WRITERS[kind](tmp_path), WHEELS) as own:
        own.reset(0)
        for command in ([0.5, 0.3, 0.6, -0.4], [0.8, -0.2, -1.0, 0.5], [0.0, 0.5, 0.2, 1.0]):
            for _ in range(15):
                frame = own.advance(np.array(command))
            world = own.world
            x, y, heading = world.robot_pose()
            base = turned(2, heading)
            pan, tilt = (float(world.data.joint(f"robot/{name}").qpos[0]) for name in ("pan", "tilt"))
            assert reading(world, "pan_rad") == pytest.approx(pan, abs=0.02)
            # The joints turn about -z and y: they read the other way round, and tilt up is a turn about -y.
            head = base @ turned(2, pan)
            face = head @ turned(1, -tilt)
            lens = base @ PAN_AT + head @ TILT_AT + face @ LENS_AT + (x, y, 0.0)
            pose = frame.truth.T_world_camera
            np.testing.assert_allclose(pose[:3, 3], lens, atol=1e-5)
            np.testing.assert_allclose(pose[:3, :3], face @ [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], atol=1e-5)
            assert own.settings.camera.height_m == pytest.approx(0.72, abs=1e-6)
            mount = world.robot.drive.camera_mount(pan, tilt)
            np.testing.assert_allclose(base @ mount[:3, 3] + (x, y, 0.0), pose[:3, 3], atol=1e-5)
            np.testing.assert_allclose(base @ mount[:3, :3], pose[:3, :3], atol=1e-5)


@pytest.mark.parametrize("kind", WRITERS)
def test_boxes_are_the_extents_of_the_pixels_that_mujoco_draws(kind: str, tmp_path: Path):
    with simulation(WRITERS[kind](tmp_path)) as own:
        own.reset(3)
        model, compared = own.world.model, 0
        is_target = np.array([one == "target" for one in body_owners(model)])[model.geom_bodyid]
        with mujocos_renderer(model, 320, 240) as renderer:
            for _ in range(12):
                for _ in range(10):
                    truth = own.advance().truth
                ids = renderer.ids(own.world.data, truth.T_world_camera)
                seen = box_of((ids >= 0) & is_target[ids])
                if truth.visible_fraction == 1.0 and truth.truncation == 0.0:
                    compared += 1
                    gaps = truth.box - seen
                    assert np.abs([*gaps[:2], *(gaps[:2] + gaps[2:])]).max() <= 1.0
        assert compared >= 6


def test_what_of_the_robot_is_before_its_camera_occludes_and_its_housing_does_not(tmp_path: Path):
    bar = '<geom type="box" size="0.005 0.3 0.02" pos="0.35 0.03 0.02" contype="0" conaffinity="0"/><camera'
    housing = '<geom type="box" size="0.03 0.03 0.03" pos="0.08 0.03 0.02" contype="0" conaffinity="0"/><camera'
    seen = {}
    for name, text in {
        "bare": MJCF,
        "bar": MJCF.replace("<camera", bar),
        "in it": MJCF.replace("<camera", housing),
    }.items():
        with simulation(write_mjcf(tmp_path, text)) as own:
            truth = own.reset(0).truth
            seen[name] = truth.visible_fraction, truth.occluders
    assert seen["bare"] == seen["in it"] == (1.0, ())
    assert 0.5 < seen["bar"][0] < 0.95
    assert seen["bar"][1] == ("robot",)


@pytest.mark.parametrize(("pose_deg", "angle"), [({}, 0.4), ({"lift": 30.0}, math.radians(30.0))])
def test_parts_that_nothing_moves_hold_the_pose_of_the_keyframe(pose_deg: object, angle: float, tmp_path: Path):
    with simulation(write_mjcf(tmp_path), {"robot.pose_deg": pose_deg}) as own:
        own.reset(0)
        model = own.world.model
        capsule = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_CAPSULE)
        capsule = [geom for geom in capsule if model.geom_group[geom] == ROBOT_GROUP]
        axis = own.world.data.geom_xmat[capsule[0]].reshape(3, 3)[:, 2]
        assert math.acos(axis[2]) == pytest.approx(angle, abs=1e-6)


def test_a_differential_drive_rolls_as_its_wheels_say_and_the_odometry_agrees(tmp_path: Path):
    with simulation(write_mjcf(tmp_path), WHEELS) as own:
        own.reset(0)
        start = np.array(own.world.robot_pose())
        for frame in range(120):
            own.advance(np.array([0.6, 0.4 if frame > 30 else 0.0, 0.3, 0.0]))
        end, world = np.array(own.world.robot_pose()), own.world
        left, right = reading(world, "wheel_left_m_s"), reading(world, "wheel_right_m_s")
        assert right - left == pytest.approx(0.4 * math.radians(90.0) * 0.5, rel=1e-3)
        assert 0.5 * (left + right) == pytest.approx(0.96, rel=1e-3)
        way = turned(2, -start[2])[:2, :2] @ (end - start)[:2]
        odometry = [reading(world, f"odometry_{axis}_m") for axis in "xy"]
        np.testing.assert_allclose(odometry, way, atol=0.02)
        assert np.hypot(*way) > 1.0
        # Sideways it does not move.
        speed = world.data.qvel[:2]
        assert abs(-math.sin(end[2]) * speed[0] + math.cos(end[2]) * speed[1]) < 0.02


CAR = {"robot.drive": "ackermann", "robot.wheelbase_m": 0.5, "robot.odometry_error_percent": 0}


@pytest.mark.parametrize("forward", [0.6, -0.6])
def test_a_car_drives_on_circles_about_its_rear_axle(forward: float, tmp_path: Path):
    with simulation(write_mjcf(tmp_path), {**CAR, "robot.wheels": ["wheel_l", "wheel_r"]}) as own:
        start = np.array((own.reset(0), own.world.robot_pose())[1])
        for _ in range(30):
            own.advance(np.array([0.0, 1.0, 0.0, 0.0]))
        np.testing.assert_allclose(own.world.robot_pose(), start, atol=1e-6)  # it cannot turn where it stands
        poses = []
        for _ in range(150):
            own.advance(np.array([forward, 1.0, 0.0, 0.0]))
            poses.append(own.world.robot_pose())
        x, y, heading = np.array(poses[30:]).T
        turns = np.diff(np.unwrap(heading))
        radius = np.hypot(np.diff(x), np.diff(y)) / (2.0 * np.sin(0.5 * turns))
        np.testing.assert_allclose(radius, 0.5 / math.tan(math.radians(24.0)), rtol=2e-3)  # counter-clockwise
        middle = np.unwrap(heading)[:-1] + 0.5 * turns
        assert np.abs(np.diff(y) * np.cos(middle) - np.diff(x) * np.sin(middle)).max() < 0.02 / 30
        way = turned(2, -start[2])[:2, :2] @ (np.array(poses[-1]) - start)[:2]
        odometry = [reading(own.world, f"odometry_{axis}_m") for axis in "xy"]
        np.testing.assert_allclose(odometry, way, atol=0.01 * 4.8)  # of the way: the servos lag by half a degree


def test_nothing_of_it_rubs_on_the_ground(tmp_path: Path):
    square = MJCF.replace('<geom size="0.15"/>', '<geom type="box" size="0.15 0.02 0.15"/>').replace(
        '<geom type="sphere" size="0.15"/>', '<geom type="box" size="0.15 0.02 0.15"/>'
    )
    with simulation(write_mjcf(tmp_path, square), {"robot.wheels": ["wheel_l", "wheel_r"]}) as own:
        own.reset(0)
        for _ in range(60):
            own.advance(np.array([0.5, 0.0, 0.0, 0.0]))
        assert np.hypot(*own.world.data.qvel[:2]) == pytest.approx(0.8, abs=1e-3)


def headless(text: str) -> str:
    return (
        text.replace(" 0 0 0 0 0.4", " 0 0 0.4")
        .replace('<joint name="neck_pan" axis="0 0 -1" range="-100 100"/>', "")
        .replace('<joint name="neck_tilt" axis="0 1 0" range="-40 30"/>', "")
    )


@pytest.mark.parametrize("drive", ["omni", "differential"])
def test_a_robot_without_a_head_turns_its_body_or_its_base(drive: str, tmp_path: Path):
    with simulation(write_mjcf(tmp_path, headless(MJCF)), {"robot.drive": drive}) as own:
        gaze = own.reset(0).truth.T_world_camera[:3, 2]
        course = own.world.robot_pose()[2]
        for _ in range(30):
            after = own.advance(np.array([0.0, 0.0, 0.5, 0.5])).truth.T_world_camera[:3, 2]
        turn = math.atan2(gaze[0] * after[1] - gaze[1] * after[0], gaze[0] * after[0] + gaze[1] * after[1])
        assert 0.5 < turn < 0.9
        assert after[2] == pytest.approx(0.0, abs=1e-5)
        turned_base = math.remainder(own.world.robot_pose()[2] - course, 2.0 * math.pi)
        assert turned_base == pytest.approx(turn if drive == "differential" else 0.0, abs=1e-3)


def test_ranges_and_collisions_are_those_of_the_scene(tmp_path: Path):
    keys = {"robot.route": {"kind": "still", "start_m": [0, 0], "heading_deg": 90}, "target.path_m": [[4, 0], [9, 0]]}
    with simulation(write_mjcf(tmp_path), keys, "easy/corridor") as own:
        own.reset(0)
        ranges = own.world.proprio()[RANGES]
        assert (ranges < RANGE_M).any()
        touched, places = None, []
        for _ in range(120):
            own.advance(np.array([1.0, 0.0, 0.0, 0.0]))
            touched = touched or own.collision()
            places.append(own.world.robot_pose()[:2])
        assert touched is not None
        assert np.ptp(np.array(places)[-20:], axis=0).max() < 0.05


@pytest.mark.parametrize("route", ["trail", "beside", "waypoints", "still"])
@pytest.mark.parametrize("drive", [{}, CAR])
def test_the_script_drives_it_and_the_dry_run_knows_where(route: str, drive: dict[str, object], tmp_path: Path):
    routes: dict[str, dict[str, object]] = {
        "trail": {"kind": "trail"},
        "beside": {"kind": "beside", "side": "left"},
        "waypoints": {"kind": "waypoints", "points_m": [[-3, 0], [4, 0]]},
        "still": {"kind": "still", "start_m": [-3, 0]},
    }
    keys: dict[str, object] = {"robot.route": routes[route], "duration_s": 6, **drive}
    with simulation(write_mjcf(tmp_path), keys, "easy/plaza-walk") as own:
        frames = [own.reset(0)]
        while frames[-1].index < own.frame_count - 1:
            frames.append(own.advance())
        assert np.mean([frame.truth.state == "visible" for frame in frames]) > 0.9
        assert own.collision() is None


@pytest.mark.parametrize("drive", [{}, CAR])
def test_a_minute_is_followed_by_box_and_command(drive: dict[str, object], tmp_path: Path):
    overrides = {**QUIET, "robot.model": str(write_urdf(tmp_path)), "duration_s": 20, "target.actions": [], **drive}
    policy = policies.FollowPolicy(trackers.make("oracle"), controllers.make("servo-avoid"))
    infos = driven("follow/plaza", overrides, policy, 0)
    assert infos[-1]["outcome"] == "finished"
    assert np.mean([info["reward"] for info in infos]) > 0.8


def edited(old: str, new: str) -> Callable[[str], str]:
    return lambda text: text.replace(old, new)


WRONG: dict[str, tuple[str, Callable[[str], str], dict[str, object], str]] = {
    "no camera": ("mjcf", edited(EYE, ""), {}, r"camera_site: .*no camera.*neck"),
    "unknown site": ("mjcf", str, {"robot.camera_site": "eyes"}, r"camera_site: .*'eyes'; did you mean 'eye'"),
    "on its side": ("mjcf", edited("0 -1 0 0 0 1", "0 0 1 0 1 0"), {}, r"not be up.*camera_rpy_deg = \[-?90, 0, 0\]"),
    "unknown joint": ("mjcf", str, {"robot.pan": "neck_pam"}, r"robot.pan: 'neck_pam'.*did you mean 'neck_pan'"),
    "wrong axis": ("mjcf", str, {"robot.tilt": "neck_pan", "robot.pan": "none"}, r"robot.tilt: .*not lateral"),
    "unknown wheel": ("mjcf", str, {"robot.wheels": ["wheel_l", "wheel"]}, r"wheels: 'wheel'.*did you mean 'wheel_"),
    "no wheels": ("mjcf", str, {"robot.wheels": ["wheel_l", "wheel_l"]}, r"robot.wheels: .* 0 m apart"),
    "unknown pose": ("mjcf", str, {"robot.pose_deg": {"lifts": 3}}, r"pose_deg: 'lifts'.*did you mean 'lift'"),
    "millimetres": ("mjcf", edited('"0.01 0.01 0.2"', '"10 10 200"'), {}, r"high.*millimetres\?"),
    "xacro": ("urdf", edited('link name="face"', 'xacro:face a=""'), {}, r"holds xacro: expand it"),
    "missing mesh": ("urdf", edited("body.dae", "torso.dae"), {}, r"no mesh 'package://cart_desc.*torso"),
    "no XML": ("mjcf", lambda _: "a: 1", {}, r"neither MJCF nor URDF"),
    "SDF": ("mjcf", lambda _: "<sdf version='1.6'/>", {}, r"takes MJCF .* or URDF .*, got <sdf>"),
    "wrong element": ("mjcf", edited("freejoint", "freejiont"), {}, r"cannot be compiled: .*freejiont"),
    "no tilt": ("mjcf", headless, {"camera.tilt_deg": 10}, r"camera.tilt_deg: no joint"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_with_a_file_is_one_message(case: str, tmp_path: Path):
    kind, edit, keys, message = WRONG[case]
    file = WRITERS[kind](tmp_path, edit(MJCF if kind == "mjcf" else URDF))
    loaded = scenario.load("plaza-walk", {**QUIET, "robot.model": str(file), **keys})
    with Simulation(loaded, image=False) as own, pytest.raises(ScenarioError, match=message) as caught:
        own.reset(0)
    assert len(caught.value.problems) == 1


@pytest.mark.parametrize("axes", ["0 0 1 0 1 0", "0 1 0 0 0 -1", "1 0 0 0 1 0"])
def test_a_camera_that_lies_on_its_side_looks_ahead_as_the_message_says(axes: str, tmp_path: Path):
    with simulation(write_mjcf(tmp_path)) as own:
        wanted = own.reset(0).truth.T_world_camera
    file = write_mjcf(tmp_path, MJCF.replace("0 -1 0 0 0 1", axes))
    with simulation(file) as own, pytest.raises(ScenarioError) as caught:
        own.reset(0)
    turn = json.loads(re.search(r"camera_rpy_deg = (\[.*?\])", str(caught.value))[1])
    with simulation(file, {"robot.camera_rpy_deg": turn}) as own:
        np.testing.assert_allclose(own.reset(0).truth.T_world_camera, wanted, atol=1e-6)


def test_links_are_listed_from_above(tmp_path: Path):
    """Cameras are mostly there, and a long list is cut."""
    with simulation(write_mjcf(tmp_path, MJCF.replace(EYE, ""))) as own, pytest.raises(ScenarioError) as caught:
        own.reset(0)
    assert "(it has: face, neck, " in str(caught.value)


def test_the_robot_that_ships_is_a_file_like_any_other(tmp_path: Path):
    text = (assets_dir() / "robot.xml").read_text()
    copy, heavy = tmp_path / "copy.xml", tmp_path / "heavy.xml"
    copy.write_text(text)
    heavy.write_text(text.replace('mass="9"', 'mass="19"').replace('pos="0 0.19 ', 'pos="0 0.22 '))
    poses, sensed, levels = [], [], []
    for keys in (
        {},
        {"robot.model": str(copy), "robot.drive": "motors"},
        {"robot.model": str(heavy), "robot.drive": "motors"},
    ):
        with Simulation(scenario.load("plaza-walk", {**QUIET, **keys}), image=False) as own:
            levels.append(own.reset(0).truth.T_world_camera[2, 3])
            for _ in range(45):
                pose = own.advance(np.array([0.6, 0.3, 0.2, 0.1])).truth.T_world_camera
            poses.append(pose.tobytes())
            sensed.append(own.world.proprio().tobytes())
            track_m = own.world.robot.drive.track_m
    assert poses[0] == poses[1] != poses[2]
    assert sensed[0] == sensed[1]
    assert np.ptp(levels) < 1e-3  # its springs carry ten kilograms more, level
    assert track_m == pytest.approx(0.41)


@pytest.mark.parametrize(
    ("old", "new", "keys", "message"),
    [
        ('<joint name="tilt"', '<joint name="nod"', {}, r"cannot be compiled|lacks joint 'tilt'"),
        ('<camera name="camera"', '<camera name="eye"', {}, r"names of our own robot's file; it lacks camera 'camera'"),
        ('user="0.2"', 'user="0.1"', {}, r"share of the sprung weight, together 1"),
        ('<freejoint name="free"/>', "", {}, r"needs a free joint of 'base'"),
        ("", "", {"robot.pan": "pan"}, r"pan: has no effect with drive = 'motors'"),
    ],
)
def test_a_file_with_motors_that_lacks_something_is_one_message(old, new, keys, message, tmp_path: Path):
    file = tmp_path / "mine.xml"
    file.write_text((assets_dir() / "robot.xml").read_text().replace(old, new))
    wanted = {**QUIET, "robot.model": str(file), "robot.drive": "motors", **keys}
    with (
        pytest.raises(ScenarioError, match=message),
        Simulation(scenario.load("plaza-walk", wanted), image=False) as own,
    ):
        own.reset(0)


def test_a_mesh_of_millions_of_triangles_is_refused_before_it_is_compiled(tmp_path: Path):
    file = write_urdf(tmp_path)
    (file.parent / "meshes" / "body.stl").write_bytes(bytes(84 + 50 * 1_000_000))
    with simulation(file) as own, pytest.raises(ScenarioError, match=r"500,000 triangles .*body-1.stl alone 1,000,000"):
        own.reset(0)


def test_a_flat_mesh_can_be_drawn(tmp_path: Path):
    file = write_urdf(tmp_path)
    (file.parent / "meshes" / "body.stl").write_bytes(stl((0.02, 0.02, 0.0)))
    with simulation(file) as own:
        own.reset(0)


def test_keys_about_a_file_need_one_that_is_there(tmp_path: Path):
    with pytest.raises(ScenarioError, match=r"pan, tilt: .*set robot.model"):
        scenario.load("plaza-walk", {"robot.pan": "a", "robot.tilt": "b"})
    with pytest.raises(ScenarioError, match=r"'ackermann' and wheelbase_m, .*, go together"):
        scenario.load("plaza-walk", {"robot.model": str(write_mjcf(tmp_path)), "robot.drive": "ackermann"})
    (tmp_path / "cart.xml").unlink()
    with pytest.raises(ScenarioError, match=r"robot.model: no such file: .*cart.xml"):
        scenario.load("plaza-walk", {"robot.model": str(tmp_path / "cart.xml")})


def test_the_path_is_relative_to_the_scenario_that_names_it(tmp_path: Path):
    write_mjcf(tmp_path)
    (tmp_path / "cart.toml").write_text('extends = "plaza-walk"\n[robot]\nmodel = "cart.xml"\n')
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "fast.toml").write_text('extends = "../cart.toml"\n[robot]\nmax_speed_m_s = 2.0\n')
    first, second = (scenario.load(tmp_path / name).resolve(0).robot for name in ("cart.toml", "below/fast.toml"))
    assert first.model == second.model == str(tmp_path / "cart.xml")
    before = first.model_digest
    write_mjcf(tmp_path, MJCF.replace("0.3 0.2 0.1", "0.3 0.2 0.12"))
    assert scenario.load(tmp_path / "cart.toml").resolve(0).robot.model_digest != before


class Menagerie(ModuleType):
    """What `mujoco_menagerie` offers of one robot; without a network the second one cannot be had."""

    class MenagerieError(Exception):
        pass

    default_model = "cart"

    def __init__(self, folder: Path) -> None:
        super().__init__("mujoco_menagerie")
        self._folder = folder

    def names(self) -> list[str]:
        return ["test_cart", "test_dog"]

    def get(self, name: str) -> "Menagerie":
        self._name = name
        return self

    def xml(self, entry: str) -> Path:
        if self._name == "test_dog":
            raise self.MenagerieError("no route to host")
        return self._folder / f"{entry}.xml"


def test_robots_of_the_menagerie_are_found_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    write_mjcf(tmp_path)
    monkeypatch.setitem(sys.modules, "mujoco_menagerie", Menagerie(tmp_path))
    with simulation(Path("menagerie:test_cart")) as own:
        own.reset(0)
        assert own.settings.camera.height_m == pytest.approx(0.72, abs=1e-6)
    wrong = {
        "test_cat": r"no such robot; did you mean 'test_cart'",
        "test_dog": "cannot be downloaded: no route to host",
    }
    for name, message in wrong.items():
        with simulation(Path(f"menagerie:{name}")) as own, pytest.raises(ScenarioError, match=message):
            own.reset(0)
    monkeypatch.setitem(sys.modules, "mujoco_menagerie", None)
    with simulation(Path("menagerie:test_bird")) as own, pytest.raises(ScenarioError, match=r"pip install .*menagerie"):
        own.reset(0)
