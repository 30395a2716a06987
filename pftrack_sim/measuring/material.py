"""Material to measure in: frames with their times, and the camera that took them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pftrack_sim.camera.pinhole import intrinsics
from pftrack_sim.core.calibration import Calibration, read_calibration
from pftrack_sim.core.errors import ParameterError, SequenceError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats.images import SUFFIXES, ImageFiles, Images, numbered_images, video, video_times
from pftrack_sim.formats.layouts import read_sequence

LEAST_FRAMES = 10
_RATE_HZ = 25.0
_FOVY_DEG = (40.0, 50.0, 62.0)  # Of a camera that nothing is known of: most webcams, phones and robots' cameras


@dataclass(frozen=True, eq=False)
class Material:
    """Frames and when they were taken.

    Attributes:
        times_s: `(N,)` times.
        boxes: `(N, 4)` of something known to move [px]; None if nothing is known.
        timed: Whether the file tells the time of each frame.
        rated: Whether the rate is known; if not, the times are those of 25 frames per second.
        doubts: What may be wrong with the times.
    """

    name: str
    images: Images
    times_s: FloatArray
    boxes: FloatArray | None = None
    timed: bool = False
    rated: bool = True
    doubts: tuple[str, ...] = ()

    @property
    def step_s(self) -> float:
        """Usual time from frame to frame."""
        return float(np.median(np.diff(self.times_s)))


def read_material(path: Path, rate_hz: float | None = None) -> Material:
    """A video, or a folder of a recorded sequence or of numbered images.

    Args:
        path: The file or folder.
        rate_hz: Frames per second, against what the file tells.

    Raises:
        SequenceError: It cannot be read, or has fewer than 10 frames, or times that do not rise.
    """
    if path.is_dir():
        try:
            sequence = read_sequence(path)
            boxes = np.concatenate([np.full((sequence.start, 4), np.nan), sequence.truth])
            images, told = sequence.images, sequence.rate_hz
        except SequenceError:
            if not any(one.suffix.lower() in SUFFIXES for one in path.iterdir()):
                raise
            images, told, boxes = ImageFiles(numbered_images(path)), None, None
        rate, rated = rate_hz or told or _RATE_HZ, bool(rate_hz or told)
        doubts = () if rated else (f"no rate is told: {rate:g} frames per second are taken; see --rate-hz",)
        times = np.arange(len(images)) / rate
        found = Material(path.resolve().name, images, times, boxes, rated=rated, doubts=doubts)
    else:
        images, told = video(path)
        times = video_times(path)
        found = Material(path.name, images, times, timed=rate_hz is None)
        if rate_hz is not None or len(times) != len(images):
            found = replace(found, times_s=np.arange(len(images)) / (rate_hz or told or _RATE_HZ), timed=False)
    if len(found.images) < LEAST_FRAMES:
        raise SequenceError(
            f"{path}: has {len(found.images)} frames; nothing can be told from fewer than {LEAST_FRAMES}"
        )
    if not (np.diff(found.times_s) > 0.0).all():
        raise SequenceError(f"{path}: the times of its frames do not rise; --rate-hz takes them as evenly spaced")
    return found


def camera_of(
    size_px: tuple[int, int], fovy_deg: float | None, calibration: Path | None
) -> tuple[Calibration, tuple[float, float]]:
    """The camera of images of a width and height; least and greatest focal length, as shares of that in its `K`.

    Args:
        size_px: Width and height.
        fovy_deg: Vertical field of view; without it and a calibration, 40 to 62 degrees are taken.
        calibration: YAML file of ROS or OpenCV: `camera_matrix` and `distortion_coefficients`.

    Raises:
        ParameterError: The file has another content, or is of another size of the image.
    """
    width, height = size_px
    if calibration is not None:
        found = read_calibration(calibration)
        if found.size_px not in (None, size_px):
            told = "{}x{}".format(*found.size_px)
            raise ParameterError(f"{calibration}: is of images of {told}, these have {width}x{height}")
        return found, (1.0, 1.0)
    fovys_deg = _FOVY_DEG if fovy_deg is None else (fovy_deg,) * 3
    low, middle, high = (intrinsics(width, height, np.radians(one)) for one in fovys_deg)
    shares = high[0, 0] / middle[0, 0], low[0, 0] / middle[0, 0]
    return Calibration(middle, np.zeros(5), size_px, ""), shares
