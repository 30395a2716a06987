"""One frame shown to many trackers; none waits for another's mistake."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from typing import Literal, TypeAlias

import numpy as np

from pftrack_sim import trackers
from pftrack_sim.benchmark.plan import TrackerSpec
from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Estimate, Image, Tracker
from pftrack_sim.trackers.base import check_unmodified, checked_estimate
from pftrack_sim.trackers.isolation import IsolatedTracker, Limits, TrackerFault, try_make
from pftrack_sim.trackers.registry import GROUP

Isolation: TypeAlias = Literal["auto", "always", "never"]
"""Which trackers get a process of their own; `"auto"`: those of strangers."""

Status: TypeAlias = Literal["waiting", "init", "ok", "busy", "failed"]


@dataclass
class TrackerRun:
    """A tracker in a contest, and everything it said so far.

    Attributes:
        name: As tables call it.
        tracker: The tracker.
        estimates: One for each frame; None where it gave no valid answer.
        ms: Time it took for each frame.
        statuses: For each frame: `"waiting"` for the target to appear, `"init"`, `"ok"`, `"busy"` (still thinking about
            an earlier one), or `"failed"`.
        failure: What went wrong, and at which frame; None while all is well. It counts as a miss from there on.
    """

    name: str
    tracker: Tracker | IsolatedTracker
    estimates: list[Estimate | None] = field(default_factory=list[Estimate | None])
    ms: list[float] = field(default_factory=list[float])
    statuses: list[Status] = field(default_factory=list[Status])
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
        estimate, took_ms, status = None, 0.0, "waiting"
        if self.failure is None and (self.started or visible):
            status = "ok" if self.started else "init"
            try:
                estimate, took_ms = self._answer(image, truth_box)
            except TrackerFault as error:
                self.failure = f"frame {len(self.ms)}: {error}"
            except (Exception, SystemExit) as error:  # noqa: BLE001 - a stranger's tracker may raise anything
                self.failure = f"frame {len(self.ms)}: {type(error).__name__}: {error}"
            if self.failure is not None:
                self.close()
        self.ms.append(took_ms)
        self.estimates.append(estimate)
        self.statuses.append("failed" if self.failure is not None else status)
        return estimate

    def _answer(self, image: Image, truth_box: Box) -> tuple[Estimate, float]:
        if isinstance(self.tracker, IsolatedTracker):
            if self.tracker.needs_truth:
                self.tracker.receive_truth(truth_box)
            if not self.started:
                self.started = True
                self.tracker.init(image, truth_box)
                return Estimate(truth_box), self.tracker.took_ms
            return self.tracker.update(image), self.tracker.took_ms
        own = image.copy()
        if isinstance(self.tracker, trackers.NeedsTruth):
            self.tracker.receive_truth(truth_box)
        began = time.perf_counter()
        if not self.started:
            self.started = True
            self.tracker.init(own, np.array(truth_box))
            took_ms = (time.perf_counter() - began) * 1e3
            check_unmodified(own, image)
            return Estimate(truth_box), took_ms
        said = self.tracker.update(own)
        took_ms = (time.perf_counter() - began) * 1e3
        return checked_estimate(said, own, image), took_ms

    @property
    def boxes(self) -> np.ndarray:
        """`(N, 4)` boxes [px], NaN where there is no estimate."""
        rows = [boxes.NO_BOX if estimate is None else estimate.box for estimate in self.estimates]
        return np.array(rows, dtype=np.float64).reshape(-1, 4)

    @property
    def printed(self) -> str | None:
        """The beginning of what it printed, where that was caught: in a process of its own. It costs nothing."""
        return self.tracker.printed if isinstance(self.tracker, IsolatedTracker) else None

    def close(self) -> None:
        """End the tracker's process, if it has one. Closing twice is fine."""
        if isinstance(self.tracker, IsolatedTracker):
            self.tracker.close()


def enter(
    contestants: Sequence[str | TrackerSpec],
    *,
    seed: int,
    isolation: Isolation = "never",
    limits: Limits | None = None,
) -> list[TrackerRun]:
    """Fresh trackers.

    Args:
        contestants: Trackers with their presets and parameters; a name alone is one without any.
        seed: Root seed of the episode: every tracker draws from its own `tracker` stream of it.
        isolation: Which trackers get a process of their own.
        limits: What those may take.

    Raises:
        UnknownNameError: No such tracker.
        ParameterError: No such preset or parameter.
        TrackerError: A tracker that shares this process cannot be made.
    """
    entries: list[TrackerRun] = []
    for one in contestants:
        who = one if isinstance(one, TrackerSpec) else TrackerSpec(name=one)
        if not is_isolated(who.name, isolation):
            entries.append(TrackerRun(who.label, trackers.make(who.name, seed=seed, preset=who.preset, **who.params)))
            continue
        made = IsolatedTracker(who.name, seed=seed, preset=who.preset, params=who.params, limits=limits or Limits())
        entries.append(TrackerRun(who.label, made))
    return entries


def try_out(contestants: Sequence[TrackerSpec], isolation: Isolation, limits: Limits) -> None:
    """Make every tracker once: mistakes in names, presets or parameters are told before anything is written.

    Raises:
        PftrackError: As `enter`; TrackerError for those in a process of their own.
    """
    for who in contestants:
        if who.name not in trackers.names() and ":" not in who.name:
            trackers.describe(who.name)
        if is_isolated(who.name, isolation):
            try_make(who.name, preset=who.preset, params=who.params, limits=limits)
        else:
            trackers.make(who.name, preset=who.preset, **who.params)


def is_isolated(name: str, isolation: Isolation) -> bool:
    """Whether a tracker gets a process of its own."""
    if isolation != "auto":
        return isolation == "always"
    strangers = {point.name for point in entry_points(group=GROUP)}
    return name not in trackers.names() or name in strangers
