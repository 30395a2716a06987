"""Parent side of an isolated tracker: the tracker interface, with every failure as one exception type."""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import signal
import threading
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.shared_memory import SharedMemory
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import BoxError, ParameterError, RunError, TrackerError
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.trackers.isolation.child import serve

_MAX_REPLY_BYTES = 16 * 1024 * 1024
_MAX_OUTPUT_BYTES = 2000


@dataclass(frozen=True)
class Limits:
    """Limits of an isolated tracker.

    Attributes:
        frame_s: Time for one frame.
        memory_mb: Memory besides Python's own; 0 is no limit. Enforced on Linux only.
        make_s: Time for making the tracker, including imports and model files.
    """

    frame_s: float = 60.0
    memory_mb: float = 4096.0
    make_s: float = 120.0

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
        self._shared: SharedMemory | None = None
        self._shape: tuple[int, ...] = ()
        self._truth: list[float] | None = None
        context = _context()
        self._requests, child_requests = context.Pipe()
        self._output, child_output = context.Pipe(duplex=False)
        arguments = (child_requests, child_output, limits.memory_mb)
        self._process = context.Process(target=serve, args=arguments, daemon=True)
        try:
            self._process.start()
        except AssertionError:
            raise RunError(
                "a daemon process may not start the process of a tracker: start Dask workers with --no-nanny, "
                "or with DASK_DISTRIBUTED__WORKER__DAEMON=False"
            ) from None
        child_requests.close()
        child_output.close()
        self._printed = bytearray()
        self._printed_bytes = 0
        self._reader = threading.Thread(target=self._read_output, args=(self._output,), daemon=True)
        self._reader.start()
        self._needs_truth: bool | None = None
        # Failures here are reported by the first call.
        with contextlib.suppress(OSError):
            self._send({"name": name, "seed": seed, "preset": preset, "params": params})

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
            box = np.array(reply["box"], dtype=np.float64)
            return Estimate(box, reply["confidence"], reply["occluded"], reply["particles"])
        except (KeyError, TypeError, ValueError, BoxError) as error:
            raise TrackerFault(f"its answer cannot be read: {error}") from None

    @property
    def printed(self) -> str | None:
        """The beginning of the tracker's standard output and error, or None."""
        if not self._printed_bytes:
            return None
        text = bytes(self._printed).decode(errors="replace").strip()
        more = self._printed_bytes - len(self._printed)
        return f"{text} [and {more} bytes more]" if more else text

    def close(self) -> None:
        """End the process and its children. May be called twice."""
        pid = self._process.pid
        if pid is not None:
            # The process leads its own session; the leader may end before its group.
            with contextlib.suppress(ProcessLookupError, PermissionError):
                if hasattr(os, "killpg") and os.getpgid(pid) == pid:
                    os.killpg(pid, signal.SIGKILL)
        self._process.kill()
        self._process.join()
        self._requests.close()
        self._reader.join(1.0)
        if not self._reader.is_alive():
            self._output.close()
        self._free_image()

    def _free_image(self) -> None:
        if self._shared is not None:
            self._shared.close()
            self._shared.unlink()
            self._shared = None

    def _call(self, command: str, image: Image, **arguments: Any) -> dict[str, Any]:
        """Send an image and a command, and return the reply."""
        if self._shared is None or self._shape != image.shape:
            self._free_image()
            self._shared = SharedMemory(create=True, size=image.nbytes)
            self._shape = image.shape
        # One shared memory per tracker: a tracker cannot modify the image of another.
        np.ndarray(image.shape, dtype=np.uint8, buffer=self._shared.buf)[:] = image
        self.wait_until_made()
        frame = {"memory": self._shared.name, "shape": self._shape, "truth": self._truth}
        try:
            self._send({"command": command, **arguments, **frame})
        except OSError:
            raise TrackerFault(self._exit_reason()) from None
        return self._receive(self._limits.frame_s)

    def _send(self, request: dict[str, Any]) -> None:
        self._requests.send_bytes(json.dumps(request).encode())

    def _receive(self, limit_s: float) -> dict[str, Any]:
        try:
            if not self._requests.poll(limit_s):
                raise TrackerFault(f"no answer within {limit_s:g} s")
            message: object = json.loads(self._requests.recv_bytes(_MAX_REPLY_BYTES))
        except (EOFError, OSError):
            raise TrackerFault(self._exit_reason()) from None
        except ValueError as error:
            raise TrackerFault(f"its answer cannot be read: {error}") from None
        if not isinstance(message, dict):
            raise TrackerFault("its answer cannot be read")
        reply = cast("dict[str, Any]", message)
        if "error" in reply:
            raise TrackerFault(str(reply["error"]))
        ms = reply.get("ms", 0.0)
        self.took_ms = float(ms) if isinstance(ms, (int, float)) else 0.0
        return reply

    def _exit_reason(self) -> str:
        self._process.join(5.0)
        code = self._process.exitcode
        if code is None:
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
        raise TrackerError(text if name in text else f"tracker {name!r} could not be made: {text}") from None
    finally:
        tracker.close()


def _context() -> Any:
    """A fork server where available: forks of one clean process cost a hundredth of a new interpreter."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["pftrack_sim.trackers.isolation.child"])
    return context
