"""OpenCV's trackers that learn on line, with reproducible random numbers.

`opencv-mil` is in every wheel of OpenCV. The others need the contrib wheel, which excludes the wheel that this package
depends on.
"""

from __future__ import annotations

import ctypes
import threading
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

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
    """A tracker of OpenCV with OpenCV's default parameters.

    OpenCV starts on whole pixels inside the image: the tracker starts on the nearest such box, and its outputs are
    shifted back by the same offset. OpenCV measures no similarity: confidence is 1, or 0 in frames where OpenCV reports
    a loss; there the last box is repeated.

    Some trackers draw from the C library's `rand()` and from OpenCV's generator, which the whole process shares. Both
    are seeded before every call, so that other draws have no effect. Where the C library cannot be reached (Windows)
    two trackers of the same seed can differ.

    Args:
        name: One of `CLASSES`.
        seed: Root seed; the stream `"tracker"` seeds OpenCV.

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


def make(name: str, *, seed: int, preset: str, **params: Any) -> OpencvTracker:
    """Make one of `CLASSES`, which have no parameters; raises ParameterError, or TrackerError if it needs contrib."""
    Parameters.from_preset(name, preset, params)
    return OpencvTracker(name, seed)


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
