"""An isolated tracker: the tracker interface in front of a process."""

from __future__ import annotations

import contextlib
import math
import time
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import BoxError, ParameterError, TrackerError
from pftrack_sim.core.records import Detections, Estimate, Image, TrackedBoxes
from pftrack_sim.core.text import one_line
from pftrack_sim.trackers.isolation.process import TrackerCode, TrackerFault, TrackerProcesses


class IsolatedTracker:
    """A tracker in a process of its own, for one episode, without state from earlier ones.

    The tracker is made concurrently: only the first call waits for it.

    Args:
        code: What is loaded.
        seed: Root seed of the episode.
        processes: Where its process comes from and goes to; None: a new one that ends with the episode.

    Raises:
        RunError: No process can be started.
        ParameterError: There is no sandbox here.

    Attributes:
        took_ms: Time of the last call by this process's clock, from the image sent to the answer received.
        reported_ms: The same as its own process says.
        tracks: Everybody whom it follows in the last image; None where it follows one person or says nothing.
        opened: Digests of the files that its code has loaded and opened, by name, see `OpenedFiles`.
    """

    def __init__(self, code: TrackerCode, *, seed: int, processes: TrackerProcesses | None = None) -> None:
        self.took_ms = self.reported_ms = 0.0
        self.tracks: TrackedBoxes | None = None
        self._limits = code.limits
        self._extra: dict[str, Any] = {}
        self._processes = processes
        self._process = (TrackerProcesses() if processes is None else processes).take(code)
        self.opened = self._process.opened
        self._made: dict[str, Any] | TrackerFault | None = None
        self._printed: str | None = None
        self._open = True
        with contextlib.suppress(TrackerFault):  # reported by the first reply
            self._process.send({"command": "start", "seed": seed}, self._limits.make_s)

    @property
    def needs_truth(self) -> bool:
        """Whether the tracker implements `NeedsTruth`; waits until it is made and raises TrackerFault if it fails."""
        return bool(self.wait_until_made().get("needs_truth"))

    @property
    def needs_detections(self) -> bool:
        """Whether the tracker implements `NeedsDetections`; as `needs_truth`."""
        return bool(self.wait_until_made().get("needs_detections"))

    def wait_until_made(self) -> dict[str, Any]:
        """Wait until the tracker is made, and return what it said of itself; raises TrackerFault if it fails."""
        if self._made is None:
            try:
                self._made = self._process.receive(self._limits.make_s)
            except TrackerFault as error:
                self._made = TrackerFault(f"could not be made: {error}", error.traceback)
        if isinstance(self._made, TrackerFault):
            raise self._made from None
        return self._made

    def receive_truth(self, box: ArrayLike, visible_fraction: float) -> None:
        """Pass on the target's truth in the next frame, for a tracker that `needs_truth`."""
        self._extra["truth"] = np.asarray(box, dtype=np.float64).tolist(), float(visible_fraction)

    def receive_detections(self, detections: Detections) -> None:
        """Pass on the detections in the next frame, for a tracker that `needs_detections`."""
        self._extra["detections"] = detections.boxes.tolist(), detections.scores.tolist(), detections.age_s

    def init(self, image: Image, box: ArrayLike) -> None:
        """As `Tracker.init`; raises TrackerFault."""
        self._call("init", image, box=np.asarray(box, dtype=np.float64).tolist())

    def update(self, image: Image) -> Estimate:
        """As `Tracker.update`; raises TrackerFault."""
        reply = self._call("update", image)
        try:
            confidence, occluded = reply["confidence"], reply["occluded"]
            if not isinstance(confidence, (int, float)) or not isinstance(occluded, bool):
                raise TypeError("confidence must be a number and occluded true or false")
            return Estimate(reply["box"], float(confidence), occluded, reply["particles"])
        except (KeyError, TypeError, ValueError, OverflowError, BoxError) as error:
            raise self._process.unreadable(error) from None

    def _call(self, command: str, image: Image, **arguments: Any) -> dict[str, Any]:
        """Send a command with an image, and return the reply."""
        needs_detections = self.needs_detections
        request = {"command": command, "shape": image.shape, **self._extra, **arguments}
        self._process.send(request, self._limits.frame_s, image)
        sent_s = time.perf_counter()
        reply = self._process.receive(self._limits.frame_s)
        self.took_ms = (time.perf_counter() - sent_s) * 1e3
        try:
            ms, rows = reply["ms"], reply.get("tracks")
            if isinstance(ms, bool) or not isinstance(ms, (int, float)) or not 0.0 <= ms < math.inf:
                raise TypeError("the time taken is no number of milliseconds")
            self.reported_ms = float(ms)
            if needs_detections:
                table = None if rows is None else np.array(rows).reshape(-1, 5)
                self.tracks = None if table is None else TrackedBoxes(table[:, 1:], table[:, 0])
        except (KeyError, TypeError, ValueError, OverflowError, ParameterError) as error:
            raise self._process.unreadable(error) from None
        return reply

    @property
    def printed(self) -> str | None:
        """The beginning of the tracker's standard output and error in this episode, or None."""
        return self._process.printed if self._open else self._printed

    def close(self) -> None:
        """End the episode; the process too, with its children, if the tracker failed or the process is not kept.

        May be called twice.
        """
        if not self._open:
            return
        process, processes = self._process, self._processes
        way = self._made.get("way") if isinstance(self._made, dict) else None
        if processes is not None and way == "once":
            processes.expect_one_episode(process.code)
        kept = processes is not None and way is not None and process.end_episode()
        if not kept:
            process.close()
        self._printed, self._open = process.printed, False
        if processes is not None and kept:
            processes.give_back(process)


def try_make(code: TrackerCode, processes: TrackerProcesses | None = None) -> bool:
    """Make a tracker once, to report errors in its name, preset or parameters before a run.

    Returns:
        Whether it implements `NeedsTruth`.

    Raises:
        TrackerError: It cannot be made.
    """
    tracker = IsolatedTracker(code, seed=0, processes=processes)
    try:
        return tracker.needs_truth
    except TrackerFault as error:
        text = str(error).removeprefix("could not be made: ")
        for prefix in ("TrackerError: ", "ParameterError: ", "UnknownNameError: "):
            text = text.removeprefix(prefix)  # messages of this package need no type
        tracker.close()  # so that all that it printed has been read
        text = text if code.name in text else f"tracker {code.name!r} could not be made: {text}"
        raise TrackerError(text + (f"; it printed: {one_line(tracker.printed)}" if tracker.printed else "")) from None
    finally:
        tracker.close()
