"""Logs are read back with the official readers: types, counts and values."""

import math
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pftrack_sim.benchmark import run
from pftrack_sim.benchmark.asked.from_names import make_plan
from pftrack_sim.core.errors import ParameterError, RunError, SequenceError, UnknownNameError
from pftrack_sim.core.proprioception import PROPRIO_INDEX, RANGE_ANGLES_RAD, RANGE_M, RANGES
from pftrack_sim.core.records import Estimate, Frame, Truth
from pftrack_sim.core.ros2_messages import type_store
from pftrack_sim.formats import read_sequence
from pftrack_sim.logs import LogFrame, LogInfo, check_formats, log_format, log_writer
from pftrack_sim.logs.ros2 import OdometryCovariance
from tests.benchmark.small import SMALL

RATE_HZ, COUNT = 10.0, 6
SIDE = np.array([[0.8, 0.0, -0.6, -0.1], [0.0, 1.0, 0.0, 0.0], [0.6, 0.0, 0.8, 0.0], [0.0, 0.0, 0.0, 1.0]])
INFO = LogInfo("walk seed 3", RATE_HZ, ("stay", "ko2012[alpha=0.3]"), (1.5, 2.0, 3.0, 1.0), 0.01, (0.1, 0.0), SIDE)
K = np.array([[50.0, 0.0, 24.0], [0.0, 50.0, 16.0], [0.0, 0.0, 1.0]])
T_CAMERA = np.array([[0.0, 0.0, 1.0, 2.0], [-1.0, 0.0, 0.0, 3.0], [0.0, -1.0, 0.0, 1.2], [0.0, 0.0, 0.0, 1.0]])


class Robot:
    """Its camera pans and tilts about a point 1.2 m above the middle of the axle."""

    track_m, range_m, beams_rad = 0.4, RANGE_M, RANGE_ANGLES_RAD

    def camera_mount(self, pan_rad: float, tilt_rad: float) -> np.ndarray:
        mount = np.eye(4)
        ahead = Rotation.from_euler("zy", [pan_rad, -tilt_rad]).as_matrix()
        mount[:3, :3], mount[2, 3] = ahead @ [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], 1.2
        return mount


def truth(name: str, index: int, box: Any, state: Any = "visible") -> Truth:
    target = np.eye(4)
    target[:3, 3] = 5.0 + index, 1.0, 0.0
    return Truth(
        name, box, box, box, box, 0.75, 0.0, state, (), 4.0, T_CAMERA, target, K, np.arange(5) / 100, index / RATE_HZ,
        0.0, 0.5,
    )  # fmt: skip


@pytest.fixture(scope="module")
def frames() -> list[LogFrame]:
    rng = np.random.default_rng(0)
    made = []
    for index in range(COUNT):
        image = np.kron(rng.integers(0, 256, (2, 3, 3), dtype=np.uint8), np.ones((16, 16, 1), np.uint8))
        hidden = index == 2
        box = [0.0] * 4 if hidden else [10.25 + index, 4.5, 8.0, 20.0]
        target = truth("target", index, box, "out_of_view" if hidden else "visible")
        people = (target, truth("distractor-1", index, [30.0, 5.0, 6.0, 18.0]))
        proprio = rng.uniform(0.0, 1.0, len(PROPRIO_INDEX) + 36)[: len(PROPRIO_INDEX)]
        proprio[RANGES] = np.linspace(1.0, RANGE_M, 37)
        estimates = {"stay": Estimate([10.25, 4.5, 8.0, 20.0], 0.5), "ko2012[alpha=0.3]": None}
        ms = {"stay": 1.5 + index, "ko2012[alpha=0.3]": 0.0}
        frame = Frame(index, index / RATE_HZ, image, target, people)
        pose, command = (index, 2.0, math.pi / 2), np.array([0.5, -0.25, 0.5, -1.0])
        made.append(LogFrame(frame, pose, proprio, Robot(), estimates, ms, command))
    return made


def write(frames: list[LogFrame], path: Path) -> Path:
    with log_writer(log_format(path), path, INFO) as add:
        for frame in frames:
            add(frame)
    return path


@pytest.fixture(scope="module")
def bag(frames: list[LogFrame], tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("mcap_ros2")
    return write(frames, tmp_path_factory.mktemp("logs") / "walk.mcap")


def messages(path: Path) -> dict[str, list[tuple[str, int, Any]]]:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    found: dict[str, list[tuple[str, int, Any]]] = {}
    with path.open("rb") as opened:
        for schema, channel, message, decoded in make_reader(
            opened, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            assert schema is not None
            found.setdefault(channel.topic, []).append((schema.name, message.log_time, decoded))
    return found


def test_every_topic_has_its_type_and_a_message_per_frame(bag: Path):
    found = messages(bag)
    assert {topic: kinds[0][0] for topic, kinds in found.items()} == {
        "/camera/image/compressed": "sensor_msgs/msg/CompressedImage",
        "/camera/camera_info": "sensor_msgs/msg/CameraInfo",
        "/truth": "vision_msgs/msg/Detection2DArray",
        "/trackers/stay": "vision_msgs/msg/Detection2DArray",
        "/trackers/ko2012_alpha_0_3": "vision_msgs/msg/Detection2DArray",
        "/clock": "rosgraph_msgs/msg/Clock",
        "/odom": "nav_msgs/msg/Odometry",
        "/imu": "sensor_msgs/msg/Imu",
        "/scan": "sensor_msgs/msg/LaserScan",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/tf_static": "tf2_msgs/msg/TFMessage",
        "/joint_states": "sensor_msgs/msg/JointState",
        "/cmd_vel": "geometry_msgs/msg/Twist",
        "/head_velocity_controller/commands": "std_msgs/msg/Float64MultiArray",
    }
    assert len(found.pop("/tf_static")) == 1
    for kinds in found.values():
        assert [time_ns for _, time_ns, _ in kinds] == [index * 10**8 for index in range(COUNT)]


def test_messages_hold_the_values_in_ros_conventions(bag: Path, frames: list[LogFrame]):
    found = {topic: [one for _, _, one in kinds] for topic, kinds in messages(bag).items()}
    info = found["/camera/camera_info"][1]
    assert (info.width, info.height, list(info.d)) == (48, 32, [0.0, 0.01, 0.02, 0.03, 0.04])
    assert list(info.k) == [50.0, 0.0, 23.5, 0.0, 50.0, 15.5, 0.0, 0.0, 1.0]
    target, other = found["/truth"][1].detections
    assert (target.id, other.id, target.results[0].hypothesis.score) == ("target", "distractor-1", 0.75)
    centre = target.bbox.center.position
    assert (centre.x, centre.y, target.bbox.size_x, target.bbox.size_y) == (14.75, 14.0, 8.0, 20.0)
    assert [one.id for one in found["/truth"][2].detections] == ["distractor-1"]
    assert found["/trackers/stay"][0].detections[0].results[0].hypothesis.score == 0.5
    assert not found["/trackers/ko2012_alpha_0_3"][0].detections
    twist = found["/cmd_vel"][0]
    assert (twist.linear.x, twist.angular.z) == (0.75, -0.5)
    scan = found["/scan"][0]
    assert abs(scan.angle_min + (len(scan.ranges) - 1) * scan.angle_increment - scan.angle_max) < 1e-6
    assert (scan.ranges[0], scan.ranges[-1]) == (1.0, math.inf)
    odometry, proprio = found["/odom"][3], frames[3].proprio
    assert found["/imu"][3].angular_velocity.z == proprio[PROPRIO_INDEX["gyro_z_rad_s"]]
    assert found["/imu"][3].linear_acceleration.x == proprio[PROPRIO_INDEX["accelerometer_x_m_s2"]]
    assert found["/imu"][3].orientation_covariance[0] == -1.0
    position = odometry.pose.pose.position
    assert [position.x, position.y] == proprio[:2].tolist()
    heading = 2.0 * math.atan2(odometry.pose.pose.orientation.z, odometry.pose.pose.orientation.w)
    assert abs(heading - proprio[2]) < 1e-12
    assert found["/clock"][3].clock.nanosec == 300_000_000
    joints = found["/joint_states"][3]
    assert dict(zip(joints.name, joints.position, strict=True)) == {
        name: proprio[PROPRIO_INDEX[f"{name}_rad"]] for name in ("pan", "tilt")
    }
    assert list(found["/head_velocity_controller/commands"][0].data) == [1.5, -1.0]
    assert found["/imu"][3].angular_velocity_covariance[0] == pytest.approx(0.01)
    speeds = np.array(odometry.twist.covariance).reshape(6, 6)
    assert speeds[5, 5] == pytest.approx(0.01), "the turn rate is the gyroscope's"
    assert speeds[0, 0] == pytest.approx(max(0.5 * (0.01 * odometry.twist.twist.linear.x) ** 2, 1e-6))
    assert np.diag(np.array(odometry.pose.covariance).reshape(6, 6))[2] == 1e6, "z is not measured"
    assert found["/imu"][3].linear_acceleration_covariance[0] == 1e-6, "0 would mean unknown"


def pose_in(transforms: dict[str, Any], frame: str, root: str) -> np.ndarray:
    """`(4, 4)` pose of a frame in one above it."""
    pose = np.eye(4)
    while frame != root:
        one = transforms[frame]
        step, (t, q) = np.eye(4), (one.transform.translation, one.transform.rotation)
        step[:3, :3], step[:3, 3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix(), (t.x, t.y, t.z)
        pose, frame = step @ pose, one.header.frame_id
    return pose


def test_frames_are_those_of_rep_105_and_the_truth_has_a_tree_of_its_own(bag: Path, frames: list[LogFrame]):
    found = {topic: [one for _, _, one in kinds] for topic, kinds in messages(bag).items()}
    fixed = {one.child_frame_id: one for one in found["/tf_static"][0].transforms}
    named = {one.header.frame_id for topic in ("/imu", "/scan", "/odom", "/camera/camera_info") for one in found[topic]}
    for log, message in zip(frames, found["/tf"], strict=True):
        children = [one.child_frame_id for one in (*message.transforms, *fixed.values())]
        assert len(children) == len(set(children)), "every frame has one parent"
        tree = fixed | {one.child_frame_id: one for one in message.transforms}
        above = {child: one.header.frame_id for child, one in tree.items()}
        assert (above["odom"], above["base_footprint"], above["base_link"]) == ("map", "odom", "base_footprint")
        assert set(above.values()) - set(above) == {"map", "world"}, "two trees, each with one root"
        assert all(parent == "world" for child, parent in above.items() if child.startswith("truth/"))
        assert {*named, "base_footprint"} <= {*above, "map"}
        base = pose_in(tree, "base_footprint", "map")
        np.testing.assert_allclose(base, pose_in(tree, "truth/base_footprint", "world"), atol=1e-9)
        np.testing.assert_allclose(base[:2, 3], log.robot_pose[:2], atol=1e-9)
        odometry = pose_in(tree, "base_footprint", "odom")
        np.testing.assert_allclose(odometry[:2, 3], log.proprio[:2], atol=1e-12)
        camera = pose_in(tree, "camera_optical_frame", "base_link")
        head = [log.proprio[PROPRIO_INDEX[name]] for name in ("pan_rad", "tilt_rad")]
        np.testing.assert_allclose(camera, Robot().camera_mount(*head) @ SIDE, atol=1e-9)
        link = pose_in(tree, "camera_link", "base_link")
        np.testing.assert_allclose(link[:3, 0], camera[:3, 2], atol=1e-9, err_msg="x of a link is ahead (REP 103)")
        truth_of_camera = pose_in(tree, "truth/camera_optical_frame", "world")
        np.testing.assert_allclose(truth_of_camera, T_CAMERA, atol=1e-9)
        assert pose_in(tree, "truth/target", "world")[0, 3] == 5.0 + log.frame.index


def test_the_covariance_of_the_odometry_is_that_of_robots_with_wrong_wheels():
    rng = np.random.default_rng(4)
    wheels = np.stack([0.02 + 0.006 * np.sin(np.arange(400) / 40), 0.02 + 0.006 * np.cos(np.arange(400) / 55)], axis=1)
    error, track_m, count = 0.005, 0.4, 4000
    left, right, track = 1.0 + error * rng.standard_normal((3, count))
    poses, pose = np.zeros((3, count)), np.zeros(3)
    covariance = OdometryCovariance(track_m, error)
    predicted = covariance.at(0.0, 0.0, 0.0)
    for a, b in wheels:
        for p, (one, two, wide) in ((poses, (left, right, track)), (pose, (1.0, 1.0, 1.0))):
            way, turn = 0.5 * (a * one + b * two), (b * two - a * one) / (track_m * wide)
            p[0] += way * np.cos(p[2] + 0.5 * turn)
            p[1] += way * np.sin(p[2] + 0.5 * turn)
            p[2] += turn
        predicted = covariance.at(pose[0], pose[1], math.remainder(pose[2], math.tau))
    assert np.hypot(*pose[:2]) > 3.0
    sampled = np.cov(poses)
    np.testing.assert_allclose(np.sqrt(np.diag(predicted)), np.sqrt(np.diag(sampled)), rtol=0.06)
    correlation = sampled / np.sqrt(np.outer(np.diag(sampled), np.diag(sampled)))
    np.testing.assert_allclose(
        predicted / np.sqrt(np.outer(np.diag(predicted), np.diag(predicted))), correlation, atol=0.06
    )


def test_a_log_is_read_as_a_sequence(bag: Path, frames: list[LogFrame], tmp_path: Path):
    read = read_sequence(bag)
    assert (read.name, len(read)) == ("walk", COUNT)
    assert abs(read.rate_hz - RATE_HZ) < 1e-9
    for index, log in enumerate(frames):
        box = log.frame.truth.box
        assert np.isnan(read.truth[index]).all() if box[2] == 0 else abs(read.truth[index] - box).max() < 1e-9
        difference = read.image(index).astype(float) - log.frame.image
        assert abs(difference).mean() < 6.0  # JPEG
    assert abs(read_sequence(bag, topics=["/trackers/stay"]).truth[5] - [10.25, 4.5, 8.0, 20.0]).max() < 1e-9
    (tmp_path / "metadata.yaml").write_text("")
    with pytest.raises(SequenceError, match="is no ROS 2 bag, or it is damaged"):
        read_sequence(tmp_path)


def write_bag(
    path: Path, numbers: range, version: Any, plugin: str, mode: str = "NONE", encoding: str = "rgb8", padding: int = 0
) -> np.ndarray:
    """Raw images and boxes, one each for a number, as `rosbags` writes them; all images up to the last number."""
    rosbag2: Any = pytest.importorskip("rosbags.rosbag2")
    store = type_store()
    kinds, names = store.types, {"/image": "sensor_msgs/msg/Image", "/boxes": "vision_msgs/msg/Detection2DArray"}
    pixels = np.random.default_rng(0).integers(0, 256, (numbers.stop, 12, 16, 3), dtype=np.uint8)
    bag = rosbag2.Writer(path, version=version, storage_plugin=rosbag2.StoragePlugin[plugin])
    bag.set_compression(rosbag2.CompressionMode[mode], rosbag2.CompressionFormat.ZSTD)
    with bag as written:
        topics = {name: written.add_connection(name, kind, typestore=store) for name, kind in names.items()}
        for number in numbers:
            header = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](0, number * 10**8), "camera")
            rows = np.pad(encoded(pixels[number], encoding).reshape(12, -1), ((0, 0), (0, max(padding, 0))))
            image = kinds[names["/image"]](header, 12, 16, encoding, 0, rows.shape[1] + min(padding, 0), rows.ravel())
            centre = kinds["vision_msgs/msg/Pose2D"](kinds["vision_msgs/msg/Point2D"](4.5 + number, 5.5), 0.0)
            box = kinds["vision_msgs/msg/BoundingBox2D"](centre, 4.0, 6.0)
            found = kinds["vision_msgs/msg/Detection2D"](header, [], box, "target")
            boxes = kinds[names["/boxes"]](header, [found])
            for name, message in (("/image", image), ("/boxes", boxes)):
                content = store.serialize_cdr(message, names[name])
                written.write(topics[name], 10**9 + number * 10**8, content)
    return pixels


def encoded(pixels: np.ndarray, encoding: str) -> np.ndarray:
    """Pixels in the order of channels of an encoding, with an opacity where it has one."""
    if encoding == "mono8":
        return pixels[:, :, 0]
    ordered = pixels if encoding.startswith("rgb") else pixels[:, :, ::-1]
    return np.pad(ordered, ((0, 0), (0, 0), (0, 1)), constant_values=255) if "a" in encoding else ordered


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "rgba8", "bgra8", "mono8"])
def test_raw_images_are_read_in_each_encoding_with_rows_of_any_length(tmp_path: Path, encoding: str):
    pixels = write_bag(tmp_path / "bag", range(2), 9, "MCAP", encoding=encoding, padding=8)
    shown = np.repeat(pixels[:, :, :, :1], 3, 3) if encoding == "mono8" else pixels
    check_bag(tmp_path / "bag", shown)


@pytest.mark.parametrize(
    ("encoding", "padding", "words"),
    [
        ("rgb16", 0, "images must be rgb8, bgr8, rgba8, bgra8, mono8, got 'rgb16'"),
        ("rgb8", -1, "an image of 16 x 12 pixels of rgb8 has 576 bytes, 47 a row"),
    ],
)
def test_a_raw_image_that_cannot_be_read_says_why(tmp_path: Path, encoding: str, padding: int, words: str):
    write_bag(tmp_path / "bag", range(1), 9, "MCAP", encoding=encoding, padding=padding)
    with pytest.raises(SequenceError, match=words):
        read_sequence(tmp_path / "bag").image(0)


def check_bag(path: Path, pixels: np.ndarray) -> None:
    read = read_sequence(path)
    np.testing.assert_array_equal(read.truth, [[3.0 + number, 3.0, 4.0, 6.0] for number in range(len(pixels))])
    assert read.rate_hz == pytest.approx(10.0)
    for number in (*range(len(pixels)), *reversed(range(len(pixels)))):
        np.testing.assert_array_equal(read.image(number), pixels[number])


@pytest.mark.parametrize("version", [8, 9])
@pytest.mark.parametrize(
    ("plugin", "mode"),
    [("SQLITE3", "NONE"), ("SQLITE3", "MESSAGE"), ("SQLITE3", "FILE"), ("MCAP", "FILE"), ("MCAP", "STORAGE")],
)
def test_a_bag_folder_is_read_whatever_its_storage_and_compression(
    tmp_path: Path, version: int, plugin: str, mode: str
):
    """In the format of Humble (8) and with definitions (9)."""
    check_bag(tmp_path / "bag", write_bag(tmp_path / "bag", range(3), version, plugin, mode))


def test_a_bag_file_in_sqlite_is_read_without_its_folder_and_damage_is_one_clear_error(tmp_path: Path):
    pixels = write_bag(tmp_path / "bag", range(3), 8, "SQLITE3")
    (path,) = (tmp_path / "bag").glob("*.db3")
    (tmp_path / "bag/metadata.yaml").unlink()
    check_bag(path, pixels)
    assert [one.name for one in (tmp_path / "bag").iterdir()] == [path.name]
    whole = path.read_bytes()
    for content in (b"", b"text" * 300, whole[: len(whole) // 2]):
        path.write_bytes(content)
        with pytest.raises(SequenceError, match=r"is no ROS 2 bag, or it is damaged: \w+"):
            [read_sequence(path).image(index) for index in range(3)]
    for change, words in (
        ("UPDATE messages SET data = substr(data, 1, 30)", "damaged"),
        ("DELETE FROM messages", "no image on /image"),
        ("DELETE FROM topics", "needs one image topic"),
    ):
        path.write_bytes(whole)
        with closing(sqlite3.connect(path)) as database, database:
            database.execute(change)
        with pytest.raises(SequenceError, match=words):
            read_sequence(path)


def test_a_raw_image_with_too_many_pixels_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    write_bag(tmp_path / "bag", range(1), 9, "MCAP")
    monkeypatch.setattr("pftrack_sim.core.image_files.MAX_PIXELS", 12 * 16 - 1)
    with pytest.raises(SequenceError, match="has 16 x 12 pixels: images have 1 to 191 pixels"):
        read_sequence(tmp_path / "bag").image(0)


@pytest.mark.parametrize("mode", ["NONE", "MESSAGE", "FILE"])
@pytest.mark.parametrize("plugin", ["SQLITE3", "MCAP"])
def test_a_bag_of_several_files_is_one_sequence(tmp_path: Path, plugin: str, mode: str):
    """Files of one bag, as recorders split them by size or time."""
    yaml = pytest.importorskip("ruamel.yaml").YAML()
    parts = [tmp_path / "bag", tmp_path / "more"]
    for part, numbers in zip(parts, (range(3), range(3, 5)), strict=True):
        pixels = write_bag(part, numbers, 9, plugin, mode)
    about = [yaml.load(part / "metadata.yaml")["rosbag2_bagfile_information"] for part in parts]
    about[0]["relative_file_paths"] += about[1]["relative_file_paths"]
    about[0]["message_count"] += about[1]["message_count"]
    about[0]["duration"]["nanoseconds"] = 4 * 10**8
    for here, there in zip(*(one["topics_with_message_count"] for one in about), strict=True):
        here["message_count"] += there["message_count"]
    (file,) = about[1]["relative_file_paths"]
    (parts[1] / file).rename(parts[0] / file)
    yaml.dump({"rosbag2_bagfile_information": about[0]}, parts[0] / "metadata.yaml")
    check_bag(parts[0], pixels)
    (parts[0] / file).unlink()
    with pytest.raises(SequenceError, match="is no ROS 2 bag, or it is damaged"):
        read_sequence(parts[0])


@pytest.mark.parametrize(
    ("topics", "words"),
    [
        (["/nowhere"], "no topic /nowhere"),
        (["/truth", "/trackers/stay"], "needs one box topic .*; see --topics"),
        (["/trackers/ko2012_alpha_0_3"], "no frame has a box"),
    ],
)
def test_a_wrong_topic_is_one_clear_error(bag: Path, topics: list[str], words: str):
    with pytest.raises(SequenceError, match=words):
        read_sequence(bag, topics=topics)


def test_a_damaged_file_is_one_clear_error(bag: Path, tmp_path: Path):
    whole = bag.read_bytes()
    flipped = bytearray(whole)
    flipped[2000] ^= 255  # within the only chunk
    for content in (b"", b"text", whole[: len(whole) // 2], whole[:40], bytes(flipped)):
        (tmp_path / "damaged.mcap").write_bytes(content)
        with pytest.raises(SequenceError, match="damaged"):
            [read_sequence(tmp_path / "damaged.mcap").image(index) for index in range(COUNT)]


def test_a_rerun_recording_has_every_entity_with_a_row_per_frame(frames: list[LogFrame], tmp_path: Path):
    pytest.importorskip("rerun")
    from rerun.chunk import RrdReader

    path = write(frames, tmp_path / "walk.rrd")
    reader = RrdReader(path)
    assert [one.recording_id for one in reader.recordings()] == [INFO.name]
    rows: dict[str, int] = {}
    values: dict[str, list[float]] = {}
    boxes: list[list[float]] = []
    for chunk in reader.stream().to_chunks():
        if chunk.is_static:
            rows.setdefault(chunk.entity_path, 0)
            continue
        assert list(chunk.timeline_names) == ["time"]
        rows[chunk.entity_path] = rows.get(chunk.entity_path, 0) + chunk.num_rows
        table = chunk.to_record_batch()
        for name in table.schema.names:
            if name == "Scalars:scalars":
                values.setdefault(chunk.entity_path, []).extend(one[0] for one in table.column(name).to_pylist())
            if name == "Boxes2D:centers" and chunk.entity_path == "/world/camera/image/truth":
                boxes += [one[0] for one in table.column(name).to_pylist()]
    for entity in ("camera", "camera/image", "camera/image/truth", "camera/image/stay", "robot", "people"):
        assert rows[f"/world/{entity}"] == COUNT, entity
    assert {"/world/paths/robot", "/world/paths/target"} <= rows.keys()
    assert values["/plots/ms/stay"] == [log.ms["stay"] for log in frames]
    overlaps = [log.overlap("stay") for log in frames if log.frame.truth.scored]
    assert np.abs(np.array(values["/plots/overlap/stay"]) - overlaps).max() < 1e-12
    assert values["/plots/overlap/ko2012_alpha_0_3"] == [0.0] * (COUNT - 1)
    assert values["/plots/command/turn"] == [-0.25] * COUNT
    assert boxes[1] == [15.25, 14.5]


@pytest.mark.parametrize("closed", [pytest.param(False, marks=pytest.mark.slow), True])
def test_a_run_logs_its_first_seed(tmp_path: Path, closed: bool):
    pytest.importorskip("mcap_ros2")
    pytest.importorskip("rerun")
    scenario, controllers = ("follow/corridor", ["servo"]) if closed else ("corridor", [])
    # The open loop is seen by a camera that looks aside.
    aside = {"cameras": [{"name": "side", "pan_deg": 20.0, "left_m": 0.2}], "viewed": "side"}
    overrides = SMALL if closed else {**SMALL, **aside}
    plan = make_plan([scenario], ["oracle"], [0, 1], overrides=overrides, controllers=controllers)
    store = run(plan, tmp_path / "run", videos="none", logs=["mcap", "rerun"])
    first, second = list(plan.episodes())
    assert (store.path / f"logs/{first.path}.rrd").stat().st_size > 10_000
    assert not (store.path / f"logs/{second.path}.mcap").exists()
    found = messages(store.path / f"logs/{first.path}.mcap")
    true_boxes = np.stack([*store.frame_columns(store.results[0], ["box"])["box"]])
    read = read_sequence(store.path / f"logs/{first.path}.mcap")
    assert len(true_boxes) == len(read) == len(found["/tf"])
    assert abs(read.truth - true_boxes).max() < 1e-9
    assert ("/cmd_vel" in found) == closed
    tree = {one.child_frame_id: one for topic in ("/tf", "/tf_static") for one in found[topic][0][2].transforms}
    odometry = pose_in(tree, "camera_optical_frame", "map")
    assert abs(odometry - pose_in(tree, "truth/camera_optical_frame", "world")).max() < 0.03
    assert run(plan, store.path, videos="none", logs=["mcap"]).path == store.path
    with pytest.raises(RunError, match=f"was run without logs/{second.path}.mcap: choose another folder"):
        run(plan, store.path, videos="all", logs=["mcap"])


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize("name", ["mcap", "rerun"])
def test_a_full_disk_is_one_clear_error(frames: list[LogFrame], name: str):
    pytest.importorskip("mcap_ros2" if name == "mcap" else "rerun")

    def fill() -> None:
        with log_writer(name, Path("/dev/full"), INFO) as add:
            for log in frames:
                add(log)

    # The benchmark's atomic_write turns an OSError into a RunError.
    with pytest.raises((RunError, OSError), match="No space left"):
        fill()


def test_wrong_formats_are_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    with pytest.raises(UnknownNameError, match="did you mean 'rerun'"):
        check_formats(["rerum"])
    with pytest.raises(ParameterError, match=r"must end in .mcap or .rrd, got 'a.bag'"):
        log_format(Path("a.bag"))
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(RunError, match=r"pip install 'pftrack-sim\[ros2\]'"):
        check_formats(["mcap"])
