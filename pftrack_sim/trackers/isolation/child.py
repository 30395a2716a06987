"""Process of an isolated tracker: load it once, then serve one episode after the other until the connection is closed.

Replies are JSON, never pickled, so that objects of third-party code cannot run code in the parent process. Images
arrive as bytes: no shared memory is left behind by a process that is killed.

Same seed, same bits, whatever ran before: an episode begins in one of three ways.

- `"reset"`: the tracker has a method `reset(seed)`, by which its author promises that it forgets everything. It serves
  every episode in this process.
- `"fork"`: each episode runs in a fork of this process, which is left as it was after loading, with modules and
  module-level caches loaded; the fork calls the factory with the episode's seed.
- `"once"`: the loaded code has threads or a GPU open and cannot be forked: the parent replaces the process.
"""

from __future__ import annotations

import contextlib
import inspect
import json
import os
import random
import signal
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, NoReturn, Protocol, runtime_checkable

import numpy as np

from pftrack_sim import trackers
from pftrack_sim.core.records import Detections, TrackedBoxes, Tracker
from pftrack_sim.core.text import describe_error, locate_error, traceback_text
from pftrack_sim.trackers.base import check_unmodified, checked_estimate
from pftrack_sim.trackers.isolation.channel import receive, send
from pftrack_sim.trackers.isolation.process_tree import end_descendants
from pftrack_sim.trackers.trax import PREFIX as TRAX

MAX_PARTICLES = 10_000
"""Number of particles sent, which are for drawing only."""

_MAX_REQUEST_BYTES = 1 << 30
_ENDED = 97
"""Exit code of an episode's process whose parent asked it to end."""

_GPU_DEVICES = ("/dev/nvidia", "/dev/dri/", "/dev/kfd")


def serve(requests: socket.socket, memory_limit_mb: float, contained: bool) -> NoReturn:
    """Serve a tracker until the parent closes the connection.

    Args:
        requests: For requests, images and replies.
        memory_limit_mb: Memory limit of the tracker, for messages.
        contained: Whether this process is in a PID namespace in which all others belong to the tracker.
    """
    server = _Server(requests, memory_limit_mb, contained)
    server.load()
    while True:
        server.run_episode()


class _Server:
    def __init__(self, requests: socket.socket, memory_limit_mb: float, contained: bool) -> None:
        self._requests = requests
        self._memory_limit_mb = memory_limit_mb
        self._contained = contained
        self._make: Callable[[int], Tracker] | None = None
        self._tracker: Tracker | None = None
        self._way: Literal["reset", "fork", "once"] = "once"

    def load(self) -> None:
        """Import the tracker and make it, unless the parent knows that this process serves one episode only."""
        request, _ = self._read()

        def load() -> dict[str, Any]:
            name, preset, params = request["name"], request["preset"], request["params"]
            self._make = lambda seed: trackers.make(name, seed=seed, preset=preset, **params)
            # A program of its own is started anew for every sequence anyway.
            if request["once"] or name.startswith(TRAX):
                return {"way": "once"}
            _seed_generators(0)
            tracker = self._make(0)
            if _has_reset(tracker):
                self._way = "reset"
            elif _can_fork():
                self._way = "fork"
            if self._way == "reset":
                self._tracker = tracker
            return {"way": self._way}

        self._answer(load)

    def run_episode(self) -> None:
        """Serve one episode; returns when this process can serve another."""
        request, _ = self._read()
        if self._way == "fork" and (pid := os.fork()):
            _, status = os.waitpid(pid, 0)
            end_descendants(contained=self._contained)  # what the episode left running
            code = os.waitstatus_to_exitcode(status)
            if code != _ENDED:
                _end_like(code)
        else:
            self._serve_episode(int(request["seed"]))
            if self._way == "fork":
                with contextlib.suppress(Exception):
                    sys.stdout.flush()
                os._exit(_ENDED)
        self._reply({"ended": self._way != "once"})

    def _serve_episode(self, seed: int) -> None:
        if self._way == "fork":
            end_with_parent()

        def begin() -> dict[str, Any]:
            _seed_generators(seed)
            if isinstance(self._tracker, _Resettable) and self._way == "reset":
                self._tracker.reset(seed=seed)
            elif self._tracker is None and self._make is not None:
                self._tracker = self._make(seed)
            return {
                "needs_truth": isinstance(self._tracker, trackers.NeedsTruth),
                "needs_detections": isinstance(self._tracker, trackers.NeedsDetections),
            }

        self._answer(begin)
        while True:
            request, pixels = self._read()
            if request["command"] == "end":
                return
            self._answer(lambda request=request, pixels=pixels: self._call(request, pixels))

    def _call(self, request: dict[str, Any], pixels: bytes | bytearray) -> dict[str, Any]:
        """Call `init` or `update` and return the reply, with the time taken [ms]."""
        tracker = self._tracker
        assert tracker is not None
        original = np.frombuffer(pixels, dtype=np.uint8).reshape(request["shape"])
        image = original.copy()
        if request["truth"] is not None and isinstance(tracker, trackers.NeedsTruth):
            tracker.receive_truth(np.array(request["truth"]))
        if request["detections"] is not None and isinstance(tracker, trackers.NeedsDetections):
            boxes, scores = (np.array(request["detections"][key], dtype=np.float64) for key in ("boxes", "scores"))
            tracker.receive_detections(Detections(boxes.reshape(-1, 4), scores, float(request["detections"]["age_s"])))
        start_s = time.perf_counter()
        if request["command"] == "init":
            tracker.init(image, np.array(request["box"]))
            ms = (time.perf_counter() - start_s) * 1e3
            check_unmodified(image, original)
            return {"ms": ms, "tracks": _track_rows(tracker)}
        output = tracker.update(image)
        ms = (time.perf_counter() - start_s) * 1e3
        estimate = checked_estimate(output, image, original)
        return {
            "ms": ms,
            "tracks": _track_rows(tracker),
            "box": estimate.box.tolist(),
            "confidence": estimate.confidence,
            "occluded": estimate.occluded,
            "particles": None if estimate.particles is None else estimate.particles[:MAX_PARTICLES].tolist(),
        }

    def _read(self) -> tuple[dict[str, Any], bytes | bytearray]:
        try:
            request: dict[str, Any] = json.loads(receive(self._requests, limit_bytes=_MAX_REQUEST_BYTES))
            pixels = receive(self._requests, limit_bytes=_MAX_REQUEST_BYTES) if "shape" in request else b""
        except (EOFError, OSError):
            # The parent is gone: exit without waiting for threads or exit handlers of the tracker.
            os._exit(0)
        return request, pixels

    def _answer(self, work: Callable[[], dict[str, Any]]) -> None:
        try:
            reply = work()
        except BaseException as error:  # noqa: BLE001 - third-party code may call sys.exit
            limit = f" (memory limit {self._memory_limit_mb:g} MB)" if isinstance(error, MemoryError) else ""
            reply = {"error": describe_error(error) + limit + locate_error(error), "traceback": traceback_text(error)}
        self._reply(reply)

    def _reply(self, reply: dict[str, Any]) -> None:
        try:
            send(self._requests, json.dumps(reply).encode())
        except OSError:
            os._exit(0)


def _track_rows(tracker: Tracker) -> list[list[float]] | None:
    """Identity and box of everybody whom a multi-object tracker follows; None for other trackers."""
    tracks = tracker.tracks if isinstance(tracker, trackers.NeedsDetections) else None
    if not isinstance(tracks, TrackedBoxes):
        return None
    return np.column_stack([tracks.identities, tracks.boxes]).tolist()


def _seed_generators(seed: int) -> None:
    """Seed the global generators, so that a tracker that draws from them gives the same bits for the same seed."""
    random.seed(seed)
    np.random.seed(seed % 2**32)  # noqa: NPY002 - the tracker's, in a process of its own
    torch = sys.modules.get("torch")
    if torch is not None:
        torch.manual_seed(seed % 2**63)


@runtime_checkable
class _Resettable(Protocol):
    def reset(self, *, seed: int) -> None: ...


def _has_reset(tracker: Tracker) -> bool:
    """Whether a tracker has a method `reset(seed)`; one without a parameter of this name is something else."""
    try:
        return isinstance(tracker, _Resettable) and "seed" in inspect.signature(tracker.reset).parameters
    except (TypeError, ValueError):
        return False


def _can_fork() -> bool:
    """Whether a fork of this process is whole: threads and GPU contexts are not inherited."""
    if sys.platform != "linux":
        return False
    opened = [_target(one) for one in Path("/proc/self/fd").iterdir()]
    return len(os.listdir("/proc/self/task")) == 1 and not any(one.startswith(_GPU_DEVICES) for one in opened)


def _target(link: Path) -> str:
    try:
        return os.readlink(link)
    except OSError:
        return ""


def end_with_parent() -> None:
    """Let the system kill this process when its parent ends (Linux)."""
    import ctypes

    set_parent_death_signal = 1
    ctypes.CDLL(None).prctl(set_parent_death_signal, int(signal.SIGKILL), 0, 0, 0)


def _end_like(code: int) -> NoReturn:
    """End this process with the exit code or by the signal of an episode's process: the parent is told how it ended."""
    if code < 0:
        with contextlib.suppress(OSError, ValueError):  # SIGKILL has no handler
            signal.signal(-code, signal.SIG_DFL)
        os.kill(os.getpid(), -code)
    os._exit(max(code, 0))
