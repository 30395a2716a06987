"""Adapters of public libraries: pyxtrackers (ByteTrack, OC-SORT) and norfair; the extra `mot`.

Parameters are those of the library, with its defaults. Identities are numbered anew in the order of appearance.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np

from pftrack_sim.core.errors import ParameterError, TrackerError
from pftrack_sim.core.records import Detections, Image, TrackedBoxes
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.multi_object.followed import FollowedPerson, MultiObjectTracker
from pftrack_sim.trackers.parameters import Parameters

Identify: TypeAlias = Callable[[FloatArray, FloatArray], tuple[FloatArray, list[int]]]
"""`(M, 4)` left, top, right, bottom [px] of M tracks and their identities, given `(N, 4)` and `(N,)` scores."""


class LibraryTracker:
    """A tracker of a library, with identities from 1 in the order of appearance."""

    def __init__(self, identify: Identify) -> None:
        self._identify = identify
        self._known: dict[int, int] = {}

    def update(self, detections: Detections, image: Image) -> TrackedBoxes:
        """Identify detections; the image is not used. Tracks without extent are left out."""
        boxes = detections.boxes
        corners, identities = self._identify(np.hstack([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]]), detections.scores)
        numbers = [self._known.setdefault(one, len(self._known) + 1) for one in identities]
        kept = (corners[:, 2:] > corners[:, :2]).all(axis=1)
        tracked = np.hstack([corners[:, :2], corners[:, 2:] - corners[:, :2]])
        return TrackedBoxes(tracked[kept], np.array(numbers, dtype=np.int64)[kept])


def _pyxtrackers(tracker: Any) -> Identify:
    """ByteTrack or OC-SORT of pyxtrackers, which has the output of their authors' code."""

    def identify(corners: FloatArray, scores: FloatArray) -> tuple[FloatArray, list[int]]:
        found = np.asarray(tracker.update(np.column_stack([corners, scores])), dtype=np.float64).reshape(-1, 5)
        return found[:, :4], found[:, 4].astype(int).tolist()

    return identify


def _norfair(library: Any, tracker: Any) -> Identify:
    """The Kalman tracker of norfair, on the overlap of boxes."""

    def identify(corners: FloatArray, scores: FloatArray) -> tuple[FloatArray, list[int]]:
        pairs = zip(corners.reshape(-1, 2, 2), scores.tolist(), strict=True)
        found = tracker.update([library.Detection(points, scores=np.full(2, score)) for points, score in pairs])
        return np.array([one.estimate for one in found], dtype=np.float64).reshape(-1, 4), [
            int(one.id) for one in found
        ]

    return identify


_PYX = {"bytetrack": "BYTETracker", "ocsort": "OCSort"}
_GIVEN: Mapping[str, Mapping[str, Any]] = {
    "bytetrack": {},
    "ocsort": {"det_thresh": 0.3},
    "norfair": {"distance_function": "iou", "distance_threshold": 0.7},
}
"""Parameters for which a library has no default; norfair's matches from an overlap of 0.3 on, as SORT."""


def make(name: str, *, seed: int, preset: str, **params: Any) -> FollowedPerson:
    """Make `bytetrack`, `ocsort` or `norfair`; parameters are those of the library.

    Raises:
        TrackerError: The library is not installed.
        ParameterError: It refuses a parameter.
    """
    Parameters.from_preset(name, preset, {})
    package = "pyxtrackers" if name in _PYX else "norfair"
    try:
        library: Any = importlib.import_module(package)
    except ImportError:
        raise TrackerError(f"{name} needs the package {package}: pip install 'pftrack-sim[mot]'") from None

    def fresh() -> MultiObjectTracker:
        given = {**_GIVEN[name], **params}
        if name in _PYX:
            return LibraryTracker(_pyxtrackers(getattr(library, _PYX[name])(**given)))
        return LibraryTracker(_norfair(library, library.Tracker(**given)))

    try:
        fresh()
    except (TypeError, ValueError) as error:
        raise ParameterError(f"{name}: {package} refuses its parameters: {error}") from None
    return FollowedPerson(fresh)
