"""MCAP files of ROS 2 messages, as Foxglove and `ros2 bag` read them; library: `mcap-ros2-support`.

Frames of reference (REP 103, REP 105): `map` -> `odom` -> `base_footprint` -> `base_link` -> sensors. Odometry gives
the second, the angles of the head give the camera, and the first is that of a perfect localisation: it brings the
robot to its true place. The truth has a tree of its own below `world`, which coincides with `map`. Pixel coordinates
follow ROS and OpenCV: the centre of the first pixel is 0, where it is 0.5 in the rest of this package.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.proprioception import BEAM_HEIGHT_M, PROPRIO_INDEX, RANGES
from pftrack_sim.core.records import Truth
from pftrack_sim.core.ros2_messages import HALF_PIXEL, type_store
from pftrack_sim.core.types import FloatArray
from pftrack_sim.logs.frame import LogFrame, LogInfo, encode_jpeg, topics_of

Message: TypeAlias = dict[str, Any]
_LENSES = {4: "equidistant", 5: "plumb_bob", 8: "rational_polynomial"}  # By number of coefficients
_EXACT = 1e-6  # Variance of what has no error: 0 means unknown to ROS
_UNMEASURED = 1e6  # That of z, roll and pitch, which a robot on the ground does not measure
_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # Axes of an optical frame in its camera's


@contextmanager
def writer(path: Path, info: LogInfo) -> Generator[Callable[[LogFrame], None]]:
    """See `logs.log_writer`."""
    library: Any = importlib.import_module("mcap_ros2.writer")
    with path.open("wb") as opened, library.Writer(opened) as written:
        written.add_metadata("pftrack-sim", {"episode": info.name, "rate_hz": f"{info.rate_hz:g}"})
        messages, schemas = Messages(info), dict[str, Any]()

        def add(log: LogFrame) -> None:
            nanoseconds = round(log.frame.time_s * 1e9)
            for topic, kind, message in messages.of(log):
                if kind not in schemas:
                    name = kind.replace("/", "/msg/")
                    schemas[kind] = written.register_msgdef(name, type_store().generate_msgdef(name, ros_version=2)[0])
                written.write_message(topic, schemas[kind], message, nanoseconds, sequence=log.frame.index)

        yield add


class Messages:
    """The messages of an episode, frame by frame, as nested dictionaries of their fields."""

    def __init__(self, info: LogInfo) -> None:
        self._info, self._topics = info, topics_of(info.trackers)
        self._covariance: OdometryCovariance | None = None

    def of(self, log: LogFrame) -> Iterator[tuple[str, str, Message]]:
        """Topic, type and content of each message of a frame."""
        frame, nanoseconds = log.frame, round(log.frame.time_s * 1e9)
        stamp = {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
        self._covariance = self._covariance or OdometryCovariance(log.robot.track_m, self._info.odometry_error)
        covariance = self._covariance.at(*log.proprio[:3].tolist())

        def header(frame_id: str) -> Message:
            return {"stamp": stamp, "frame_id": frame_id}

        yield "/clock", "rosgraph_msgs/Clock", {"clock": stamp}
        image = header("camera_optical_frame")
        jpeg = {"header": image, "format": "jpeg", "data": encode_jpeg(frame.image)}
        yield "/camera/image/compressed", "sensor_msgs/CompressedImage", jpeg
        yield "/camera/camera_info", "sensor_msgs/CameraInfo", _camera_info(image, frame.truth, frame.image.shape)
        people = [
            _detection(image, one.name, one.box, one.visible_fraction) for one in frame.people if boxes.area(one.box)
        ]
        yield "/truth", "vision_msgs/Detection2DArray", {"header": image, "detections": people}
        for label, topic in self._topics.items():
            estimate = log.estimates.get(label)
            found = [] if estimate is None else [_detection(image, "target", estimate.box, estimate.confidence)]
            yield topic, "vision_msgs/Detection2DArray", {"header": image, "detections": found}
        yield "/odom", "nav_msgs/Odometry", _odometry(header("odom"), log.proprio, covariance, self._info)
        yield "/imu", "sensor_msgs/Imu", _imu(header("imu_link"), log.proprio, self._info)
        yield "/scan", "sensor_msgs/LaserScan", _scan(header("base_scan"), log, 1.0 / self._info.rate_hz)
        head: list[float] = [log.proprio[PROPRIO_INDEX[name]] for name in ("pan_rad", "tilt_rad")]
        joints = {"name": ["pan", "tilt"], "position": head, "velocity": [], "effort": []}
        yield "/joint_states", "sensor_msgs/JointState", {"header": header(""), **joints}
        odometry, base = _planar(*log.proprio[:3].tolist()), _planar(*log.robot_pose)
        camera = log.robot.camera_mount(*head) @ self._info.T_camera
        mount = camera @ np.linalg.inv(_pose_of(_OPTICAL, (0.0, 0.0, 0.0)))
        transforms = [
            _transform(header("map"), "odom", base @ np.linalg.inv(odometry)),
            _transform(header("odom"), "base_footprint", odometry),
            _transform(header("base_link"), "camera_link", mount),
        ]
        true = {"base_footprint": base, "camera_optical_frame": frame.truth.T_world_camera}
        true |= {one.name: one.T_world_target for one in frame.people}
        transforms += [_transform(header("world"), f"truth/{name}", pose) for name, pose in true.items()]
        yield "/tf", "tf2_msgs/TFMessage", {"transforms": transforms}
        if frame.index == 0:
            fixed = [
                _transform(header("base_footprint"), "base_link", np.eye(4)),
                _transform(header("base_link"), "imu_link", np.eye(4)),
                _transform(header("base_link"), "base_scan", _pose_of(np.eye(3), (0.0, 0.0, BEAM_HEIGHT_M))),
                _transform(header("camera_link"), "camera_optical_frame", _pose_of(_OPTICAL, (0.0, 0.0, 0.0))),
            ]
            yield "/tf_static", "tf2_msgs/TFMessage", {"transforms": fixed}
        if log.command is not None:
            forward, turn, *rates = (log.command * self._info.speed_limits).tolist()
            yield "/cmd_vel", "geometry_msgs/Twist", _twist(forward, turn)
            multi: Message = {"layout": {"dim": [], "data_offset": 0}, "data": rates}
            yield "/head_velocity_controller/commands", "std_msgs/Float64MultiArray", multi


class OdometryCovariance:
    """Covariance of x, y and heading by wheel odometry whose radii and track have independent relative errors.

    The pose is a function of these three errors; its derivatives are carried along with it (Siciliano et al. 2009,
    "Robotics: modelling, planning and control", section 11.7, for the odometry). Slip is not in it. `error` is the
    standard deviation of each, as a share.
    """

    def __init__(self, track_m: float, error: float) -> None:
        self._track_m, self._error = track_m, error
        self._derivatives = np.zeros((3, 3))
        """Of x, y and heading by left radius, right radius and track."""
        self._pose = (0.0, 0.0, 0.0)

    def at(self, x_m: float, y_m: float, heading_rad: float) -> FloatArray:
        """`(3, 3)` covariance at the odometry's next pose, in m and rad."""
        dx, dy, turn = x_m - self._pose[0], y_m - self._pose[1], math.remainder(heading_rad - self._pose[2], math.tau)
        middle = self._pose[2] + 0.5 * turn
        way = dx * math.cos(middle) + dy * math.sin(middle)
        left, right = way - 0.5 * self._track_m * turn, way + 0.5 * self._track_m * turn
        heading = np.array([-left / self._track_m, right / self._track_m, -turn])
        half_way = self._derivatives[2] + 0.5 * heading
        ahead, aside = np.array([math.cos(middle), math.sin(middle)]), np.array([-math.sin(middle), math.cos(middle)])
        self._derivatives[:2] += np.outer(ahead, [0.5 * left, 0.5 * right, 0.0]) + way * np.outer(aside, half_way)
        self._derivatives[2] += heading
        self._pose = (x_m, y_m, heading_rad)
        return self._error**2 * self._derivatives @ self._derivatives.T + _EXACT * np.eye(3)


def _vector(values: ArrayLike) -> Message:
    return dict(zip("xyz", (float(value) for value in np.asarray(values)), strict=True))


def _planar(x_m: float, y_m: float, heading_rad: float) -> FloatArray:
    """`(4, 4)` pose on the ground."""
    return _pose_of(Rotation.from_euler("z", heading_rad).as_matrix(), (x_m, y_m, 0.0))


def _pose_of(rotation: FloatArray, place: ArrayLike) -> FloatArray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, place
    return pose


def _quaternion(pose: FloatArray) -> Message:
    return dict(zip("xyzw", Rotation.from_matrix(pose[:3, :3]).as_quat().tolist(), strict=True))


def _transform(header: Message, child: str, pose: FloatArray) -> Message:
    transform = {"translation": _vector(pose[:3, 3]), "rotation": _quaternion(pose)}
    return {"header": header, "child_frame_id": child, "transform": transform}


def _twist(forward_m_s: float, turn_rad_s: float) -> Message:
    return {"linear": _vector([forward_m_s, 0.0, 0.0]), "angular": _vector([0.0, 0.0, turn_rad_s])}


def _pose(pose: FloatArray, covariance: FloatArray) -> Message:
    message = {"position": _vector(pose[:3, 3]), "orientation": _quaternion(pose)}
    return {"pose": message, "covariance": covariance.ravel().tolist()}


def _on_ground(covariance: FloatArray) -> FloatArray:
    """`(6, 6)` covariance of x, y, z, roll, pitch and yaw from the `(3, 3)` one of x, y and yaw."""
    full, ground = _UNMEASURED * np.eye(6), [0, 1, 5]
    full[np.ix_(ground, ground)] = covariance
    return full


def _detection(header: Message, name: str, box: Box, score: float) -> Message:
    centre = boxes.centre(box) - HALF_PIXEL
    position = {"x": float(centre[0]), "y": float(centre[1])}
    hypothesis = {"class_id": "person", "score": float(score)}
    return {
        "header": header,
        "results": [{"hypothesis": hypothesis, "pose": _pose(np.eye(4), np.zeros((6, 6)))}],
        "bbox": {"center": {"position": position, "theta": 0.0}, "size_x": float(box[2]), "size_y": float(box[3])},
        "id": name,
    }


def _camera_info(header: Message, truth: Truth, shape: tuple[int, ...]) -> Message:
    matrix = np.array(truth.K)
    matrix[:2, 2] -= HALF_PIXEL
    roi = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
    return {
        "header": header,
        "height": shape[0],
        "width": shape[1],
        "distortion_model": _LENSES[len(truth.distortion)],
        "d": truth.distortion.tolist(),
        "k": matrix.ravel().tolist(),
        "r": np.eye(3).ravel().tolist(),
        "p": np.column_stack([matrix, np.zeros(3)]).ravel().tolist(),
        "binning_x": 0,
        "binning_y": 0,
        "roi": roi,
    }


def _odometry(header: Message, proprio: FloatArray, covariance: FloatArray, info: LogInfo) -> Message:
    values = {name: float(proprio[index]) for name, index in PROPRIO_INDEX.items()}
    pose = _planar(values["odometry_x_m"], values["odometry_y_m"], values["odometry_heading_rad"])
    forward = 0.5 * (values["wheel_left_m_s"] + values["wheel_right_m_s"])
    twist = _twist(forward, values["gyro_z_rad_s"])
    # Speed is the mean of two wheels with independent relative errors; the turn rate is the gyroscope's.
    variances = 0.5 * (info.odometry_error * forward) ** 2, 0.0, info.imu_errors[0] ** 2
    speeds = {"twist": twist, "covariance": _on_ground(np.diag(np.maximum(variances, _EXACT))).ravel().tolist()}
    ends = {"pose": _pose(pose, _on_ground(covariance)), "twist": speeds}
    return {"header": header, "child_frame_id": "base_footprint", **ends}


def _imu(header: Message, proprio: FloatArray, info: LogInfo) -> Message:
    turns, accelerations = (
        _vector([proprio[PROPRIO_INDEX[name.format(axis)]] for axis in "xyz"])
        for name in ("gyro_{}_rad_s", "accelerometer_{}_m_s2")
    )
    unknown = [-1.0, *[0.0] * 8]  # there is no orientation
    gyro_covariance, accelerometer_covariance = (
        (max(_EXACT, sigma**2) * np.eye(3)).ravel().tolist() for sigma in info.imu_errors
    )
    return {
        "header": header,
        "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        "orientation_covariance": unknown,
        "angular_velocity": turns,
        "angular_velocity_covariance": gyro_covariance,
        "linear_acceleration": accelerations,
        "linear_acceleration_covariance": accelerometer_covariance,
    }


def _scan(header: Message, log: LogFrame, period_s: float) -> Message:
    angles, range_m = log.robot.beams_rad.tolist(), log.robot.range_m
    ranges = [value if value < range_m else math.inf for value in log.proprio[RANGES].tolist()]
    return {
        "header": header,
        "angle_min": angles[0],
        "angle_max": angles[-1],
        "angle_increment": angles[1] - angles[0],
        "time_increment": 0.0,
        "scan_time": period_s,
        "range_min": 0.0,
        "range_max": range_m,
        "ranges": ranges,
        "intensities": [],
    }
