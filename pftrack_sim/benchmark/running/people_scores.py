"""Scores of multi-object trackers in an episode: everybody in view, as the MOT layout holds them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pftrack_sim.benchmark.running.tracker_runner import TrackerRunner
from pftrack_sim.core.records import Frame, TrackedBoxes
from pftrack_sim.core.types import FloatArray
from pftrack_sim.score.multi_object import Tracks, multi_object

SCORES = ("hota", "deta", "assa", "idf1", "mota", "switches")
"""Columns of the summary; see `score.multi_object`."""


class TrueTracks:
    """Identity and box of everybody in view in each frame; 1 is the target."""

    def __init__(self) -> None:
        self._identities: dict[str, int] = {}
        self.frames: list[TrackedBoxes] = []

    def add(self, frame: Frame) -> None:
        """Add a frame."""
        self._identities.setdefault(frame.truth.name, 1)
        there = [one for one in frame.people if one.state != "out_of_view"]
        numbers = [self._identities.setdefault(one.name, len(self._identities) + 1) for one in there]
        self.frames.append(TrackedBoxes(np.array([one.box for one in there]).reshape(-1, 4), np.array(numbers)))


def has_tracks(runner: TrackerRunner) -> bool:
    """Whether a tracker said whom it follows besides the target."""
    return any(one is not None for one in runner.tracks)


def people_scores(truth: Sequence[TrackedBoxes], runner: TrackerRunner) -> dict[str, float | None]:
    """HOTA, IDF1, MOTA and so on of a tracker in an episode; None for a tracker of one person."""
    if not has_tracks(runner):
        return dict.fromkeys(SCORES)
    found = multi_object([(_tracks(truth), _tracks(runner.tracks))])
    return {name: found[name] for name in SCORES}


def track_rows(runner: TrackerRunner) -> list[list[float]]:
    """For each frame identity, x, y, w, h of everybody, one after the other; NaN where the tracker has none."""
    return [
        [math.nan] if one is None else np.column_stack([one.identities, one.boxes]).ravel().tolist()
        for one in runner.tracks
    ]


def table_of(rows: Sequence[Sequence[float] | None]) -> FloatArray:
    """`(M, 6)` frame, identity and box of rows as `track_rows` gives them, None where there are none."""
    tables = [
        np.column_stack([np.full(len(row) // 5, float(frame)), np.reshape(row, (-1, 5))])
        for frame, row in enumerate(rows)
        if row is not None
    ]
    return np.concatenate([np.empty((0, 6)), *tables])


def _tracks(frames: Sequence[TrackedBoxes | None]) -> Tracks:
    known = [(index, one) for index, one in enumerate(frames) if one is not None]
    numbers = np.repeat([index for index, _ in known], [len(one) for _, one in known]).astype(np.int64)
    identities = np.concatenate([np.empty(0, np.int64), *(one.identities for _, one in known)])
    return Tracks(numbers, identities, np.concatenate([np.empty((0, 4)), *(one.boxes for _, one in known)]))
