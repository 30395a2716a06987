"""Parent side of an isolated tracker: the tracker interface, with every failure as one exception type."""

from __future__ import annotations

import contextlib
import json
import math
import multiprocessing
import os
import signal
import socket
import sys
import threading
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import BoxError, ParameterError, RunError, TrackerError
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.core.text import one_line, printable
from pftrack_sim.trackers.isolation.channel import ChannelError, receive, send
from pftrack_sim.trackers.isolation.supervisor import supervise

_MAX_REPLY_BYTES = 16 * 1024 * 1024
_MAX_OUTPUT_BYTES = 2000
_END_S = 5.0
"""Time in which a supervisor must report how its tracker ended, and end itself."""


@dataclass(frozen=True)
class Limits:
    """Limits of an isolated tracker.

    Attributes:
        frame_s: Time for one frame.
        memory_mb: Memory besides Python's own; 0 is no limit. Enforced on Linux only.
        make_s: Time for making the tracker, including imports and model files.
        namespaces: Whether its processes run in namespaces of their own where the system allows it (Linux).
    """

    frame_s: float = 60.0
    memory_mb: float = 4096.0
    make_s: float = 120.0
    namespaces: bool = True

    def __post_init__(self) -> None:
        if not self.frame_s > 0 or not self.memory_mb >= 0:
            given = f"{self.frame_s:g} and {self.memory_mb:g}"
            raise ParameterError(f"the time limit must be > 0 s and the memory limit >= 0 MB, got {given}")


class TrackerFault(Exception):
    """Failure of a tracker, in one line."""


class IsolatedTracker:
    """A tracker in a new process of its own, without state from earlier episodes.

    The tracker is made concurrently: only the first call waits for it.

    Args:
        name: For `trackers.make`.
        seed: Root seed of the episode.
        preset: Preset.
        params: Parameters.
        limits: Limits.

    Raises:
        RunError: This process may not start others.

    Attributes:
        took_ms: Time of the last call, measured in the child process.
    """

    def __init__(self, name: str, *, seed: int, preset: str, params: dict[str, Any], limits: Limits) -> None:
        self.took_ms = 0.0
        self._limits = limits
        self._truth: list[float] | None = None
        context = _context()
        self._requests, child_requests = socket.socketpair()
        self._life, child_life = socket.socketpair()
        self._output, child_output = context.Pipe(duplex=False)
        arguments = (child_requests, child_life, child_output, limits.memory_mb, limits.namespaces)
        self._process = context.Process(target=supervise, args=arguments, daemon=True)
        try:
            self._process.start()
        except AssertionError:
            raise RunError(
                "a daemon process may not start the process of a tracker: start Dask workers with --no-nanny, "
                "or with DASK_DISTRIBUTED__WORKER__DAEMON=False"
            ) from None
        finally:
            for opened in (child_requests, child_life, child_output):
                opened.close()
        self._printed = bytearray()
        self._printed_bytes = 0
        self._reader = threading.Thread(target=self._read_output, args=(self._output,), daemon=True)
        self._reader.start()
        self._needs_truth: bool | None = None
        # Failures here are reported by the first call.
        with contextlib.suppress(OSError):
            self._send({"name": name, "seed": seed, "preset": preset, "params": params}, limits.make_s)

    @property
    def needs_truth(self) -> bool:
        """Whether the tracker implements `NeedsTruth`; waits until it is made and raises TrackerFault if it fails."""
        self.wait_until_made()
        return bool(self._needs_truth)

    def wait_until_made(self) -> None:
        """Wait until the tracker is made; raises TrackerFault if it fails."""
        if self._needs_truth is None:
            try:
                self._needs_truth = bool(self._receive(self._limits.make_s).get("needs_truth"))
            except TrackerFault as error:
                raise TrackerFault(f"could not be made: {error}") from None

    def receive_truth(self, box: ArrayLike) -> None:
        """Pass on the target's true box in the next frame, for a tracker that `needs_truth`."""
        self._truth = [float(value) for value in np.asarray(box)]

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
            raise _unreadable(error) from None

    @property
    def printed(self) -> str | None:
        """The beginning of the tracker's standard output and error, or None."""
        if not self._printed_bytes:
            return None
        text = printable(bytes(self._printed).decode(errors="replace").strip(), 2 * _MAX_OUTPUT_BYTES)
        more = self._printed_bytes - len(self._printed)
        return f"{text} [and {more} bytes more]" if more else text

    def close(self) -> None:
        """End the process and its children. May be called twice."""
        self._life.close()
        if sys.platform == "linux":
            self._process.join(_END_S)  # the supervisor ends all of them
        pid = self._process.pid
        if pid is not None and self._process.is_alive():
            # It leads its own session; the leader may end before its group.
            with contextlib.suppress(ProcessLookupError, PermissionError):
                if hasattr(os, "killpg") and os.getpgid(pid) == pid:
                    os.killpg(pid, signal.SIGKILL)
            self._process.kill()
        self._process.join(_END_S)
        self._requests.close()
        self._reader.join(1.0)
        if not self._reader.is_alive():
            self._output.close()

    def _call(self, command: str, image: Image, **arguments: Any) -> dict[str, Any]:
        """Send an image and a command, and return the reply."""
        self.wait_until_made()
        request = {"command": command, **arguments, "shape": image.shape, "truth": self._truth}
        try:
            self._send(request, self._limits.frame_s)
            send(self._requests, np.ascontiguousarray(image).data, limit_s=self._limits.frame_s)
        except TimeoutError:
            raise TrackerFault(f"it did not read its image within {self._limits.frame_s:g} s") from None
        except OSError:
            raise TrackerFault(self._exit_reason()) from None
        return self._receive(self._limits.frame_s)

    def _send(self, request: dict[str, Any], limit_s: float) -> None:
        send(self._requests, json.dumps(request).encode(), limit_s=limit_s)

    def _receive(self, limit_s: float) -> dict[str, Any]:
        began_s = time.monotonic()
        try:
            content = receive(self._requests, limit_bytes=_MAX_REPLY_BYTES, limit_s=limit_s)
            message: object = json.loads(content)
        except TimeoutError:
            raise TrackerFault(f"no answer within {limit_s:g} s") from None
        except (EOFError, OSError):
            raise TrackerFault(self._exit_reason()) from None
        except (ChannelError, ValueError, RecursionError) as error:
            raise _unreadable(error) from None
        if not isinstance(message, dict):
            raise TrackerFault("its answer cannot be read: it is no table")
        reply = cast("dict[str, Any]", message)
        if "error" in reply:
            raise TrackerFault(one_line(str(reply["error"])))
        ms = reply.get("ms", 0.0)
        if isinstance(ms, bool) or not isinstance(ms, (int, float)) or not math.isfinite(ms) or ms < 0.0:
            raise TrackerFault("its answer cannot be read: the time taken is no number of milliseconds")
        self.took_ms = min(float(ms), (time.monotonic() - began_s) * 1e3)
        return reply

    def _exit_reason(self) -> str:
        try:
            how: object = json.loads(receive(self._life, limit_bytes=1000, limit_s=_END_S))
        except (EOFError, OSError, ChannelError, ValueError):
            how = None
        report = cast("dict[str, float]", how) if isinstance(how, dict) else {}
        if "memory_mb" in report:
            return f"it and its children used more than the memory limit of {report['memory_mb']:g} MB"
        self._process.join(_END_S)
        code = int(report["exit"]) if "exit" in report else self._process.exitcode
        if code is None or (not code and not report):
            return "it closed its side of the connection"
        if code < 0:
            return f"its process was ended by {signal.Signals(-code).name}"
        return f"its process ended with exit code {code}"

    def _read_output(self, output: Connection) -> None:
        while True:
            try:
                text = os.read(output.fileno(), 65536)
            except OSError:
                return
            if not text:
                return
            self._printed_bytes += len(text)
            self._printed += text[: max(_MAX_OUTPUT_BYTES - len(self._printed), 0)]


def try_make(name: str, *, preset: str, params: dict[str, Any], limits: Limits) -> None:
    """Make a tracker once, to report errors in its name, preset or parameters before a run.

    Raises:
        TrackerError: It cannot be made.
    """
    tracker = IsolatedTracker(name, seed=0, preset=preset, params=params, limits=limits)
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


def _unreadable(error: Exception) -> TrackerFault:
    return TrackerFault(f"its answer cannot be read: {one_line(str(error))}")


def _context() -> Any:
    """A fork server where available: forks of one clean process cost a hundredth of a new interpreter."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["pftrack_sim.trackers.isolation.supervisor"])
    return context
