"""OpenCV's trackers that are trained networks; the model files are the user's.

    trackers.make("opencv-vit", model="vittrack.onnx")

None of them learns while it runs, and none draws a random number. OpenCV's model zoo (opencv/opencv_zoo) has the files.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.errors import ParameterError, TrackerError
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.params import check_names, check_preset
from pftrack_sim.trackers.registry import PRESETS


@dataclass(frozen=True)
class Kind:
    """One of them.

    Attributes:
        class_name: In `cv2`.
        files: Our parameter for each model file, and what `cv2`'s own parameters call it.
    """

    class_name: str
    files: Mapping[str, str]


KINDS = {
    "opencv-dasiamrpn": Kind(
        "TrackerDaSiamRPN", {"model": "model", "kernel_cls1": "kernel_cls1", "kernel_r1": "kernel_r1"}
    ),
    "opencv-nano": Kind("TrackerNano", {"backbone": "backbone", "neckhead": "neckhead"}),
    "opencv-vit": Kind("TrackerVit", {"model": "net"}),
}


class NetworkTracker(BaseTracker):
    """One of OpenCV's networks, with OpenCV's values.

    Confidence is the network's own score, OpenCV's `getTrackingScore`, brought into [0, 1]: how alike it holds box and
    target to be. In a frame where it says that it found nothing the last box is repeated with confidence 0.

    Args:
        name: One of `KINDS`.
        paths: A model file for each of its parameters.

    Raises:
        TrackerError: A file is missing, cannot be read, or is no model.
    """

    def __init__(self, name: str, paths: Mapping[str, Path]) -> None:
        super().__init__()
        self._name, self._paths = name, dict(paths)
        self._create()  # what is wrong with the files is told now, not at the first frame
        self._tracker: Any = None
        self._box = np.zeros(4)

    def _start(self, image: Image, box: Box) -> None:
        height, width = image.shape[:2]
        inside = boxes.clip(box, width, height)
        x, y = min(int(inside[0]), width - 1), min(int(inside[1]), height - 1)
        w, h = (max(round(float(inside[k])), 1) for k in (2, 3))
        # A network's memory of its target cannot be cleared: a new one forgets everything.
        tracker = self._create()
        tracker.init(cv2.cvtColor(image, cv2.COLOR_RGB2BGR), (x, y, min(w, width - x), min(h, height - y)))
        self._tracker, self._box = tracker, box

    def _follow(self, image: Image) -> Estimate:
        found, said = self._tracker.update(cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
        box = np.array(said, dtype=np.float64)
        if not found or not np.isfinite(box).all() or boxes.area(box) == 0.0:
            return Estimate(self._box, 0.0)
        self._box = box
        score = float(self._tracker.getTrackingScore())
        return Estimate(box, min(max(score, 0.0), 1.0) if np.isfinite(score) else 0.0)

    def _create(self) -> Any:
        kind = KINDS[self._name]
        options: Any = getattr(cv2, f"{kind.class_name}_Params")()
        for key, theirs in kind.files.items():
            setattr(options, theirs, str(self._paths[key]))
        try:
            return getattr(cv2, kind.class_name).create(options)
        except cv2.error as error:
            files = ", ".join(f"{key}={self._paths[key]}" for key in kind.files)
            reason = " ".join(str(error).split())[:200]
            raise TrackerError(
                f"{self._name}: OpenCV cannot read these files as its model ({files}): {reason}"
            ) from None


def make(name: str, *, seed: int, preset: str, **params: Any) -> NetworkTracker:
    """Factory of each; its parameters are paths of model files, all needed.

    Raises:
        ParameterError: An unknown preset or parameter, or a path that is none.
        TrackerError: A file is not given, missing, cannot be read, or is no model.
    """
    check_preset(name, PRESETS, preset)
    wanted = list(KINDS[name].files)
    check_names(name, wanted, params)
    absent = [key for key in wanted if params.get(key) is None]
    if absent:
        shown = ", ".join(f'{key}="FILE.onnx"' for key in wanted)
        raise TrackerError(f"{name} needs model files that you give: missing {', '.join(absent)} (make with {shown})")
    return NetworkTracker(name, {key: _readable(f"{name}: {key}", params[key]) for key in wanted})


make_dasiamrpn = partial(make, "opencv-dasiamrpn")
make_nano = partial(make, "opencv-nano")
make_vit = partial(make, "opencv-vit")


def _readable(what: str, given: Any) -> Path:
    if not isinstance(given, (str, os.PathLike)):
        raise ParameterError(f"{what} must be the path of a model file, got {given!r}")
    path = Path(os.fspath(given))  # pyright: ignore[reportUnknownArgumentType]
    try:
        with path.open("rb") as file:
            empty = not file.read(1)
    except OSError as error:
        raise TrackerError(f"{what}: cannot read the model file {path}: {error.strerror}") from None
    if empty:
        raise TrackerError(f"{what}: the model file {path} is empty")
    return path
