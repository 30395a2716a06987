"""Adapters of public libraries: pyxtrackers (ByteTrack, OC-SORT) and norfair; the extra `mot`.

Parameters are those of the library, with its defaults. Identities are numbered anew in the order of appearance, since
both libraries count through all trackers of a process.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from pftrack_sim.core.errors import ParameterError, TrackerError
from pftrack_sim.core.records import Detections, Image, TrackedBoxes
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.multi_object.followed import FollowedPerson, MultiObjectTracker
from pftrack_sim.trackers.parameters import Parameters


class _Numbered:
    """Identities from 1 in the order of appearance."""

    def __init__(self) -> None:
        self._known: dict[int, int] = {}

    def tracks(self, corners: FloatArray, identities: list[int]) -> TrackedBoxes:
        """Tracks of `(N, 4)` left, top, right, bottom [px]; boxes without extent are left out."""
        numbers = [self._known.setdefault(one, len(self._known) + 1) for one in identities]
        kept = (corners[:, 2:] > corners[:, :2]).all(axis=1)
        boxes = np.concatenate([corners[:, :2], corners[:, 2:] - corners[:, :2]], axis=1)
        return TrackedBoxes(boxes[kept], np.array(numbers, dtype=np.int64)[kept])


class PyxTracker:
    """ByteTrack or OC-SORT of pyxtrackers, which has the output of their authors' code."""

    def __init__(self, kind: Callable[..., Any], params: Mapping[str, Any]) -> None:
        self._tracker = kind(**params)
        self._numbered = _Numbered()

    def update(self, detections: Detections, image: Image) -> TrackedBoxes:
        """Identify detections; the image is not used."""
        boxes = detections.boxes
        rows = np.column_stack([boxes[:, :2], boxes[:, :2] + boxes[:, 2:], detections.scores])
        found = np.asarray(self._tracker.update(rows), dtype=np.float64).reshape(-1, 5)
        return self._numbered.tracks(found[:, :4], found[:, 4].astype(int).tolist())


class NorfairTracker:
    """norfair's Kalman tracker on the overlap of boxes."""

    def __init__(self, library: Any, params: Mapping[str, Any]) -> None:
        self._library = library
        self._tracker = library.Tracker(**params)
        self._numbered = _Numbered()

    def update(self, detections: Detections, image: Image) -> TrackedBoxes:
        """Identify detections; the image is not used."""
        corners = [np.array([box[:2], box[:2] + box[2:]]) for box in detections.boxes]
        found = self._tracker.update(
            [
                self._library.Detection(points, scores=np.full(2, score))
                for points, score in zip(corners, detections.scores.tolist(), strict=True)
            ]
        )
        boxes = np.array([one.estimate for one in found], dtype=np.float64).reshape(-1, 4)
        return self._numbered.tracks(boxes, [int(one.id) for one in found])


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
        return PyxTracker(getattr(library, _PYX[name]), given) if name in _PYX else NorfairTracker(library, given)

    try:
        fresh()
    except (TypeError, ValueError) as error:
        raise ParameterError(f"{name}: {package} refuses its parameters: {error}") from None
    return FollowedPerson(fresh)
