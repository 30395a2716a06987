"""The cameras of a scenario: the one on the robot's mast, and further ones that are fixed to it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pftrack_sim.core.random_streams import stream
from pftrack_sim.scenario.people import NAME
from pftrack_sim.scenario.section import Angle, Section, number, setting

CAMERA = "camera"
"""Name of the first camera."""


def seed_of_camera(seed: int, name: str) -> int:
    """Root seed of a camera's noise and detector in the episode of a seed: each camera has errors of its own."""
    return seed if name == CAMERA else int(stream(seed, "camera", name).integers(2**32))


_LensCoefficient: TypeAlias = Annotated[float, Field(ge=-1000.0, le=1000.0)]


class CalibratedLens(Section):
    """Camera matrix and lens of a calibration, in OpenCV's conventions: the middle of the first pixel is at (0, 0)."""

    width_px: int = number(..., 16, 4096, "Width of the images that it is of.")
    height_px: int = number(..., 16, 4096, "Height of the images that it is of.")
    fx: float = number(..., 4, 10_000, "Focal length across [px].")
    fy: float = number(..., 4, 10_000, "Focal length down [px].")
    cx: float = number(..., -4096, 8192, "Principal point [px].")
    cy: float = number(..., -4096, 8192, "Principal point [px].")
    distortion: tuple[_LensCoefficient, ...] = setting(
        (0.0,) * 5,
        "k1, k2, p1, p2, k3 of Brown's model; eight with k4, k5, k6 of a rational polynomial; four are k1 to k4 of an "
        "equidistant lens.",
        min_length=4,
        max_length=8,
    )


class Camera(Section):
    """The camera on the robot's mast."""

    width_px: int = number(640, 16, 4096, "Image width.")
    height_px: int = number(480, 16, 4096, "Image height.")
    fovy_deg: float = number(50.0, 5, 130, "Vertical field of view.")
    rate_hz: float = number(30.0, 1, 250, "Frames per second.")
    height_m: float = number(1.25, 0.3, 3, "Height of the optical centre.")
    mount: Literal["front", "left", "right", "back"] = setting("front", "Direction of the camera at rest.")
    tilt_deg: float = number(0.0, -45, 45, "Tilt at rest; positive looks up.")
    grey: bool = setting(False, "A grey camera: its luma in each of the three channels.")
    calibration: str | None = setting(None, "YAML file of ROS, OpenCV or Kalibr, read into `calibrated`.")
    calibrated: CalibratedLens | None = setting(None, "Camera matrix and lens in the place of `fovy_deg`.")

    def _contradictions(self) -> Iterator[str]:
        own = self.calibrated
        if own is not None and (own.width_px, own.height_px) != (self.width_px, self.height_px):
            yield (
                f"the calibration is of images of {own.width_px} x {own.height_px}: set camera.width_px and "
                f"camera.height_px to these, got {self.width_px} x {self.height_px}"
            )

    @property
    def K(self) -> NDArray[np.float64]:
        """`(3, 3)` camera matrix; its principal point is from the upper left corner of the image."""
        own = self.calibrated
        if own is not None:
            return np.array([[own.fx, 0.0, own.cx + 0.5], [0.0, own.fy, own.cy + 0.5], [0.0, 0.0, 1.0]])
        focal = 0.5 * self.height_px / math.tan(self.half_view_rad[1])
        return np.array([[focal, 0.0, 0.5 * self.width_px], [0.0, focal, 0.5 * self.height_px], [0.0, 0.0, 1.0]])

    @property
    def half_view_rad(self) -> tuple[float, float]:
        """Half the horizontal and half the vertical field of view, without the lens's distortion."""
        own = self.calibrated
        if own is not None:
            return math.atan(0.5 * own.width_px / own.fx), math.atan(0.5 * own.height_px / own.fy)
        half = math.radians(0.5 * self.fovy_deg)
        return math.atan(math.tan(half) * self.width_px / self.height_px), half


class FurtherCamera(Section):
    """A further camera, fixed to the first one; what is left out of lens and image is that of `camera`."""

    name: str = setting(..., "Name by which observation and truth tell of it.", pattern=NAME)
    left_m: float = number(0.0, -2, 2, "Distance to the left of the first one, in its axes at rest.")
    up_m: float = number(0.0, -2, 2, "Distance above it.")
    ahead_m: float = number(0.0, -2, 2, "Distance before it.")
    pan_deg: Angle = setting(0.0, "How far it is turned to the left; 180 looks back.")
    tilt_deg: float = number(0.0, -90, 90, "Then up.")
    roll_deg: Angle = setting(0.0, "Then clockwise about its axis, as it looks.")
    width_px: int | None = number(None, 16, 4096, "Image width.")
    height_px: int | None = number(None, 16, 4096, "Image height.")
    fovy_deg: float | None = number(None, 5, 130, "Vertical field of view, in the place of a calibration.")
    grey: bool | None = setting(None, "Whether it is grey.")
    calibration: str | None = setting(None, "YAML file of ROS, OpenCV or Kalibr, read into `calibrated`.")
    calibrated: CalibratedLens | None = setting(None, "Camera matrix and lens in the place of `fovy_deg`.")

    def seen_by(self, first: Camera) -> Camera:
        """The camera that takes its images, at the place of the first one."""
        keys = ("width_px", "height_px", "fovy_deg", "grey", "calibrated")
        own = {key: value for key in keys if (value := getattr(self, key)) is not None}
        bare = {"calibrated": None} if self.fovy_deg is not None else {}
        return Camera.model_validate({**dict(first), **bare, **own})

    @property
    def T_camera(self) -> NDArray[np.float64]:
        """`(4, 4)` its pose in the axes of the first one (x right, y down, z forward)."""
        pan, tilt, roll = (math.radians(angle) for angle in (-self.pan_deg, self.tilt_deg, self.roll_deg))
        pose = np.eye(4)
        turns = (cv2.Rodrigues(np.array(turn))[0] for turn in ((0.0, pan, 0.0), (tilt, 0.0, 0.0), (0.0, 0.0, roll)))
        pose[:3, :3] = np.linalg.multi_dot(list(turns))
        pose[:3, 3] = -self.left_m, -self.up_m, self.ahead_m
        return pose
