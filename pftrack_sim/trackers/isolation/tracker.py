"""The outside of a tracker's process: it looks like a tracker, and turns every misdeed into one exception."""

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
_KEPT_NOISE_BYTES = 2000


@dataclass(frozen=True)
class Limits:
    """What a tracker in a process of its own may take.

    Attributes:
        frame_s: Time for one frame.
        memory_mb: Memory on top of what Python takes; 0 is no limit. Held on Linux only.
        make_s: Time for being made, with all that is imported and loaded for it.
    """

    frame_s: float = 60.0
    memory_mb: float = 4096.0
    make_s: float = 120.0

    def __post_init__(self) -> None:
        if not self.frame_s > 0 or not self.memory_mb >= 0:
            raise ParameterError(
                "the time limit must be > 0 s and the memory limit >= 0 MB, "
                f"got {self.frame_s:g} and {self.memory_mb:g}"
            )


class TrackerFault(Exception):
    """What a tracker did wrong, in one line."""


class IsolatedTracker:
    """A tracker that runs in a process of its own; fresh, so that nothing is left over from other episodes.

    It is made while the caller goes on: only the first question waits for it.

    Args:
        name: For `trackers.make`.
        seed: Root seed of the episode.
        preset: Its preset.
        params: Its parameters.
        limits: What it may take.

    Raises:
        RunError: This process may not start others.

    Attributes:
        took_ms: Time that it took for the last frame, measured beside it: without the way there and back.
    """

    def __init__(self, name: str, *, seed: int, preset: str, params: dict[str, Any], limits: Limits) -> None:
        self.took_ms = 0.0
        self._limits = limits
        self._shared: SharedMemory | None = None
        self._shape: tuple[int, ...] = ()
        self._truth: list[float] | None = None
        context = _context()
        self._orders, theirs = context.Pipe()
        self._noise, noise = context.Pipe(duplex=False)
        self._process = context.Process(target=serve, args=(theirs, noise, limits.memory_mb), daemon=True)
        try:
            self._process.start()
        except AssertionError:
            raise RunError(
                "a daemon process may not start the process of a tracker: start Dask workers with --no-nanny, "
                "or with DASK_DISTRIBUTED__WORKER__DAEMON=False"
            ) from None
        theirs.close()
        noise.close()
        self._heard = bytearray()
        self._heard_bytes = 0
        self._listener = threading.Thread(target=self._listen, args=(self._noise,), daemon=True)
        self._listener.start()
        self._needs_truth: bool | None = None
        # What goes wrong here is told when it is first asked something.
        with contextlib.suppress(OSError):
            order = {"do": "make", "name": name, "seed": seed, "preset": preset, "params": params}
            self._orders.send_bytes(json.dumps(order).encode())

    @property
    def needs_truth(self) -> bool:
        """Whether it asks for the truth; waits until it is made, and raises Misbehaviour when it cannot be."""
        self.wait_until_made()
        return bool(self._needs_truth)

    def wait_until_made(self) -> None:
        """Wait until it can be asked; raises Misbehaviour when it cannot be made."""
        if self._needs_truth is None:
            try:
                self._needs_truth = bool(self._reply(self._limits.make_s).get("needs_truth"))
            except TrackerFault as error:
                raise TrackerFault(f"could not be made: {error}") from None

    def receive_truth(self, box: ArrayLike) -> None:
        """The target's true box in the frame to come, for a tracker that `needs_truth`."""
        self._truth = [float(number) for number in np.asarray(box)]

    def init(self, image: Image, box: ArrayLike) -> None:
        """As `Tracker.init`; raises Misbehaviour."""
        self._show(image)
        self._ask({"do": "init", "box": [float(number) for number in np.asarray(box)], **self._frame()})

    def update(self, image: Image) -> Estimate:
        """As `Tracker.update`; raises Misbehaviour."""
        self._show(image)
        said = self._ask({"do": "update", **self._frame()})
        try:
            return Estimate(
                np.array(said["box"], dtype=np.float64), said["confidence"], said["occluded"], said["particles"]
            )
        except (KeyError, TypeError, ValueError, BoxError) as error:
            raise TrackerFault(f"its answer cannot be read: {error}") from None

    @property
    def printed(self) -> str | None:
        """The beginning of what it printed, or None."""
        if not self._heard_bytes:
            return None
        text = bytes(self._heard).decode(errors="replace").strip()
        more = self._heard_bytes - len(self._heard)
        return f"{text} [and {more} bytes more]" if more else text

    def close(self) -> None:
        """End the process and everything it started. Closing twice is fine."""
        pid = self._process.pid
        if pid is not None:
            # It leads a session of its own, with whatever it started in it. Its leader may be gone before its group.
            with contextlib.suppress(ProcessLookupError, PermissionError):
                if hasattr(os, "killpg") and os.getpgid(pid) == pid:
                    os.killpg(pid, signal.SIGKILL)
        self._process.kill()
        self._process.join()
        self._orders.close()
        self._listener.join(1.0)
        if not self._listener.is_alive():
            self._noise.close()
        if self._shared is not None:
            self._shared.close()
            self._shared.unlink()
            self._shared = None

    def _frame(self) -> dict[str, Any]:
        assert self._shared is not None
        return {"memory": self._shared.name, "shape": self._shape, "truth": self._truth}

    def _show(self, image: Image) -> None:
        if self._shared is None or self._shape != image.shape:
            if self._shared is not None:
                self._shared.close()
                self._shared.unlink()
            self._shared = SharedMemory(create=True, size=image.nbytes)
            self._shape = image.shape
        # Memory of its own for each tracker: nothing that one does to it can reach another.
        np.ndarray(image.shape, dtype=np.uint8, buffer=self._shared.buf)[:] = image

    def _ask(self, order: dict[str, Any]) -> dict[str, Any]:
        self.wait_until_made()
        try:
            self._orders.send_bytes(json.dumps(order).encode())
        except OSError:
            raise TrackerFault(self._how_it_ended()) from None
        return self._reply(self._limits.frame_s)

    def _reply(self, limit_s: float) -> dict[str, Any]:
        try:
            if not self._orders.poll(limit_s):
                raise TrackerFault(f"no answer within {limit_s:g} s")
            answer: object = json.loads(self._orders.recv_bytes(_MAX_REPLY_BYTES))
        except (EOFError, OSError):
            raise TrackerFault(self._how_it_ended()) from None
        except ValueError as error:
            raise TrackerFault(f"its answer cannot be read: {error}") from None
        if not isinstance(answer, dict):
            raise TrackerFault("its answer cannot be read")
        reply = cast("dict[str, Any]", answer)
        if "error" in reply:
            raise TrackerFault(str(reply["error"]))
        took = reply.get("ms", 0.0)
        self.took_ms = float(took) if isinstance(took, (int, float)) else 0.0
        return reply

    def _how_it_ended(self) -> str:
        self._process.join(5.0)
        code = self._process.exitcode
        if code is None:
            return "it closed its side of the connection"
        if code < 0:
            return f"its process was ended by {signal.Signals(-code).name}"
        return f"its process ended with exit code {code}"

    def _listen(self, noise: Connection) -> None:
        while True:
            try:
                some = os.read(noise.fileno(), 65536)
            except OSError:
                return
            if not some:
                return
            self._heard_bytes += len(some)
            room = _KEPT_NOISE_BYTES - len(self._heard)
            self._heard += some[: max(room, 0)]


def try_make(name: str, *, preset: str, params: dict[str, Any], limits: Limits) -> None:
    """Make a tracker once, to tell mistakes in its name, preset or parameters before anything is run.

    Raises:
        TrackerError: It cannot be made, and why.
    """
    tracker = IsolatedTracker(name, seed=0, preset=preset, params=params, limits=limits)
    try:
        tracker.wait_until_made()
    except TrackerFault as error:
        text = str(error).removeprefix("could not be made: ")
        # What our own registry says is plain already.
        for known in ("TrackerError: ", "ParameterError: ", "UnknownNameError: "):
            text = text.removeprefix(known)
        raise TrackerError(text if name in text else f"tracker {name!r} could not be made: {text}") from None
    finally:
        tracker.close()


def _context() -> Any:
    """Forks of one clean process where the system can: fresh ones at a hundredth of the price of a new interpreter."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["pftrack_sim.trackers.isolation.child"])
    return context
