"""OpenCV's trackers that are pre-trained networks. The user supplies the model files (OpenCV's model zoo has them).

    trackers.make("opencv-vit", model="vittrack.onnx")

They do not learn on line and use no random numbers.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import cv2
import numpy as np
from pydantic import Field

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.errors import TrackerError
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.parameters import Parameters


class ModelFiles(Parameters):
    """Model files of a network; aliases are the names in OpenCV's own parameters."""

    CV2_CLASS: ClassVar[str]


class DaSiamRpnFiles(ModelFiles):
    """Model files of `opencv-dasiamrpn`."""

    CV2_CLASS: ClassVar[str] = "TrackerDaSiamRPN"
    model: Path | None = None
    kernel_cls1: Path | None = None
    kernel_r1: Path | None = None


class NanoFiles(ModelFiles):
    """Model files of `opencv-nano`."""

    CV2_CLASS: ClassVar[str] = "TrackerNano"
    backbone: Path | None = None
    neckhead: Path | None = None


class VitFiles(ModelFiles):
    """Model file of `opencv-vit`."""

    CV2_CLASS: ClassVar[str] = "TrackerVit"
    model: Path | None = Field(None, serialization_alias="net")


NETWORKS: dict[str, type[ModelFiles]] = {
    "opencv-dasiamrpn": DaSiamRpnFiles,
    "opencv-nano": NanoFiles,
    "opencv-vit": VitFiles,
}


class NetworkTracker(BaseTracker):
    """A network of OpenCV with OpenCV's default parameters.

    Confidence is the network's own score, OpenCV's `getTrackingScore`, clipped to [0, 1]. In frames where OpenCV
    reports a loss the last box is repeated with confidence 0.

    Args:
        name: One of `NETWORKS`.
        files: Model files, all given.

    Raises:
        TrackerError: A file is no model.
    """

    def __init__(self, name: str, files: ModelFiles) -> None:
        super().__init__()
        self._name, self._files = name, files
        self._create()  # report invalid files now, not at the first frame

    def _start(self, image: Image, box: Box) -> None:
        height, width = image.shape[:2]
        inside = boxes.clip(box, width, height)
        x, y = min(int(inside[0]), width - 1), min(int(inside[1]), height - 1)
        w, h = (max(round(float(inside[k])), 1) for k in (2, 3))
        # OpenCV cannot reset a network's template: a new tracker is made.
        tracker = self._create()
        tracker.init(cv2.cvtColor(image, cv2.COLOR_RGB2BGR), (x, y, min(w, width - x), min(h, height - y)))
        self._tracker, self._box = tracker, box

    def _follow(self, image: Image) -> Estimate:
        found, output = self._tracker.update(cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
        box = np.array(output, dtype=np.float64)
        if not found or not np.isfinite(box).all() or boxes.area(box) == 0.0:
            return Estimate(self._box, 0.0)
        self._box = box
        score = float(self._tracker.getTrackingScore())
        return Estimate(box, min(max(score, 0.0), 1.0) if np.isfinite(score) else 0.0)

    def _create(self) -> Any:
        options: Any = getattr(cv2, f"{self._files.CV2_CLASS}_Params")()
        for key, path in self._files.model_dump(by_alias=True).items():
            setattr(options, key, str(path))
        try:
            return getattr(cv2, self._files.CV2_CLASS).create(options)
        except cv2.error as error:
            given = ", ".join(f"{key}={path}" for key, path in self._files)
            reason = " ".join(str(error).split())[:200]
            raise TrackerError(
                f"{self._name}: OpenCV cannot read these files as its model ({given}): {reason}"
            ) from None


def make(name: str, *, seed: int, preset: str, **params: Any) -> NetworkTracker:
    """Make one of `NETWORKS`. Parameters are the paths of its model files, all required.

    Raises:
        ParameterError: An unknown preset or parameter, or a value that is no path.
        TrackerError: A file is not given, missing, cannot be read, or is no model.
    """
    files = NETWORKS[name].from_preset(name, preset, params)
    missing = ", ".join(key for key, path in files if path is None)
    if missing:
        shown = ", ".join(f'{key}="FILE.onnx"' for key, _ in files)
        raise TrackerError(f"{name} needs model files that you give: missing {missing} (make with {shown})")
    for key, path in files:
        _check_readable(f"{name}: {key}", path)
    return NetworkTracker(name, files)


def _check_readable(what: str, path: Path) -> None:
    try:
        with path.open("rb") as file:
            empty = not file.read(1)
    except OSError as error:
        raise TrackerError(f"{what}: cannot read the model file {path}: {error.strerror}") from None
    if empty:
        raise TrackerError(f"{what}: the model file {path} is empty")
