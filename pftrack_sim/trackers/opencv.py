"""Trackers of OpenCV: those that learn on line, with reproducible random numbers, and pre-trained networks.

`opencv-mil` is in every wheel of OpenCV. The others that learn on line need the contrib wheel, which excludes the wheel
that this package depends on. For networks the user supplies the model files (OpenCV's model zoo has them):
`trackers.make("opencv-vit", model="vittrack.onnx")`. They do not learn on line and use no random numbers.
"""

from __future__ import annotations

import ctypes
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from pydantic import create_model

from pftrack_sim.core import boxes, random_streams
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.errors import TrackerError
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.parameters import Parameters

MIN_SIZE_PX = 8
MARGIN_PX = 24  # TrackerMIL samples boxes about ten pixels away: the image must have room for some
CONTRIB_WHEEL = "opencv-contrib-python-headless"
_seeding = threading.Lock()


@dataclass(frozen=True)
class OpencvClass:
    """A tracker class of OpenCV.

    Attributes:
        name: In `cv2`, or in `cv2.legacy`.
        legacy: Whether it is in `cv2.legacy`.
        adapts_size: Whether it follows the target's size; otherwise the size of the first box is kept.
    """

    name: str
    legacy: bool = False
    adapts_size: bool = True


CLASSES = {
    "opencv-csrt": OpencvClass("TrackerCSRT"),
    "opencv-kcf": OpencvClass("TrackerKCF", adapts_size=False),
    "opencv-medianflow": OpencvClass("TrackerMedianFlow", legacy=True),
    "opencv-mil": OpencvClass("TrackerMIL", adapts_size=False),
    "opencv-mosse": OpencvClass("TrackerMOSSE", legacy=True, adapts_size=False),
    "opencv-tld": OpencvClass("TrackerTLD", legacy=True),
}


class OpencvTracker(BaseTracker):
    """A tracker of OpenCV, one of `CLASSES`, with OpenCV's default parameters.

    OpenCV starts on whole pixels inside the image: the tracker starts on the nearest such box, and its outputs are
    shifted back by the same offset. OpenCV measures no similarity: confidence is 1, or 0 in frames where OpenCV reports
    a loss; there the last box is repeated.

    Some trackers draw from the C library's `rand()` and from OpenCV's generator, which the whole process shares. Both
    are seeded before every call, from the stream `"tracker"` of the root seed, so that other draws have no effect.
    Where the C library cannot be reached (Windows) two trackers of the same seed can differ.

    Raises:
        TrackerError: The tracker needs the contrib wheel, and another one is installed.
    """

    def __init__(self, name: str, seed: int) -> None:
        super().__init__()
        self._name = name
        self._create = _creator(name)
        self._seed = seed

    def _start(self, image: Image, box: Box) -> None:
        inner = _whole_pixels_inside(self._name, image, box)
        rng = random_streams.stream(self._seed, "tracker")
        tracker = self._create()
        with _seeding:
            _seed_opencv(rng)
            tracker.init(cv2.cvtColor(image, cv2.COLOR_RGB2BGR), inner)
        self._rng, self._tracker, self._box, self._offset = rng, tracker, box, box - inner

    def _follow(self, image: Image) -> Estimate:
        with _seeding:
            _seed_opencv(self._rng)
            found, inner = self._tracker.update(cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
        box = np.array(inner, dtype=np.float64) + self._offset
        if not CLASSES[self._name].adapts_size:
            box[2:] = self._box[2:]
        valid = bool(found) and bool(np.isfinite(box).all()) and boxes.area(box) > 0.0
        if valid:
            self._box = box
        return Estimate(self._box, float(valid))


def _creator(name: str) -> Any:
    """OpenCV's `create` of a tracker."""
    wanted = CLASSES[name]
    module: Any = getattr(cv2, "legacy", None) if wanted.legacy else cv2
    found: Any = getattr(module, wanted.name, None)
    if found is None:
        raise TrackerError(
            f"{name} needs the wheel {CONTRIB_WHEEL}, which excludes opencv-python-headless: uninstall the one before "
            f"you install the other (pip uninstall opencv-python-headless, then pip install '{CONTRIB_WHEEL}>=5')"
        )
    return found.create


def _whole_pixels_inside(name: str, image: Image, box: Box) -> tuple[int, int, int, int]:
    """The nearest box that OpenCV's trackers can start on."""
    sides: list[tuple[int, int]] = []
    for start, size, room in ((box[0], box[2], image.shape[1]), (box[1], box[3], image.shape[0])):
        longest = room - MARGIN_PX
        if longest < MIN_SIZE_PX:
            least = MIN_SIZE_PX + MARGIN_PX
            raise TrackerError(f"{name} needs an image of at least {least}x{least} pixels")
        low, high = max(start, 0.0), min(start + size, float(room))
        whole = min(max(round(high - low), MIN_SIZE_PX), longest)
        sides.append((min(max(round(0.5 * (low + high - whole)), 0), room - whole), whole))
    (x, w), (y, h) = sides
    return x, y, w, h


def _seed_opencv(rng: np.random.Generator) -> None:
    """Seed every generator that OpenCV draws from."""
    for_opencv, for_c = (int(value) for value in rng.integers(0, 2**31 - 1, 2))
    cv2.setRNGSeed(for_opencv)
    try:
        ctypes.CDLL(None).srand(ctypes.c_uint(for_c))
    except (TypeError, OSError, AttributeError):
        return  # Windows: no handle on the library OpenCV was built with


def _files(*names: str) -> type[Parameters]:
    """Parameters that are paths of model files."""
    fields: Any = dict.fromkeys(names, (Path | None, None))
    return create_model("ModelFiles", __base__=Parameters, **fields)


NETWORKS: dict[str, tuple[str, type[Parameters]]] = {
    "opencv-dasiamrpn": ("TrackerDaSiamRPN", _files("model", "kernel_cls1", "kernel_r1")),
    "opencv-nano": ("TrackerNano", _files("backbone", "neckhead")),
    "opencv-vit": ("TrackerVit", _files("model")),
}
"""OpenCV's class of each network, and its model files."""
_OPENCV_NAMES = {("opencv-vit", "model"): "net"}
"""Model files that OpenCV's own parameters name otherwise."""


class NetworkTracker(BaseTracker):
    """A network of OpenCV, one of `NETWORKS` with its model files, with OpenCV's default parameters.

    Confidence is the network's own score, OpenCV's `getTrackingScore`, clipped to [0, 1]. In frames where OpenCV
    reports a loss the last box is repeated with confidence 0.

    Raises:
        TrackerError: A file is no model.
    """

    def __init__(self, name: str, files: Parameters) -> None:
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
        kind, _ = NETWORKS[self._name]
        options: Any = getattr(cv2, f"{kind}_Params")()
        for key, path in self._files:
            setattr(options, _OPENCV_NAMES.get((self._name, key), key), str(path))
        try:
            return getattr(cv2, kind).create(options)
        except cv2.error as error:
            given = ", ".join(f"{key}={path}" for key, path in self._files)
            reason = " ".join(str(error).split())[:200]
            raise TrackerError(
                f"{self._name}: OpenCV cannot read these files as its model ({given}): {reason}"
            ) from None


def _check_readable(what: str, path: Path) -> None:
    try:
        with path.open("rb") as file:
            empty = not file.read(1)
    except OSError as error:
        raise TrackerError(f"{what}: cannot read the model file {path}: {error.strerror}") from None
    if empty:
        raise TrackerError(f"{what}: the model file {path} is empty")


def make(name: str, *, seed: int, preset: str, **params: Any) -> OpencvTracker | NetworkTracker:
    """Make one of `CLASSES`, which have no parameters, or of `NETWORKS`, whose parameters are its model files.

    Raises:
        ParameterError: An unknown preset or parameter, or a value that is no path.
        TrackerError: The tracker needs the contrib wheel, or a file is not given, missing, cannot be read, or no model.
    """
    if name in CLASSES:
        Parameters.from_preset(name, preset, params)
        return OpencvTracker(name, seed)
    files = NETWORKS[name][1].from_preset(name, preset, params)
    missing = ", ".join(key for key, path in files if path is None)
    if missing:
        shown = ", ".join(f'{key}="FILE.onnx"' for key, _ in files)
        raise TrackerError(f"{name} needs model files that you give: missing {missing} (make with {shown})")
    for key, path in files:
        _check_readable(f"{name}: {key}", path)
    return NetworkTracker(name, files)
