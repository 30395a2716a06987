"""What a log records of an episode and of each frame, and under which names of trackers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import cv2
import numpy as np

from pftrack_sim.core import boxes
from pftrack_sim.core.image_files import encode
from pftrack_sim.core.records import Estimate, Frame, Image
from pftrack_sim.core.types import FloatArray

JPEG_QUALITY = 95


class Kinematics(Protocol):
    """What is known of a robot's shape, as of its URDF: directions and longest range of its beams, too."""

    beams_rad: FloatArray
    range_m: float

    @property
    def track_m(self) -> float:
        """Distance between the contact points of its wheels."""
        ...

    def camera_mount(self, pan_rad: float, tilt_rad: float) -> FloatArray:
        """`(4, 4)` T_base_camera of the first camera by the angles of the head."""
        ...


@dataclass(frozen=True, eq=False)
class LogInfo:
    """An episode.

    Attributes:
        name: For people: `"plaza-walk seed 3"`.
        speed_limits: `(4,)` what a command of 1 means: forward speed [m/s], turn, pan and tilt rate [rad/s].
        odometry_error: Standard deviation of wheel radii and track in the odometry, as a share of each.
        imu_errors: Standard deviations of turn rates [rad/s] and accelerations [m/s^2].
        T_camera: `(4, 4)` pose of the camera that is logged, in the axes of the first one on the head.
    """

    name: str
    rate_hz: float
    trackers: tuple[str, ...]
    speed_limits: tuple[float, float, float, float]
    odometry_error: float
    imu_errors: tuple[float, float] = (0.0, 0.0)
    T_camera: FloatArray = field(default_factory=lambda: np.eye(4))


@dataclass(frozen=True, eq=False)
class LogFrame:
    """A frame, what the robot measured at it, and what trackers and controller answered.

    Attributes:
        frame: The simulated frame with its truth.
        robot_pose: x, y [m], heading [rad] in the world.
        proprio: `(n,)` proprioception, see `core.proprioception`.
        robot: Its shape.
        estimates: By the tracker's label; None where it gave none.
        ms: Time that each tracker took; 0 where it was not called.
        command: `(4,)` shares of the speed limits in [-1, 1], in force from this frame on; None in open loop.
    """

    frame: Frame
    robot_pose: tuple[float, float, float]
    proprio: FloatArray
    robot: Kinematics
    estimates: Mapping[str, Estimate | None] = field(default_factory=dict[str, Estimate | None])
    ms: Mapping[str, float] = field(default_factory=dict[str, float])
    command: FloatArray | None = None

    def overlap(self, tracker: str) -> float:
        """Overlap of a tracker's box with `Truth.box`; NaN in frames that are not scored, 0 without an estimate."""
        if not self.frame.truth.scored:
            return float("nan")
        estimate = self.estimates.get(tracker)
        return 0.0 if estimate is None else boxes.iou(estimate.box, self.frame.truth.box)


def encode_jpeg(image: Image) -> bytes:
    """`(H, W, 3)` uint8 RGB as JPEG."""
    return encode(image, ".jpg", cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY)


def topics_of(labels: Iterable[str], prefix: str = "/trackers/") -> dict[str, str]:
    """A topic for each label, all different: letters, digits and underscores only, as ROS 2 demands.

    >>> topics_of(["ko2012[alpha=0.3]", "2d", "2d!"])
    {'ko2012[alpha=0.3]': '/trackers/ko2012_alpha_0_3', '2d': '/trackers/t2d', '2d!': '/trackers/t2d_2'}
    """
    topics: dict[str, str] = {}
    for label in labels:
        name = re.sub(r"[^A-Za-z0-9]+", "_", label).strip("_") or "tracker"
        topic = prefix + (f"t{name}" if name[0].isdigit() else name)
        count = sum(1 for taken in topics.values() if taken == topic or re.fullmatch(rf"{topic}_\d+", taken))
        topics[label] = topic if not count else f"{topic}_{count + 1}"
    return topics
