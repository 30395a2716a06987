"""OpenCV's trackers that are pre-trained networks. The user supplies the model files (OpenCV's model zoo has them).

    trackers.make("opencv-vit", model="vittrack.onnx")

They do not learn on line and use no random numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.errors import TrackerError
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.parameters import Parameters


class DaSiamRpnFiles(Parameters):
    """Model files of `opencv-dasiamrpn`."""

    model: Path | None = None
    kernel_cls1: Path | None = None
    kernel_r1: Path | None = None


class NanoFiles(Parameters):
    """Model files of `opencv-nano`."""

    backbone: Path | None = None
    neckhead: Path | None = None


class VitFiles(Parameters):
    """Model file of `opencv-vit`."""

    model: Path | None = None


@dataclass(frozen=True)
class Network:
    """A network tracker of OpenCV.

    Attributes:
        class_name: In `cv2`.
        files: Parameters of the tracker: one model file each.
        renamed: Parameters whose name differs in `cv2`'s own parameters.
    """

    class_name: str
    files: type[Parameters]
    renamed: Mapping[str, str]


NETWORKS = {
    "opencv-dasiamrpn": Network("TrackerDaSiamRPN", DaSiamRpnFiles, {}),
    "opencv-nano": Network("TrackerNano", NanoFiles, {}),
    "opencv-vit": Network("TrackerVit", VitFiles, {"model": "net"}),
}


class NetworkTracker(BaseTracker):
    """A network of OpenCV with OpenCV's default parameters.

    Confidence is the network's own score, OpenCV's `getTrackingScore`, clipped to [0, 1]. In frames where OpenCV
    reports a loss the last box is repeated with confidence 0.

    Args:
        name: One of `NETWORKS`.
        paths: A model file for each parameter.

    Raises:
        TrackerError: A file is no model.
    """

    def __init__(self, name: str, paths: Mapping[str, Path]) -> None:
        super().__init__()
        self._name, self._paths = name, dict(paths)
        self._create()  # report invalid files now, not at the first frame
        self._tracker: Any = None
        self._box = np.zeros(4)

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
        network = NETWORKS[self._name]
        options: Any = getattr(cv2, f"{network.class_name}_Params")()
        for key, path in self._paths.items():
            setattr(options, network.renamed.get(key, key), str(path))
        try:
            return getattr(cv2, network.class_name).create(options)
        except cv2.error as error:
            files = ", ".join(f"{key}={path}" for key, path in self._paths.items())
            reason = " ".join(str(error).split())[:200]
            raise TrackerError(
                f"{self._name}: OpenCV cannot read these files as its model ({files}): {reason}"
            ) from None


def make(name: str, *, seed: int, preset: str, **params: Any) -> NetworkTracker:
    """Make one of `NETWORKS`. Parameters are the paths of its model files, all required.

    Raises:
        ParameterError: An unknown preset or parameter, or a value that is no path.
        TrackerError: A file is not given, missing, cannot be read, or is no model.
    """
    files: dict[str, Path | None] = dict(NETWORKS[name].files.from_preset(name, preset, params))
    paths = {key: path for key, path in files.items() if path is not None}
    if len(paths) < len(files):
        missing, shown = (
            ", ".join(key for key in files if key not in paths),
            ", ".join(f'{key}="FILE.onnx"' for key in files),
        )
        raise TrackerError(f"{name} needs model files that you give: missing {missing} (make with {shown})")
    for key, path in paths.items():
        _check_readable(f"{name}: {key}", path)
    return NetworkTracker(name, paths)


def _check_readable(what: str, path: Path) -> None:
    try:
        with path.open("rb") as file:
            empty = not file.read(1)
    except OSError as error:
        raise TrackerError(f"{what}: cannot read the model file {path}: {error.strerror}") from None
    if empty:
        raise TrackerError(f"{what}: the model file {path} is empty")
