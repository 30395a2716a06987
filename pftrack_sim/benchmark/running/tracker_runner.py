"""Run a tracker frame by frame; exceptions, crashes and timeouts end that tracker only."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias, cast, get_args

import numpy as np

from pftrack_sim import trackers
from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.core import boxes, random_streams
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.errors import ParameterError, TrackerError
from pftrack_sim.core.records import Detections, Estimate, Image, TrackedBoxes, Tracker
from pftrack_sim.core.text import describe_error, locate_error, traceback_text
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.base import as_estimate, check_unmodified
from pftrack_sim.trackers.isolation import (
    IsolatedTracker,
    Limits,
    TrackerCode,
    TrackerFault,
    TrackerProcesses,
    try_make,
)
from pftrack_sim.trackers.isolation.sandbox import check_sandbox

Isolation: TypeAlias = Literal["auto", "always", "never", "container"]
"""Which trackers run in a process of their own; `"auto"`: third-party trackers; `"container"`: these, in a sandbox."""

TrackerStatus: TypeAlias = Literal["waiting", "init", "ok", "busy", "error"]
"""Of a tracker in a frame: waiting for the target to appear, initialised, updated, still busy with an earlier frame,
or ended by an error in this frame or an earlier one."""


@dataclass
class TrackerRunner:
    """A tracker with a record of every frame of an episode.

    Attributes:
        estimates: One for each frame; None without a valid one.
        tracks: For each frame everybody whom a multi-object tracker follows; None elsewhere.
        ms: Time taken for each frame by this process's clock; NaN where the tracker was not called or raised an error.
        reported_ms: Time of each update as the tracker's own process says, if it has one.
        error: The first error with its frame; None without one. Every frame from there on is a miss.
        seed: Root seed of the episode.
        box_noise: Share of the first box's sides by which its centre and sides are off at most, by the seed.
        first_frame: Frame before which the tracker does not start.
    """

    spec: TrackerSpec
    tracker: Tracker | IsolatedTracker
    estimates: list[Estimate | None] = field(default_factory=list[Estimate | None])
    tracks: list[TrackedBoxes | None] = field(default_factory=list["TrackedBoxes | None"])
    ms: list[float] = field(default_factory=list[float])
    reported_ms: list[float] = field(default_factory=list[float])
    statuses: list[TrackerStatus] = field(default_factory=list[TrackerStatus])
    error: str | None = None
    traceback: str = ""
    started: bool = False
    took_ms: float = 0.0
    seed: int = 0
    box_noise: float = 0.0
    first_frame: int = 0

    def step(self, image: Image, true_box: Box, visible_fraction: float, detections: Detections | None = None) -> None:
        """Call the tracker on the next frame and record the result.

        Args:
            image: `(H, W, 3)` uint8 RGB; the tracker gets its own copy.
            true_box: `(4,)` box [px]: for initialisation, and for trackers that need the truth.
            visible_fraction: Share of the target that can be seen: a tracker is initialised in the first frame above 0
                from `first_frame` on.
            detections: For trackers that need them; None where there are none.
        """
        if self.error is not None:
            self.record(None, "error")
        elif not self.started and (len(self.ms) < self.first_frame or not visible_fraction > 0.0):
            self.record(None, "waiting")
        else:
            status: TrackerStatus = "ok" if self.started else "init"
            try:
                estimate = self.call(image, true_box, visible_fraction, detections)
            except TrackerFault as error:
                self.fail(error)
            else:
                self.record(estimate, status, self.took_ms)

    def call(
        self, image: Image, true_box: Box, visible_fraction: float, detections: Detections | None = None
    ) -> Estimate:
        """Initialise the tracker when called first, update it afterwards; record nothing.

        Raises:
            TrackerFault: The tracker raised, crashed, timed out, or returned no valid estimate. It is closed then.
        """
        tracker, first, self.started = self.tracker, not self.started, True
        isolated = isinstance(tracker, IsolatedTracker)
        try:
            if self.needs_detections:
                if detections is None:
                    raise TrackerFault("it follows detections, and there are none")
                cast("trackers.NeedsDetections", tracker).receive_detections(detections)
            if _needs_truth(tracker):
                _check_truth(self.spec)
                cast("trackers.NeedsTruth", tracker).receive_truth(true_box, visible_fraction)
            shown = image if isolated else image.copy()
            start_s = time.perf_counter()
            if first:
                estimate = Estimate(_perturbed(true_box, self.seed, self.box_noise))
                tracker.init(shown, np.array(estimate.box))
            else:
                estimate = tracker.update(shown)
            if isinstance(tracker, IsolatedTracker):  # its process has checked the image, and the clock
                self.took_ms = tracker.took_ms
                return estimate
            self.took_ms = (time.perf_counter() - start_s) * 1e3
            check_unmodified(shown, image)
            return estimate if first else as_estimate(estimate)
        except TrackerFault:
            self.close()
            raise
        except (Exception, SystemExit) as error:  # a third-party tracker may raise anything
            self.close()
            raise fault_of(error) from error

    @property
    def needs_detections(self) -> bool:
        """Whether the tracker implements `NeedsDetections`; False if it cannot be made: its first call reports that."""
        if isinstance(self.tracker, IsolatedTracker):
            try:
                return self.tracker.needs_detections
            except TrackerFault:
                return False
        return isinstance(self.tracker, trackers.NeedsDetections)

    def fail(self, fault: TrackerFault) -> None:
        """Record an error in the current frame."""
        self.error, self.traceback = f"frame {len(self.ms)}: {fault}", fault.traceback
        self.record(None, "error")

    def record(self, estimate: Estimate | None, status: TrackerStatus, ms: float = math.nan) -> None:
        """Append the result of a frame."""
        self.estimates.append(estimate)
        self.tracks.append(getattr(self.tracker, "tracks", None) if status in ("init", "ok") else None)
        self.statuses.append(status)
        self.ms.append(ms)
        if isinstance(self.tracker, IsolatedTracker) and status == "ok":
            self.reported_ms.append(self.tracker.reported_ms)

    @property
    def boxes(self) -> FloatArray:
        """`(N, 4)` boxes [px], NaN where there is no estimate."""
        rows = [boxes.NO_BOX if estimate is None else estimate.box for estimate in self.estimates]
        return np.array(rows, dtype=np.float64).reshape(-1, 4)

    @property
    def ms_reported(self) -> float:
        """Median of `reported_ms`; NaN without any."""
        return float(np.median(self.reported_ms)) if self.reported_ms else math.nan

    @property
    def printed(self) -> str | None:
        """Beginning of what the tracker printed, if it runs in a process of its own."""
        return self.tracker.printed if isinstance(self.tracker, IsolatedTracker) else None

    @property
    def opened(self) -> Mapping[str, str]:
        """Digests of the files that its code has loaded and opened, if it runs in a process of its own."""
        return self.tracker.opened if isinstance(self.tracker, IsolatedTracker) else {}

    def close(self) -> None:
        """End the tracker's process, if it has one. Closing twice is fine."""
        if isinstance(self.tracker, IsolatedTracker):
            self.tracker.close()


def _perturbed(box: Box, seed: int, share: float) -> Box:
    """`(4,)` box [px] whose centre and sides are off by up to a share of the sides, by the seed."""
    if share == 0.0:
        return box
    offsets = random_streams.stream(seed, "first_box").uniform(-share, share, 4)
    sides = box[2:] * (1.0 + offsets[2:])
    return np.concatenate([boxes.centre(box) + offsets[:2] * box[2:] - 0.5 * sides, sides])


def _needs_truth(tracker: object) -> bool:
    return tracker.needs_truth if isinstance(tracker, IsolatedTracker) else isinstance(tracker, trackers.NeedsTruth)


def _check_truth(spec: TrackerSpec) -> None:
    """Let only references of this package, and trackers that are marked for it, be told the truth.

    Raises:
        TrackerFault: Another tracker.
    """
    if not spec.allow_truth and not trackers.is_builtin(spec.name):
        raise TrackerFault(
            f"{spec.name} asks for the true box of every frame (receive_truth): only with --allow-truth {spec.name}, "
            "which marks its rows"
        )


def fault_of(error: BaseException) -> TrackerFault:
    """An exception of third-party code in this process as a fault."""
    return TrackerFault(describe_error(error) + locate_error(error), traceback_text(error))


def make_runners(
    specs: Sequence[str | TrackerSpec],
    *,
    seed: int,
    isolation: Isolation = "never",
    limits: Limits | None = None,
    apart: bool = False,
    processes: TrackerProcesses | None = None,
    box_noise: float = 0.0,
    first_frame: int = 0,
) -> list[TrackerRunner]:
    """Make fresh trackers.

    Args:
        specs: Trackers; a name alone has no preset and parameters.
        seed: Root seed of the episode: every tracker draws from its own `tracker` stream of it.
        isolation: Which trackers run in a process of their own.
        limits: Limits of those.
        apart: Whether all others do so too.
        processes: Where isolated trackers' processes are kept; None: they end with the episode.
        box_noise: See `TrackerRunner`.
        first_frame: See `TrackerRunner`.

    Raises:
        UnknownNameError: No such tracker.
        ParameterError: No such preset or parameter.
        TrackerError: A tracker that shares this process cannot be made.
    """
    runners: list[TrackerRunner] = []
    for given in specs:
        spec = TrackerSpec.of(given)
        if apart or is_isolated(spec.name, isolation):
            code = _code_of(spec, isolation, limits or Limits())
            made = IsolatedTracker(code, seed=seed, processes=processes)
        else:
            made = trackers.make(spec.name, seed=seed, preset=spec.preset, **spec.arguments)
        runners.append(TrackerRunner(spec, made, seed=seed, box_noise=box_noise, first_frame=first_frame))
    return runners


def check_trackers(
    specs: Sequence[TrackerSpec], isolation: Isolation, limits: Limits, processes: TrackerProcesses | None = None
) -> None:
    """Make every tracker once, so that wrong names, presets and parameters are reported before anything is written.

    Processes of isolated trackers stay in `processes`, loaded.

    Raises:
        PftrackError: As `make_runners`; TrackerError also for trackers in a process of their own.
    """
    for spec in specs:
        if spec.name not in trackers.names() and ":" not in spec.name:
            trackers.describe(spec.name)
        if is_isolated(spec.name, isolation):
            needs_truth = try_make(_code_of(spec, isolation, limits), processes)
        else:
            needs_truth = _needs_truth(trackers.make(spec.name, preset=spec.preset, **spec.params))
        try:
            if needs_truth:
                _check_truth(spec)
        except TrackerFault as error:
            raise TrackerError(str(error)) from None


def _code_of(spec: TrackerSpec, isolation: Isolation, limits: Limits) -> TrackerCode:
    sandboxed = isolation == "container" and not trackers.is_builtin(spec.name)
    return TrackerCode(spec.name, spec.preset, spec.arguments, limits, sandboxed=sandboxed)


def checked_isolation(name: str) -> Isolation:
    """Return `name`; raises ParameterError unless it is one of `Isolation`, or without a sandbox for `"container"`."""
    if name not in get_args(Isolation):
        raise ParameterError(f"isolation must be one of {', '.join(get_args(Isolation))}, got {name!r}")
    if name == "container":
        check_sandbox()
    return cast("Isolation", name)


def is_isolated(name: str, isolation: Isolation) -> bool:
    """Whether a tracker runs in a process of its own."""
    return isolation == "always" or (isolation != "never" and not trackers.is_builtin(name))
