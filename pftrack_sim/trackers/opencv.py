"""OpenCV's own trackers, made to give the same bits for the same seed."""

from __future__ import annotations

import ctypes
import threading
from typing import Any

import cv2
import numpy as np

from pftrack_sim import streams
from pftrack_sim.boxes import Box
from pftrack_sim.errors import TrackerError
from pftrack_sim.records import Estimate, Image
from pftrack_sim.trackers.checked import CheckedTracker
from pftrack_sim.trackers.params import check_names, check_preset
from pftrack_sim.trackers.registry import PRESETS

MIN_SIZE_PX = 8
MARGIN_PX = 24  # TrackerMIL learns from boxes about ten pixels away: the image must have room for some
_seeding = threading.Lock()


class OpencvMil(CheckedTracker):
    """`cv2.TrackerMIL` (Babenko, Yang & Belongie 2009), with OpenCV's values.

    It keeps the size of the first box and takes whole pixels only, inside the image: it is started on the nearest such
    box, and how far that one moves is how far the given box is moved. It measures no similarity: its confidence is 1,
    or 0 in a frame where it says that it found nothing, and there the last box is repeated.

    TrackerMIL draws its features, when it starts, from the C library's `rand()` and from OpenCV's generator, both
    shared by the whole process; from then on it goes its own way. Both are seeded right before the start. Where the C
    library cannot be reached (Windows) two trackers of the same seed can differ.

    Args:
        seed: Root seed; the stream `"tracker"` seeds OpenCV.
    """

    def __init__(self, seed: int) -> None:
        super().__init__()
        self._seeds = [int(one) for one in streams.stream(seed, "tracker").integers(0, 2**31 - 1, 2)]
        self._tracker: Any = None
        self._box = np.zeros(4)
        self._offset = np.zeros(2)

    def _start(self, image: Image, box: Box) -> None:
        inner = _whole_pixels_inside(image, box)
        tracker = cv2.TrackerMIL.create()
        with _seeding:
            cv2.setRNGSeed(self._seeds[0])
            _seed_c_library(self._seeds[1])
            tracker.init(cv2.cvtColor(image, cv2.COLOR_RGB2BGR), inner)
        self._tracker, self._box, self._offset = tracker, box, box[:2] - inner[:2]

    def _follow(self, image: Image) -> Estimate:
        found, inner = self._tracker.update(cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
        if found:
            self._box = np.concatenate([np.array(inner[:2]) + self._offset, self._box[2:]])
        return Estimate(self._box, float(found))


def make_mil(*, seed: int, preset: str, **params: Any) -> OpencvMil:
    """Factory of `opencv-mil`; it has no parameters."""
    check_preset("opencv-mil", PRESETS, preset)
    check_names("opencv-mil", [], params)
    return OpencvMil(seed)


def _whole_pixels_inside(image: Image, box: Box) -> tuple[int, int, int, int]:
    """The box nearest to the given one that TrackerMIL can start on."""
    sides: list[tuple[int, int]] = []
    for start, size, room in ((box[0], box[2], image.shape[1]), (box[1], box[3], image.shape[0])):
        longest = room - MARGIN_PX
        if longest < MIN_SIZE_PX:
            least = MIN_SIZE_PX + MARGIN_PX
            raise TrackerError(f"opencv-mil needs an image of at least {least}x{least} pixels")
        low, high = max(start, 0.0), min(start + size, float(room))
        whole = min(max(round(high - low), MIN_SIZE_PX), longest)
        sides.append((min(max(round(0.5 * (low + high - whole)), 0), room - whole), whole))
    (x, w), (y, h) = sides
    return x, y, w, h


def _seed_c_library(seed: int) -> None:
    try:
        ctypes.CDLL(None).srand(ctypes.c_uint(seed))
    except (TypeError, OSError, AttributeError):
        return  # Windows: no handle on the library OpenCV was built with
