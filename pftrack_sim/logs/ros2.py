"""MCAP files of ROS 2 messages, as Foxglove and `ros2 bag` read them; library: `mcap-ros2-support`.

Frames of reference (REP 103, REP 105): `world` holds the true poses of `base_footprint` (the robot on the ground),
`camera_optical_frame` and every person in view; `odom` stands where the robot started. Pixel coordinates follow ROS
and OpenCV: the centre of the first pixel is 0, where it is 0.5 in the rest of this package.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.proprioception import BEAM_HEIGHT_M, PROPRIO_INDEX, RANGE_ANGLES_RAD, RANGE_M, RANGES
from pftrack_sim.core.records import Truth
from pftrack_sim.core.ros2_messages import HALF_PIXEL, type_store
from pftrack_sim.core.types import FloatArray
from pftrack_sim.logs.frame import LogFrame, LogInfo, encode_jpeg, topics_of

_Message: TypeAlias = dict[str, Any]
_ZEROS_36 = [0.0] * 36


@contextmanager
def writer(path: Path, info: LogInfo) -> Generator[Callable[[LogFrame], None]]:
    """See `logs.log_writer`."""
    library: Any = importlib.import_module("mcap_ros2.writer")
    with path.open("wb") as opened, library.Writer(opened) as written:
        written.add_metadata("pftrack-sim", {"episode": info.name, "rate_hz": f"{info.rate_hz:g}"})
        yield _Log(written, info).add


class _Log:
    def __init__(self, written: Any, info: LogInfo) -> None:
        self._writer, self._info = written, info
        self._schemas: dict[str, Any] = {}
        self._topics = topics_of(info.trackers)
        self._odom: tuple[float, float, float] | None = None

    def add(self, log: LogFrame) -> None:
        """Write the messages of a frame."""
        frame, nanoseconds = log.frame, round(log.frame.time_s * 1e9)
        stamp = {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
        self._odom = self._odom or log.robot_pose

        def write(topic: str, kind: str, message: _Message) -> None:
            if kind not in self._schemas:
                name = kind.replace("/", "/msg/")
                self._schemas[kind] = self._writer.register_msgdef(
                    name, type_store().generate_msgdef(name, ros_version=2)[0]
                )
            self._writer.write_message(topic, self._schemas[kind], message, nanoseconds, sequence=frame.index)

        def header(frame_id: str) -> _Message:
            return {"stamp": stamp, "frame_id": frame_id}

        image = header("camera_optical_frame")
        jpeg = {"header": image, "format": "jpeg", "data": encode_jpeg(frame.image)}
        write("/camera/image/compressed", "sensor_msgs/CompressedImage", jpeg)
        write("/camera/camera_info", "sensor_msgs/CameraInfo", _camera_info(image, frame.truth, frame.image.shape))
        people = [_detection(image, one.name, one.box, one.visible_fraction) for one in frame.people if _has_box(one)]
        write("/truth", "vision_msgs/Detection2DArray", {"header": image, "detections": people})
        for label, topic in self._topics.items():
            estimate = log.estimates.get(label)
            found = [] if estimate is None else [_detection(image, "target", estimate.box, estimate.confidence)]
            write(topic, "vision_msgs/Detection2DArray", {"header": image, "detections": found})
        write("/odom", "nav_msgs/Odometry", _odometry(header("odom"), log.proprio))
        write("/imu", "sensor_msgs/Imu", _imu(header("base_footprint"), log.proprio))
        write("/scan", "sensor_msgs/LaserScan", _scan(header("range_finder"), log.proprio, 1.0 / self._info.rate_hz))
        world = header("world")
        transforms = [
            _transform(world, "odom", *_planar(self._odom)),
            _transform(world, "base_footprint", *_planar(log.robot_pose)),
            _transform(header("base_footprint"), "range_finder", [0.0, 0.0, BEAM_HEIGHT_M], np.eye(3)),
            _transform(world, "camera_optical_frame", *_parts(frame.truth.T_world_camera)),
            *(_transform(world, one.name, *_parts(one.T_world_target)) for one in frame.people),
        ]
        write("/tf", "tf2_msgs/TFMessage", {"transforms": transforms})
        if log.command is not None:
            forward, turn = (log.command * self._info.speed_limits)[:2]
            write("/cmd_vel", "geometry_msgs/Twist", _twist(float(forward), float(turn)))


def _has_box(truth: Truth) -> bool:
    return boxes.area(truth.box) > 0.0


def _vector(values: ArrayLike) -> _Message:
    return dict(zip("xyz", (float(value) for value in np.asarray(values)), strict=True))


def _parts(pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    return pose[:3, 3], pose[:3, :3]


def _planar(pose: tuple[float, float, float]) -> tuple[FloatArray, FloatArray]:
    x, y, heading = pose
    return np.array([x, y, 0.0]), Rotation.from_euler("z", heading).as_matrix()


def _quaternion(rotation: FloatArray) -> _Message:
    return dict(zip("xyzw", Rotation.from_matrix(rotation).as_quat().tolist(), strict=True))


def _transform(header: _Message, child: str, translation: ArrayLike, rotation: FloatArray) -> _Message:
    transform = {"translation": _vector(translation), "rotation": _quaternion(rotation)}
    return {"header": header, "child_frame_id": child, "transform": transform}


def _twist(forward_m_s: float, turn_rad_s: float) -> _Message:
    return {"linear": _vector([forward_m_s, 0.0, 0.0]), "angular": _vector([0.0, 0.0, turn_rad_s])}


def _pose(translation: ArrayLike, rotation: FloatArray) -> _Message:
    pose = {"position": _vector(translation), "orientation": _quaternion(rotation)}
    return {"pose": pose, "covariance": _ZEROS_36}


def _detection(header: _Message, name: str, box: Box, score: float) -> _Message:
    centre = boxes.centre(box) - HALF_PIXEL
    position = {"x": float(centre[0]), "y": float(centre[1])}
    hypothesis = {"class_id": "person", "score": float(score)}
    return {
        "header": header,
        "results": [{"hypothesis": hypothesis, "pose": _pose(np.zeros(3), np.eye(3))}],
        "bbox": {"center": {"position": position, "theta": 0.0}, "size_x": float(box[2]), "size_y": float(box[3])},
        "id": name,
    }


def _camera_info(header: _Message, truth: Truth, shape: tuple[int, ...]) -> _Message:
    matrix = np.array(truth.K)
    matrix[:2, 2] -= HALF_PIXEL
    roi = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
    return {
        "header": header,
        "height": shape[0],
        "width": shape[1],
        "distortion_model": "plumb_bob",
        "d": truth.distortion.tolist(),
        "k": matrix.ravel().tolist(),
        "r": np.eye(3).ravel().tolist(),
        "p": np.column_stack([matrix, np.zeros(3)]).ravel().tolist(),
        "binning_x": 0,
        "binning_y": 0,
        "roi": roi,
    }


def _odometry(header: _Message, proprio: FloatArray) -> _Message:
    values = {name: float(proprio[index]) for name, index in PROPRIO_INDEX.items()}
    pose = values["odometry_x_m"], values["odometry_y_m"], values["odometry_heading_rad"]
    forward = 0.5 * (values["wheel_left_m_s"] + values["wheel_right_m_s"])
    twist = {"twist": _twist(forward, values["gyro_z_rad_s"]), "covariance": _ZEROS_36}
    return {"header": header, "child_frame_id": "base_footprint", "pose": _pose(*_planar(pose)), "twist": twist}


def _imu(header: _Message, proprio: FloatArray) -> _Message:
    turns, accelerations = (
        _vector([proprio[PROPRIO_INDEX[name.format(axis)]] for axis in "xyz"])
        for name in ("gyro_{}_rad_s", "accelerometer_{}_m_s2")
    )
    unknown = [-1.0, *[0.0] * 8]  # there is no orientation
    return {
        "header": header,
        "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        "orientation_covariance": unknown,
        "angular_velocity": turns,
        "angular_velocity_covariance": [0.0] * 9,
        "linear_acceleration": accelerations,
        "linear_acceleration_covariance": [0.0] * 9,
    }


def _scan(header: _Message, proprio: FloatArray, period_s: float) -> _Message:
    ranges = [value if value < RANGE_M else math.inf for value in proprio[RANGES].tolist()]
    return {
        "header": header,
        "angle_min": float(RANGE_ANGLES_RAD[0]),
        "angle_max": float(RANGE_ANGLES_RAD[-1]),
        "angle_increment": float(RANGE_ANGLES_RAD[1] - RANGE_ANGLES_RAD[0]),
        "time_increment": 0.0,
        "scan_time": period_s,
        "range_min": 0.0,
        "range_max": RANGE_M,
        "ranges": ranges,
        "intensities": [],
    }
