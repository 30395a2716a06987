"""Sequences in ROS 2 bags: MCAP files, SQLite files (`.db3`), or folders of them; library: `rosbags`.

Images are messages `sensor_msgs/CompressedImage` or `Image` (rgb8, bgr8, rgba8, bgra8, mono8), boxes
`vision_msgs/Detection2DArray`. A box belongs to the image with its time stamp; it is the one with the id `target`, or
the only one. In ROS the centre of the first pixel is 0, where it is 0.5 in the rest of this package.
"""

from __future__ import annotations

import contextlib
import importlib
import itertools
from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pftrack_sim.core.boxes import NO_BOX, Box
from pftrack_sim.core.errors import RunError, SequenceError
from pftrack_sim.core.image_files import check_pixels
from pftrack_sim.core.records import Image
from pftrack_sim.core.ros2_messages import HALF_PIXEL, type_store
from pftrack_sim.core.text import one_line
from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats.files import present_boxes
from pftrack_sim.formats.images import ImageStream, decoded_image
from pftrack_sim.formats.sequence import RecordedSequence

_SUFFIXES = (".mcap", ".db3")
_IMAGES = ("sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image")
_BOXES = ("vision_msgs/msg/Detection2DArray",)
_IMU = ("sensor_msgs/msg/Imu",)
_TRUTH, _TARGET = "/truth", "target"
_CHANNELS = {"rgb8": "rgb", "bgr8": "bgr", "rgba8": "rgba", "bgra8": "bgra", "mono8": "m"}


def find(path: Path) -> Path | None:
    """The bag that a path names: a file of messages or a folder of them with its metadata; None if it is neither."""
    is_bag = path.is_file() if path.suffix.lower() in _SUFFIXES else (path / "metadata.yaml").is_file()
    return path if is_bag else None


def read(path: Path, topics: Sequence[str] = ()) -> RecordedSequence:
    """Read a sequence from its first image with a box on.

    Args:
        path: The file or folder.
        topics: Of images and of boxes; without them the only ones of such messages, for boxes `/truth` first.

    Raises:
        RunError: The library is missing.
        SequenceError: The file is damaged; a topic is missing or not the only one; there is no image or box.
    """
    with _opened(path) as bag:
        kinds = {one.topic: one.msgtype for one in bag.connections}
        images = _chosen(path, kinds, _IMAGES, topics, "image")
        given = _chosen(path, kinds, _BOXES, topics, "box", preferred=_TRUTH)
        received = [(_stamp(message), time_ns) for time_ns, message in _messages(bag, images)]
        detections = {_stamp(message): list(message.detections) for _, message in _messages(bag, given)}
        named = any(one.id == _TARGET for found in detections.values() for one in found)
        by_stamp = {stamp: _target(found, named) for stamp, found in detections.items()}
    if not received:
        raise SequenceError(f"{path}: no image on {images}")
    stamps = [stamp for stamp, _ in received]
    truth = np.array([by_stamp.get(stamp, NO_BOX) for stamp in stamps])
    span_s = (stamps[-1] - stamps[0]) * 1e-9
    rate_hz = (len(stamps) - 1) / span_s if span_s > 0.0 else None
    times_ns = [time_ns for _, time_ns in received]
    bag_images = ImageStream(path, len(received), lambda index: _images(path, images, times_ns, index))
    sequence = RecordedSequence.checked(path, given, bag_images, present_boxes(truth), rate_hz)
    return replace(sequence, name=path.stem)


def read_imu(path: Path, topics: Sequence[str] = ()) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Samples of an inertial sensor: `(N,)` stamps [s], `(N, 3)` turn rates [rad/s] and accelerations [m/s^2] or None.

    Raises:
        RunError: The library is missing.
        SequenceError: As `read`; there are no messages `sensor_msgs/Imu`.
    """
    with _opened(path) as bag:
        topic = _chosen(path, {one.topic: one.msgtype for one in bag.connections}, _IMU, topics, "IMU")
        messages = [message for _, message in _messages(bag, topic)]
    if not messages:
        raise SequenceError(f"{path}: no message on {topic}")
    first = _stamp(messages[0])
    turns, found = (
        np.array([[one.x, one.y, one.z] for one in vectors])
        for vectors in zip(*((one.angular_velocity, one.linear_acceleration) for one in messages), strict=True)
    )
    known = messages[0].linear_acceleration_covariance[0] != -1.0  # -1: there is no such sensor
    return 1e-9 * np.array([_stamp(one) - first for one in messages]), turns, found if known else None


@contextlib.contextmanager
def _opened(path: Path) -> Generator[Any]:
    """A reader of `rosbags`; whatever goes wrong becomes a SequenceError."""
    try:
        highlevel: Any = importlib.import_module("rosbags.highlevel")
    except ImportError:
        raise RunError("ROS 2 bags need the extra: pip install 'pftrack-sim[ros2]'") from None
    try:
        with highlevel.AnyReader([path], default_typestore=type_store()) as bag:
            yield bag
    except (SequenceError, GeneratorExit):
        raise
    except Exception as error:  # noqa: BLE001 - each storage and decompressor has error types of its own
        text = one_line(f"{type(error).__name__} {error}", 80)
        raise SequenceError(f"{path}: is no ROS 2 bag, or it is damaged: {text}") from None


def _messages(bag: Any, topic: str, since_ns: int | None = None) -> Iterator[tuple[int, Any]]:
    """Time of reception [ns] and content of all messages on a topic, or of those from a time on."""
    wanted = [one for one in bag.connections if one.topic == topic]
    for connection, time_ns, content in bag.messages(wanted, start=since_ns):
        yield time_ns, bag.deserialize(content, connection.msgtype)


def _images(path: Path, topic: str, times_ns: Sequence[int], first: int) -> Iterator[Image]:
    """Images on a topic from the one of an index on, by their times of reception."""
    skipped = first - times_ns.index(times_ns[first])  # images received at the same time keep their order
    with _opened(path) as bag:
        for _, message in itertools.islice(_messages(bag, topic, times_ns[first]), skipped, None):
            yield _decoded(path, message)


def _chosen(
    path: Path, kinds: dict[str, str], wanted: Sequence[str], topics: Sequence[str], what: str, preferred: str = ""
) -> str:
    found = sorted(topic for topic, kind in kinds.items() if kind in wanted)
    named = [topic for topic in topics if topic in found] or [topic for topic in found if topic == preferred] or found
    for topic in topics:
        if topic not in kinds:
            raise SequenceError(f"{path}: no topic {topic} (there: {', '.join(sorted(kinds)) or 'none'})")
    if len(named) != 1:
        listed = ", ".join(found) or "none"
        raise SequenceError(f"{path}: needs one {what} topic ({' or '.join(wanted)}), has {listed}; see --topics")
    return named[0]


def _stamp(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _target(detections: list[Any], named: bool) -> Box:
    """Box of the target among the detections in an image: the one of its name, or else the only one; NaN without."""
    found = [one for one in detections if one.id == _TARGET] if named else detections
    if len(found) != 1:
        return NO_BOX
    box = found[0].bbox
    centre, width, height = box.center.position, box.size_x, box.size_y
    return np.array([centre.x + HALF_PIXEL - 0.5 * width, centre.y + HALF_PIXEL - 0.5 * height, width, height])


def _decoded(path: Path, message: Any) -> Image:
    if hasattr(message, "format"):
        return decoded_image(path, bytes(message.data))
    try:
        check_pixels(message.width, message.height)
    except ValueError as error:
        raise SequenceError(f"{path}: {error}") from None
    if message.encoding not in _CHANNELS:
        raise SequenceError(f"{path}: images must be {', '.join(_CHANNELS)}, got {message.encoding!r}")
    names, data = _CHANNELS[message.encoding], np.frombuffer(bytes(message.data), dtype=np.uint8)
    if data.size != message.height * message.step or message.step < message.width * len(names):
        size = f"{message.width} x {message.height} pixels of {message.encoding}"
        raise SequenceError(f"{path}: an image of {size} has {data.size} bytes, {message.step} a row")
    rows = data.reshape(message.height, message.step)[:, : message.width * len(names)]
    pixels = rows.reshape(message.height, message.width, len(names))
    return np.ascontiguousarray(pixels[:, :, [max(names.find(name), 0) for name in "rgb"]])
