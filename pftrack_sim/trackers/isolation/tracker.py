"""An isolated tracker: the tracker interface, with every failure as one exception type."""

from __future__ import annotations

import contextlib
import json
import threading
import time
from collections import defaultdict
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import BoxError, ParameterError, TrackerError
from pftrack_sim.core.records import Detections, Estimate, Image, TrackedBoxes
from pftrack_sim.core.text import one_line
from pftrack_sim.trackers.isolation.process import Limits, TrackerFault, TrackerProcess, took_ms, unreadable
from pftrack_sim.trackers.isolation.sandbox import sandbox_command


@dataclass(frozen=True)
class TrackerCode:
    """What a process loads.

    Attributes:
        name: For `trackers.make`.
        preset: Preset.
        params: Parameters, as JSON.
        limits: Limits.
        sandboxed: Whether it runs in a sandbox, see `sandbox`.
    """

    name: str
    preset: str
    params: str
    limits: Limits
    sandboxed: bool


class TrackerProcesses:
    """Processes of trackers, kept between episodes so that each is loaded once; ended by `close`."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: defaultdict[TrackerCode, list[TrackerProcess]] = defaultdict(list)
        self._serve_once: set[TrackerCode] = set()

    def take(self, code: TrackerCode) -> TrackerProcess:
        """A process that has loaded the tracker, or a new one that begins to.

        Raises:
            RunError: No process can be started.
        """
        with self._lock:
            if self._idle[code]:
                process = self._idle[code].pop()
                process.listen()
                return process
            once = code in self._serve_once
        params: dict[str, Any] = json.loads(code.params)
        sandbox = sandbox_command(params, code.limits.memory_mb) if code.sandboxed else ()
        process = TrackerProcess(code.limits, sandbox)
        request = {"command": "load", "name": code.name, "preset": code.preset, "params": params, "once": once}
        # Failures here are reported by the first reply.
        with contextlib.suppress(OSError):
            process.send(request, code.limits.make_s)
        return process

    def give_back(self, code: TrackerCode, process: TrackerProcess) -> None:
        """Keep a process that can serve another episode."""
        with self._lock:
            self._idle[code].append(process)

    def expect_one_episode(self, code: TrackerCode) -> None:
        """Load this tracker anew for each episode from now on: its processes can serve only one."""
        with self._lock:
            self._serve_once.add(code)

    def __len__(self) -> int:
        with self._lock:
            return sum(map(len, self._idle.values()))

    def close(self) -> None:
        """End the processes that are kept. May be called twice."""
        with self._lock:
            kept = [process for processes in self._idle.values() for process in processes]
            self._idle.clear()
        for process in kept:
            process.close()

    def __enter__(self) -> TrackerProcesses:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class IsolatedTracker:
    """A tracker in a process of its own, for one episode, without state from earlier ones.

    The tracker is made concurrently: only the first call waits for it.

    Args:
        name: For `trackers.make`.
        seed: Root seed of the episode.
        preset: Preset.
        params: Parameters.
        limits: Limits.
        sandboxed: Whether it runs in a sandbox.
        processes: Where its process comes from and goes to; None: a new one that ends with the episode.

    Raises:
        RunError: No process can be started.
        ParameterError: There is no sandbox here.

    Attributes:
        took_ms: Time of the last call, measured in the child process.
    """

    def __init__(
        self,
        name: str,
        *,
        seed: int,
        preset: str,
        params: dict[str, Any],
        limits: Limits,
        sandboxed: bool = False,
        processes: TrackerProcesses | None = None,
    ) -> None:
        self.took_ms = 0.0
        self._limits = limits
        self.tracks: TrackedBoxes | None = None
        self._truth: list[float] | None = None
        self._detections: dict[str, Any] | None = None
        self._code = TrackerCode(name, preset, json.dumps(params, sort_keys=True), limits, sandboxed)
        self._processes = processes
        self._process = (TrackerProcesses() if processes is None else processes).take(self._code)
        self._needs_truth: bool | None = None
        self._needs_detections = False
        self._unmade: TrackerFault | None = None
        self._failed = False
        self._printed: str | None = None
        self._open = True
        # Failures here are reported by the first call.
        with contextlib.suppress(OSError):
            self._process.send({"command": "start", "seed": seed}, limits.make_s)

    @property
    def needs_truth(self) -> bool:
        """Whether the tracker implements `NeedsTruth`; waits until it is made and raises TrackerFault if it fails."""
        self.wait_until_made()
        return bool(self._needs_truth)

    @property
    def needs_detections(self) -> bool:
        """Whether the tracker implements `NeedsDetections`; as `needs_truth`."""
        self.wait_until_made()
        return self._needs_detections

    def wait_until_made(self) -> None:
        """Wait until the tracker is made; raises TrackerFault if it fails."""
        if self._needs_truth is not None:
            return
        if self._unmade is not None:
            raise self._unmade
        try:
            if self._process.way is None:
                self._process.way = str(self._receive(self._limits.make_s).get("way"))
            reply = self._receive(self._limits.make_s)
            self._needs_detections = bool(reply.get("needs_detections"))
            self._needs_truth = bool(reply.get("needs_truth"))
        except TrackerFault as error:
            self._unmade = TrackerFault(f"could not be made: {error}", error.traceback)
            raise self._unmade from None

    def receive_truth(self, box: ArrayLike) -> None:
        """Pass on the target's true box in the next frame, for a tracker that `needs_truth`."""
        self._truth = [float(value) for value in np.asarray(box)]

    def receive_detections(self, detections: Detections) -> None:
        """Pass on the detections in the next frame, for a tracker that `needs_detections`."""
        boxes, scores = detections.boxes.tolist(), detections.scores.tolist()
        self._detections = {"boxes": boxes, "scores": scores, "age_s": detections.age_s}

    def init(self, image: Image, box: ArrayLike) -> None:
        """As `Tracker.init`; raises TrackerFault."""
        self._call("init", image, box=[float(value) for value in np.asarray(box)])

    def update(self, image: Image) -> Estimate:
        """As `Tracker.update`; raises TrackerFault."""
        reply = self._call("update", image)
        try:
            confidence, occluded = reply["confidence"], reply["occluded"]
            if not isinstance(confidence, (int, float)) or not isinstance(occluded, bool):
                raise TypeError("confidence must be a number and occluded true or false")
            box = np.array(reply["box"], dtype=np.float64)
            return Estimate(box, float(confidence), occluded, reply["particles"])
        except (KeyError, TypeError, ValueError, OverflowError, BoxError) as error:
            self._failed = True
            raise unreadable(error) from None

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
        self._open = False
        process, processes = self._process, self._processes
        if processes is not None and process.way == "once":
            processes.expect_one_episode(self._code)
        made = self._needs_truth is not None
        kept = processes is not None and made and not self._failed and process.end_episode()
        if not kept:
            process.close()
        self._printed = process.take_output()
        if processes is not None and kept:
            processes.give_back(self._code, process)

    def _call(self, command: str, image: Image, **arguments: Any) -> dict[str, Any]:
        """Send an image and a command, and return the reply."""
        self.wait_until_made()
        request = {"command": command, **arguments, "shape": image.shape, "truth": self._truth}
        request["detections"] = self._detections
        began_s = time.monotonic()
        try:
            self._process.send(request, self._limits.frame_s, image)
        except TimeoutError:
            self._failed = True
            raise TrackerFault(f"it did not read its image within {self._limits.frame_s:g} s") from None
        except OSError:
            self._failed = True
            raise TrackerFault(self._process.exit_reason()) from None
        reply = self._receive(self._limits.frame_s)
        self.took_ms = took_ms(reply, began_s)
        self.tracks = self._tracks_of(reply) if self._needs_detections else None
        return reply

    def _tracks_of(self, reply: dict[str, Any]) -> TrackedBoxes | None:
        rows = reply.get("tracks")
        try:
            table = np.array(rows, dtype=np.float64).reshape(-1, 5)
            return None if rows is None else TrackedBoxes(table[:, 1:], table[:, 0].astype(np.int64))
        except (TypeError, ValueError, OverflowError, ParameterError) as error:
            self._failed = True
            raise unreadable(error) from None

    def _receive(self, limit_s: float) -> dict[str, Any]:
        try:
            return self._process.receive(limit_s)
        except TrackerFault:
            self._failed = True
            raise


def try_make(
    name: str,
    *,
    preset: str,
    params: dict[str, Any],
    limits: Limits,
    sandboxed: bool = False,
    processes: TrackerProcesses | None = None,
) -> None:
    """Make a tracker once, to report errors in its name, preset or parameters before a run.

    Raises:
        TrackerError: It cannot be made.
    """
    tracker = IsolatedTracker(
        name, seed=0, preset=preset, params=params, limits=limits, sandboxed=sandboxed, processes=processes
    )
    try:
        tracker.wait_until_made()
    except TrackerFault as error:
        text = str(error).removeprefix("could not be made: ")
        for prefix in ("TrackerError: ", "ParameterError: ", "UnknownNameError: "):
            text = text.removeprefix(prefix)  # messages of this package need no type
        tracker.close()  # so that all that it printed has been read
        text = text if name in text else f"tracker {name!r} could not be made: {text}"
        raise TrackerError(text + (f"; it printed: {one_line(tracker.printed)}" if tracker.printed else "")) from None
    finally:
        tracker.close()
