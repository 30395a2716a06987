"""OpenCV's own trackers that learn while they run, made to give the same bits for the same seed.

`opencv-mil` is in every wheel of OpenCV. The others are in the contrib wheel alone, which excludes the one that this
package asks for; whoever wants them installs it instead.
"""

from __future__ import annotations

import ctypes
import threading
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np

from pftrack_sim.core import boxes, random_streams
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.errors import TrackerError
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.params import check_names, check_preset
from pftrack_sim.trackers.registry import PRESETS

MIN_SIZE_PX = 8
MARGIN_PX = 24  # TrackerMIL learns from boxes about ten pixels away: the image must have room for some
CONTRIB_WHEEL = "opencv-contrib-python-headless"
_seeding = threading.Lock()


@dataclass(frozen=True)
class Kind:
    """One of OpenCV's trackers.

    Attributes:
        class_name: In `cv2`, or in `cv2.legacy`.
        legacy: Which of the two.
        resizes: Whether it follows the target's size; those that do not keep that of the given box.
    """

    class_name: str
    legacy: bool = False
    resizes: bool = True


KINDS = {
    "opencv-csrt": Kind("TrackerCSRT"),
    "opencv-kcf": Kind("TrackerKCF", resizes=False),
    "opencv-medianflow": Kind("TrackerMedianFlow", legacy=True),
    "opencv-mil": Kind("TrackerMIL", resizes=False),
    "opencv-mosse": Kind("TrackerMOSSE", legacy=True, resizes=False),
    "opencv-tld": Kind("TrackerTLD", legacy=True),
}


class OpencvTracker(BaseTracker):
    """One of OpenCV's trackers, with OpenCV's values.

    They start on whole pixels inside the image: each is started on the nearest such box, and what it says is moved back
    by as much as that one was moved; one that does not resize keeps the size of the given box. They measure no
    similarity: confidence is 1, or 0 in a frame where one says that it found nothing, and there the last box is
    repeated.

    Some draw, when they start or later, from the C library's `rand()` and from OpenCV's generator, both shared by the
    whole process. Both are seeded right before every call, so that nobody else's draws are felt. Where the C library
    cannot be reached (Windows) two trackers of the same seed can differ.

    Args:
        name: One of `KINDS`.
        seed: Root seed; the stream `"tracker"` seeds OpenCV.

    Raises:
        TrackerError: It is in the contrib wheel, and another one is installed.
    """

    def __init__(self, name: str, seed: int) -> None:
        super().__init__()
        self._name, self._kind = name, KINDS[name]
        self._create = _creator(name)
        self._rng_seed = seed
        self._rng = random_streams.stream(seed, "tracker")
        self._tracker: Any = None
        self._box = np.zeros(4)
        self._shift = np.zeros(4)

    def _start(self, image: Image, box: Box) -> None:
        inner = _whole_pixels_inside(self._name, image, box)
        rng = random_streams.stream(self._rng_seed, "tracker")
        tracker = self._create()
        with _seeding:
            _seed(rng)
            tracker.init(cv2.cvtColor(image, cv2.COLOR_RGB2BGR), inner)
        self._rng, self._tracker, self._box, self._shift = rng, tracker, box, box - inner

    def _follow(self, image: Image) -> Estimate:
        with _seeding:
            _seed(self._rng)
            found, inner = self._tracker.update(cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
        said = np.array(inner, dtype=np.float64) + self._shift
        if not self._kind.resizes:
            said[2:] = self._box[2:]
        credible = bool(found) and bool(np.isfinite(said).all()) and boxes.area(said) > 0.0
        if credible:
            self._box = said
        return Estimate(self._box, float(credible))


def make(name: str, *, seed: int, preset: str, **params: Any) -> OpencvTracker:
    """Factory of every one; they have no parameters.

    Raises:
        ParameterError: An unknown preset, or any parameter.
        TrackerError: It is in the contrib wheel, and another one is installed.
    """
    check_preset(name, PRESETS, preset)
    check_names(name, [], params)
    return OpencvTracker(name, seed)


make_csrt = partial(make, "opencv-csrt")
make_kcf = partial(make, "opencv-kcf")
make_medianflow = partial(make, "opencv-medianflow")
make_mil = partial(make, "opencv-mil")
make_mosse = partial(make, "opencv-mosse")
make_tld = partial(make, "opencv-tld")


def _creator(name: str) -> Any:
    """OpenCV's `create` of a tracker."""
    kind = KINDS[name]
    home: Any = getattr(cv2, "legacy", None) if kind.legacy else cv2
    found: Any = getattr(home, kind.class_name, None)
    if found is None:
        raise TrackerError(
            f"{name} needs the wheel {CONTRIB_WHEEL}, which excludes opencv-python-headless: uninstall the one before "
            f"you install the other (pip uninstall opencv-python-headless, then pip install '{CONTRIB_WHEEL}>=5')"
        )
    return found.create


def _whole_pixels_inside(name: str, image: Image, box: Box) -> tuple[int, int, int, int]:
    """The box nearest to the given one that OpenCV's trackers can start on."""
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


def _seed(rng: np.random.Generator) -> None:
    """Seed every generator that OpenCV draws from."""
    for_opencv, for_c = (int(one) for one in rng.integers(0, 2**31 - 1, 2))
    cv2.setRNGSeed(for_opencv)
    try:
        ctypes.CDLL(None).srand(ctypes.c_uint(for_c))
    except (TypeError, OSError, AttributeError):
        return  # Windows: no handle on the library OpenCV was built with
