"""Interface of controllers, and the robot parameters that they get."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol, SupportsFloat, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.proprioception import FIELD_DEG, PROPRIO_INDEX, RANGE_M
from pftrack_sim.core.records import Estimate
from pftrack_sim.core.types import FloatArray

LEAST_CONFIDENCE = 0.2
"""Confidence below which a tracker counts as unsure, unless a controller is told otherwise."""


@dataclass(frozen=True)
class RobotParameters:
    """Data sheet of the robot, and its task: what a controller may know beforehand.

    Attributes:
        image_size: Width, height [px].
        fovy_rad: Vertical field of view.
        rate_hz: Frames per second.
        max_speed_m_s: Forward speed of a command of 1; the others are rates of turn, pan and tilt of a command of 1.
        distance_m: Desired distance to the target.
        camera_height_m: Height of the optical centre above the ground.
        beam_field_deg: Angle from the first to the last beam of the range finder.
        range_m: Longest range of the beams.
        camera_pan_rad: How far the axis of the camera that is looked through is turned to the left of the head's.
        camera_tilt_rad: How far it is turned up from the head's.

    Raises:
        ParameterError: An angle of the camera that is not finite, another number that is not positive and finite, or a
            field of view of 180 degrees or more.
    """

    image_size: tuple[int, int] = (640, 480)
    fovy_rad: float = math.radians(50.0)
    rate_hz: float = 30.0
    max_speed_m_s: float = 1.6
    max_turn_rad_s: float = math.radians(90.0)
    max_pan_rad_s: float = math.radians(120.0)
    max_tilt_rad_s: float = math.radians(60.0)
    distance_m: float = 3.0
    camera_height_m: float = 1.25
    beam_field_deg: float = FIELD_DEG
    range_m: float = RANGE_M
    camera_pan_rad: float = 0.0
    camera_tilt_rad: float = 0.0

    def __post_init__(self) -> None:
        angles = {"camera_pan_rad", "camera_tilt_rad"}
        for key in sorted(angles):
            if not math.isfinite(angle := getattr(self, key)):
                raise ParameterError(f"robot parameters: {key} must be a finite number, got {angle!r}")
        numbers = {key: value for key, value in vars(self).items() if key not in {"image_size", *angles}}
        numbers |= {"image width": self.image_size[0], "image height": self.image_size[1]}
        for key, value in numbers.items():
            if not is_positive(value):
                raise ParameterError(f"robot parameters: {key} must be a positive number, got {value!r}")
        if self.fovy_rad >= math.pi:
            raise ParameterError(f"robot parameters: fovy_rad must be below pi, got {self.fovy_rad!r}")

    @property
    def limits(self) -> FloatArray:
        """`(4,)` greatest forward speed [m/s], turn, pan and tilt rate [rad/s]."""
        return np.array([self.max_speed_m_s, self.max_turn_rad_s, self.max_pan_rad_s, self.max_tilt_rad_s])

    def gaze_rad(self, proprio: NDArray[Any]) -> tuple[float, float]:
        """Pan and tilt, in the frame of the chassis, of the axis of the camera that is looked through."""
        pan, tilt = (float(proprio[PROPRIO_INDEX[name]]) for name in ("pan_rad", "tilt_rad"))
        return pan + self.camera_pan_rad, tilt + self.camera_tilt_rad

    @property
    def frame_s(self) -> float:
        """Time between frames."""
        return 1.0 / self.rate_hz

    @property
    def focal_px(self) -> float:
        """Focal length [px]."""
        return 0.5 * self.image_size[1] / math.tan(0.5 * self.fovy_rad)


@runtime_checkable
class Controller(Protocol):
    """Maps an estimate and the robot's proprioception to a command, once per frame."""

    def reset(self, robot: RobotParameters) -> None:
        """Reset all state at the start of an episode on this robot."""
        ...

    def act(self, estimate: Estimate, proprio: NDArray[Any]) -> FloatArray:
        """`(4,)` forward speed, turn, pan and tilt rate until the next frame, in [-1, 1] of the robot's limits.

        `proprio` is `(n,)` in the order of `pftrack_sim.core.proprioception.PROPRIO_NAMES`.
        """
        ...


def is_lost(estimate: Estimate, min_confidence: float) -> bool:
    """Whether the tracker is unsure, reports an occlusion, or returns an empty box."""
    _, _, width, height = estimate.box.tolist()
    return estimate.occluded or estimate.confidence < min_confidence or width <= 0.0 or height <= 0.0


def stopping_speed(gap_m: float, brake_m_s2: float, reaction_s: float) -> float:
    """Greatest speed [m/s] from which the robot stops within a gap, or 0: v^2 / 2 a + v t <= gap."""
    lag = brake_m_s2 * reaction_s
    return math.sqrt(2.0 * brake_m_s2 * max(gap_m, 0.0) + lag * lag) - lag


def is_positive(value: object) -> bool:
    """Whether a value is a finite number above 0."""
    return (
        isinstance(value, SupportsFloat) and not isinstance(value, (bool, np.ndarray)) and 0.0 < float(value) < math.inf
    )
