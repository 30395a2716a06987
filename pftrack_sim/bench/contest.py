"""One frame shown to many trackers; none waits for another's mistake."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pftrack_sim import boxes, trackers
from pftrack_sim.boxes import Box
from pftrack_sim.records import Estimate, Image, Tracker


@dataclass
class Entry:
    """A tracker in a contest, and everything it said so far.

    Attributes:
        name: As given to `trackers.make`.
        tracker: The tracker.
        estimates: One for each frame; None where it gave no valid answer.
        ms: Time it took for each frame.
        failure: What went wrong, and at which frame; None while all is well. It counts as a miss from there on.
    """

    name: str
    tracker: Tracker
    estimates: list[Estimate | None] = field(default_factory=list[Estimate | None])
    ms: list[float] = field(default_factory=list[float])
    failure: str | None = None
    started: bool = False

    def see(self, image: Image, truth_box: Box, visible: bool) -> Estimate | None:
        """Show the next frame.

        Args:
            image: `(H, W, 3)` uint8 RGB. The tracker gets a copy of its own.
            truth_box: `(4,)` box [px]: where to start, and for trackers that ask for the truth.
            visible: Whether the target can be seen: a tracker starts at the first frame where it can.

        Returns:
            The estimate, or None when there is none.
        """
        estimate = None
        own = image.copy()
        began = time.perf_counter()
        if self.failure is None and (self.started or visible):
            try:
                estimate = self._answer(own, truth_box)
            except Exception as error:  # noqa: BLE001 - a stranger's tracker may raise anything; it is recorded
                self.failure = f"frame {len(self.ms)}: {type(error).__name__}: {error}"
        self.ms.append((time.perf_counter() - began) * 1e3)
        self.estimates.append(estimate)
        return estimate

    def _answer(self, image: Image, truth_box: Box) -> Estimate:
        if isinstance(self.tracker, trackers.NeedsTruth):
            self.tracker.tell(truth_box)
        if not self.started:
            self.started = True
            self.tracker.init(image, np.array(truth_box))
            return Estimate(truth_box)
        return self.tracker.update(image)

    @property
    def boxes(self) -> np.ndarray:
        """`(N, 4)` boxes [px], NaN where there is no estimate."""
        rows = [boxes.NO_BOX if estimate is None else estimate.box for estimate in self.estimates]
        return np.array(rows, dtype=np.float64).reshape(-1, 4)


def enter(
    names: Sequence[str], *, seed: int, preset: str, params: Mapping[str, Mapping[str, Any]] | None = None
) -> list[Entry]:
    """Fresh trackers, one for each name.

    Args:
        names: Names for `trackers.make`.
        seed: Root seed of the episode: every tracker draws from its own `tracker` stream of it.
        preset: Preset of every tracker that has presets.
        params: Parameters of trackers, by the tracker's name.

    Raises:
        UnknownNameError: No such tracker.
        ParameterError: No such preset or parameter.
        TrackerError: A tracker that needs what is not there.
    """
    own = params or {}
    return [Entry(name, trackers.make(name, seed=seed, preset=preset, **own.get(name, {}))) for name in names]
