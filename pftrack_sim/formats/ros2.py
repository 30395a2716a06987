"""Sequences in ROS 2 bags: MCAP files and SQLite files (`.db3`) of messages, or folders of one of them.

Images are messages `sensor_msgs/CompressedImage` or `Image` (rgb8, bgr8, mono8), boxes `vision_msgs/Detection2DArray`.
A box belongs to the image with its time stamp; it is the one with the id `target`, or the only one. In ROS the
centre of the first pixel is 0, where it is 0.5 in the rest of this package.
"""

from __future__ import annotations

import contextlib
import importlib.util
from collections.abc import Generator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pftrack_sim.core.boxes import NO_BOX, Box
from pftrack_sim.core.errors import RunError, SequenceError
from pftrack_sim.core.records import Image
from pftrack_sim.core.text import one_line
from pftrack_sim.formats import mcap_file, sqlite_file
from pftrack_sim.formats.files import present_boxes
from pftrack_sim.formats.sequence import RecordedSequence

_STORAGES = {".mcap": mcap_file.Messages, ".db3": sqlite_file.Messages}
_IMAGES = ("sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image")
_BOXES = ("vision_msgs/msg/Detection2DArray",)
_TRUTH, _TARGET = "/truth", "target"
_HALF_PIXEL = 0.5
_CHANNELS = {"rgb8": 3, "bgr8": 3, "mono8": 1}


@dataclass(frozen=True, eq=False)
class _BagSequence(RecordedSequence):
    """Images are read from the file when they are asked for."""

    topic: str = ""
    times_ns: tuple[int, ...] = field(default=())

    def image(self, index: int) -> Image:
        """See `RecordedSequence`."""
        if not 0 <= index < len(self):
            raise IndexError(f"{self.name} has frames 0 to {len(self) - 1}, got {index}")
        path, time_ns = self.paths[index], self.times_ns[index]
        repeated = self.times_ns[:index].count(time_ns)  # images logged at the same time keep their order
        with _opened(path) as bag:
            found = bag.read(self.topic, time_ns)
            for place, (_, message) in enumerate(found):
                if place == repeated:
                    return _decoded(path, message)
        raise SequenceError(f"{path}: image {index + 1} on {self.topic} is missing")


def find(path: Path) -> Path | None:
    """The file of messages that a path names: itself, or the only one in a bag's folder; None if it is neither.

    Raises:
        SequenceError: A bag of several files, or of another storage.
    """
    if path.suffix.lower() in _STORAGES and path.is_file():
        return path
    if not (path / "metadata.yaml").is_file():
        return None
    found = sorted(one for one in path.iterdir() if one.suffix.lower() in _STORAGES)
    if len(found) != 1:
        kinds = " or ".join(_STORAGES)
        raise SequenceError(f"{path}: a ROS 2 bag must hold one {kinds} file, has {len(found)}; see ros2 bag convert")
    return found[0]


def read(path: Path, topics: Sequence[str] = ()) -> RecordedSequence:
    """Read a sequence from its first image with a box on.

    Args:
        path: The file.
        topics: Of images and of boxes; without them the only ones of such messages, for boxes `/truth` first.

    Raises:
        RunError: The library is missing.
        SequenceError: The file is damaged; a topic is missing or not the only one; there is no image or box.
    """
    with _opened(path) as bag:
        kinds = bag.topics()
    images = _chosen(path, kinds, _IMAGES, topics, "image")
    given = _chosen(path, kinds, _BOXES, topics, "box", preferred=_TRUTH)
    stamps: list[int] = []
    times_ns: list[int] = []
    with _opened(path) as bag:
        for time_ns, message in bag.read(images):
            stamps.append(_stamp(message))
            times_ns.append(time_ns)
        detections = {_stamp(message): list(message.detections) for _, message in bag.read(given)}
        named = any(one.id == _TARGET for found in detections.values() for one in found)
        by_stamp = {stamp: _target(found, named) for stamp, found in detections.items()}
    if not stamps:
        raise SequenceError(f"{path}: no image on {images}")
    truth = np.array([by_stamp.get(stamp, NO_BOX) for stamp in stamps])
    span_s = (stamps[-1] - stamps[0]) * 1e-9
    rate_hz = (len(stamps) - 1) / span_s if span_s > 0.0 else None
    whole = RecordedSequence.checked(path, given, [path] * len(stamps), present_boxes(truth), rate_hz)
    times = tuple(times_ns[whole.start :])
    return _BagSequence(path.stem, whole.paths, whole.truth, rate_hz, whole.start, topic=images, times_ns=times)


@contextlib.contextmanager
def _opened(path: Path) -> Generator[mcap_file.Messages | sqlite_file.Messages]:
    """The messages of a file; whatever goes wrong with them becomes a SequenceError."""
    if importlib.util.find_spec("mcap_ros2") is None:
        raise RunError("ROS 2 messages need the extra: pip install 'pftrack-sim[mcap]'")
    try:
        with _STORAGES[path.suffix.lower()](path) as bag:
            yield bag
    except (SequenceError, GeneratorExit):
        raise
    except OSError as error:
        raise SequenceError(f"{path}: cannot be read: {error.strerror}") from None
    except Exception as error:  # noqa: BLE001 - each decompressor has error types of its own
        text = one_line(f"{type(error).__name__} {error}", 80)
        raise SequenceError(f"{path}: is no ROS 2 bag, or it is damaged: {text}") from None


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
    return np.array([centre.x + _HALF_PIXEL - 0.5 * width, centre.y + _HALF_PIXEL - 0.5 * height, width, height])


def _decoded(path: Path, message: Any) -> Image:
    data = np.frombuffer(bytes(message.data), dtype=np.uint8)
    if hasattr(message, "format"):
        image = cv2.imdecode(data, cv2.IMREAD_COLOR_RGB) if data.size else None
        if image is None:
            raise SequenceError(f"{path}: an image cannot be decoded ({message.format})")
        return np.asarray(image, dtype=np.uint8)
    if message.encoding not in _CHANNELS or data.size != message.height * message.step:
        raise SequenceError(f"{path}: images must be {', '.join(_CHANNELS)}, got {message.encoding!r}")
    channels = _CHANNELS[message.encoding]
    rows = data.reshape(message.height, message.step)[:, : message.width * channels]
    pixels = rows.reshape(message.height, message.width, channels)
    return np.ascontiguousarray(
        pixels[:, :, ::-1] if message.encoding == "bgr8" else np.repeat(pixels, 3 // channels, 2)
    )
