"""One person followed by a multi-object tracker."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, cast, runtime_checkable

import numpy as np

from pftrack_sim.core.boxes import Box, centre, pairwise_iou
from pftrack_sim.core.errors import TrackerError
from pftrack_sim.core.records import Detections, Estimate, Image, TrackedBoxes
from pftrack_sim.core.types import BoolArray
from pftrack_sim.trackers.base import BaseTracker

_REACH = 1.0
"""Largest distance from the last box to that of a track that takes over, in heights of the box."""


@runtime_checkable
class MultiObjectTracker(Protocol):
    """Follows everybody: detections in, boxes with identities out."""

    def update(self, detections: Detections, image: Image) -> TrackedBoxes:
        """Identify the people detected in the next `(H, W, 3)` uint8 image."""
        ...


class FollowedPerson(BaseTracker):
    """A multi-object tracker as a tracker of one person; it implements `NeedsDetections`.

    The person is the track that overlaps the first box most. Where the track has no box, the last one stays, with
    confidence 0. A track that begins later takes over if it overlaps the last box or is within one height of it; tracks
    that were there together with the person are somebody else.

    Args:
        factory: Makes a fresh multi-object tracker, for each episode.
    """

    def __init__(self, factory: Callable[[], MultiObjectTracker]) -> None:
        super().__init__()
        self._factory = factory
        self._detections: Detections | None = None
        self.tracks: TrackedBoxes | None = None

    def receive_detections(self, detections: Detections) -> None:
        """Receive the detections of the next frame."""
        self._detections = detections

    def _start(self, image: Image, box: Box) -> None:
        self._tracker = self._factory()
        self._box, self._identity = box, None
        self._others = np.empty(0, np.int64)
        tracks = self._update(image)
        self._identity = self._nearest(tracks, np.ones(len(tracks), np.bool_))
        self._remember(tracks)

    def _follow(self, image: Image) -> Estimate:
        tracks = self._update(image)
        if tracks.box(self._identity) is None:
            new = ~np.isin(tracks.identities, self._others)
            found = self._nearest(tracks, new)
            self._identity = self._identity if found is None else found
        box = tracks.box(self._identity)
        if box is None:
            return Estimate(self._box, confidence=0.0, occluded=True)
        self._box = box
        self._remember(tracks)
        return Estimate(box)

    def _update(self, image: Image) -> TrackedBoxes:
        if self._detections is None:
            raise TrackerError("this tracker follows detections and got none")
        # Of somebody else's tracker, which may return anything.
        tracks = cast("object", self._tracker.update(self._detections, image))
        if not isinstance(tracks, TrackedBoxes):
            raise TrackerError(f"a multi-object tracker must return TrackedBoxes, got {type(tracks).__name__}")
        self.tracks, self._detections = tracks, None
        return tracks

    def _remember(self, tracks: TrackedBoxes) -> None:
        """Note who is there beside the person."""
        if self._identity is not None:
            others = tracks.identities[tracks.identities != self._identity]
            self._others = np.union1d(self._others, others)

    def _nearest(self, tracks: TrackedBoxes, allowed: BoolArray) -> int | None:
        """Identity of the allowed track that overlaps the last box most, or else is nearest to it; None: none is."""
        if not allowed.any():
            return None
        boxes, identities = tracks.boxes[allowed], tracks.identities[allowed]
        overlap = pairwise_iou(boxes, self._box)
        if overlap.max() > 0.0:
            return int(identities[np.argmax(overlap)])
        gaps = np.linalg.norm(centre(boxes) - centre(self._box), axis=1)
        return int(identities[np.argmin(gaps)]) if gaps.min() <= _REACH * self._box[3] else None
