"""Process of an isolated tracker: load it once, then serve one episode after the other until the connection is closed.

Messages are a length (8 bytes, big endian) and as many bytes: requests and replies in JSON, an image as its pixels.
Nothing is pickled, so that objects of third-party code cannot run code in the parent process, and no shared memory is
left behind by a process that is killed.

Same seed, same bits, whatever ran before: an episode begins in one of three ways.

- `"reset"`: the tracker has a method `reset(seed)`, by which its author promises that it forgets everything. It serves
  every episode in this process.
- `"fork"`: each episode runs in a fork of this process, which is left as it was after loading, with modules and
  module-level caches loaded; the fork calls the factory with the episode's seed.
- `"once"`: the loaded code has threads or a GPU open and cannot be forked: the parent replaces the process, and starts
  the next one early, which imports the tracker's code before its episode begins.
"""

from __future__ import annotations

import contextlib
import inspect
import json
import os
import random
import socket
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, NoReturn, cast

import numpy as np

from pftrack_sim import trackers
from pftrack_sim.core.code_digest import OpenedFiles
from pftrack_sim.core.records import Detections, TrackedBoxes, Tracker
from pftrack_sim.core.text import describe_error, locate_error, traceback_text
from pftrack_sim.trackers.base import as_estimate, check_unmodified
from pftrack_sim.trackers.trax import PREFIX as TRAX

LENGTH = struct.Struct("!Q")
"""Length of a message."""

MAX_PARTICLES = 10_000
"""Number of particles sent, which are for drawing only."""

_ENDED = 97
"""Exit code of an episode's process whose parent asked it to end."""

_GPU_DEVICES = ("/dev/nvidia", "/dev/dri/", "/dev/kfd")


class Server:
    """Serves a tracker.

    Args:
        requests: For requests, images and replies.
        settings: `name`, `preset` and `params` of the tracker, `once` if this process serves one episode only, and its
            memory limit `memory_mb`, for messages.
        end_others: Ends the processes that an episode has left running.
    """

    def __init__(self, requests: socket.socket, settings: dict[str, Any], end_others: Callable[[], None]) -> None:
        self._connection = requests.makefile("rwb")
        self._settings, self._end_others = settings, end_others
        self._opened = OpenedFiles()
        self._tracker: Tracker | None = None
        self._way: Literal["reset", "fork", "once"] | None = None

    def run(self) -> NoReturn:
        """Serve until the parent closes the connection."""
        while True:
            self._run_episode()

    def _run_episode(self) -> None:
        """Serve one episode; returns when this process can serve another."""
        if self._way is None and not self._answer(self._load):
            while True:
                self._read()  # until the parent has read the fault and closes the connection
        request, _ = self._read()
        if self._way == "fork" and (pid := os.fork()):
            code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
            self._end_others()
            if code != _ENDED:
                os._exit(code if code >= 0 else 128 - code)  # as a shell tells that it was ended by a signal
        else:
            self._answer(lambda: self._begin(int(request["seed"])))
            while (call := self._read())[0]["command"] != "end":
                self._answer(lambda call=call: self._call(*call))
            if self._way == "fork":
                with contextlib.suppress(Exception):  # the tracker may have replaced it
                    sys.stdout.flush()
                os._exit(_ENDED)
        self._reply({"ended": self._way != "once"})

    def _make(self, seed: int) -> Tracker:
        _seed_generators(seed)
        return trackers.make(
            self._settings["name"], seed=seed, preset=self._settings["preset"], **self._settings["params"]
        )

    def _load(self) -> None:
        """Import the tracker and make it; only import it if this process serves one episode only."""
        # A program of its own is started anew for every sequence anyway.
        if self._settings["once"] or self._settings["name"].startswith(TRAX):
            self._way = "once"
            if not self._settings["name"].startswith(TRAX):
                _seed_generators(0)
                trackers.factory(self._settings["name"])
                self._opened.take()
            return
        tracker = self._make(0)
        self._opened.take()
        if _has_reset(tracker):
            self._way, self._tracker = "reset", tracker
        else:
            self._way = "fork" if _can_fork() else "once"

    def _begin(self, seed: int) -> dict[str, Any]:
        if self._way == "reset":
            _seed_generators(seed)
            cast("Any", self._tracker).reset(seed=seed)
        else:
            self._tracker = self._make(seed)
        self._opened.take()
        return {
            "way": self._way,
            "opened": self._opened.found,
            "needs_truth": isinstance(self._tracker, trackers.NeedsTruth),
            "needs_detections": isinstance(self._tracker, trackers.NeedsDetections),
        }

    def _call(self, request: dict[str, Any], pixels: bytes) -> dict[str, Any]:
        """Call `init` or `update` and return the reply, with the time taken [ms]."""
        tracker = self._tracker
        assert tracker is not None
        original = np.frombuffer(pixels, dtype=np.uint8).reshape(request["shape"])
        image = original.copy()
        if isinstance(tracker, trackers.NeedsTruth) and "truth" in request:
            box, visible_fraction = request["truth"]
            tracker.receive_truth(np.array(box), visible_fraction)
        if isinstance(tracker, trackers.NeedsDetections) and "detections" in request:
            boxes, scores, age_s = request["detections"]
            tracker.receive_detections(Detections(np.array(boxes).reshape(-1, 4), np.array(scores, float), age_s))
        first = request["command"] == "init"
        start_s = time.perf_counter()
        output = tracker.init(image, np.array(request["box"])) if first else tracker.update(image)
        reply: dict[str, Any] = {"ms": (time.perf_counter() - start_s) * 1e3}
        check_unmodified(image, original)
        if not first:
            estimate = as_estimate(output)
            particles = None if estimate.particles is None else estimate.particles[:MAX_PARTICLES].tolist()
            reply |= {"box": estimate.box.tolist(), "confidence": estimate.confidence, "occluded": estimate.occluded}
            reply |= {"particles": particles}
        if isinstance(tracker, trackers.NeedsDetections) and isinstance(tracker.tracks, TrackedBoxes):
            reply["tracks"] = np.column_stack([tracker.tracks.identities, tracker.tracks.boxes]).tolist()
        return reply

    def _read(self) -> tuple[dict[str, Any], bytes]:
        request: dict[str, Any] = json.loads(self._read_message())
        return request, self._read_message() if "shape" in request else b""

    def _read_message(self) -> bytes:
        with contextlib.suppress(OSError, struct.error):
            (length,) = LENGTH.unpack(self._connection.read(LENGTH.size))
            if len(message := self._connection.read(length)) == length:
                return message
        # The parent is gone: exit without waiting for threads or exit handlers of the tracker.
        os._exit(0)

    def _answer(self, work: Callable[[], dict[str, Any] | None]) -> bool:
        """Send what work returns, if anything, or its fault; whether it succeeded."""
        try:
            reply = work()
        except BaseException as error:  # noqa: BLE001 - third-party code may call sys.exit
            limit = f" (memory limit {self._settings['memory_mb']:g} MB)" if isinstance(error, MemoryError) else ""
            text = describe_error(error) + limit + locate_error(error)
            self._reply({"error": text, "traceback": traceback_text(error)})
            return False
        if reply is not None:
            self._reply(reply)
        return True

    def _reply(self, reply: dict[str, Any]) -> None:
        if opened := self._opened.take():
            reply["opened"] = opened
        message = json.dumps(reply).encode()
        try:
            self._connection.write(LENGTH.pack(len(message)) + message)
            self._connection.flush()
        except OSError:
            os._exit(0)


def _seed_generators(seed: int) -> None:
    """Seed the global generators, so that a tracker that draws from them gives the same bits for the same seed."""
    random.seed(seed)
    np.random.seed(seed % 2**32)  # noqa: NPY002 - the tracker's, in a process of its own
    torch = sys.modules.get("torch")
    if torch is not None:
        torch.manual_seed(seed % 2**63)


def _has_reset(tracker: Any) -> bool:
    """Whether a tracker has a method `reset(seed)`; one without a parameter of this name is something else."""
    try:
        return "seed" in inspect.signature(tracker.reset).parameters
    except (AttributeError, TypeError, ValueError):
        return False


def _can_fork() -> bool:
    """Whether a fork of this process is whole: threads and GPU contexts are not inherited."""
    if sys.platform != "linux":
        return False
    opened = [os.path.realpath(one) for one in Path("/proc/self/fd").iterdir()]
    return len(os.listdir("/proc/self/task")) == 1 and not any(one.startswith(_GPU_DEVICES) for one in opened)
