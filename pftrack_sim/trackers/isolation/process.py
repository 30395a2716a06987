"""Parent side of a tracker's process: requests, replies, what it prints, how it ended."""

from __future__ import annotations

import json
import math
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import wait
from typing import Any, cast

import numpy as np

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.records import Image
from pftrack_sim.core.text import LONGEST_TRACEBACK, one_line, printable
from pftrack_sim.trackers.isolation.channel import ChannelError, receive, send
from pftrack_sim.trackers.isolation.fork_server import fork_supervisor

_MAX_REPLY_BYTES = 16 * 1024 * 1024
_MAX_OUTPUT_BYTES = 2000
_MAX_PIPE_BYTES = 1 << 20
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
    """Failure of a tracker in one line, with its traceback where there is one."""

    def __init__(self, problem: str, traceback: str = "") -> None:
        super().__init__(problem)
        self.traceback = traceback


class TrackerProcess:
    """A process that makes a tracker and serves its episodes, one after the other.

    Args:
        limits: Limits.
        sandbox: Command line that runs Python in a sandbox; empty without one.

    Raises:
        RunError: No process can be started.

    Attributes:
        way: How episodes begin, see `child`; None until the tracker is loaded.
    """

    def __init__(self, limits: Limits, sandbox: Sequence[str] = ()) -> None:
        self.way: str | None = None
        self._requests, child_requests = socket.socketpair()
        self._life, child_life = socket.socketpair()
        output, child_output = os.pipe()
        self._output = open(output, "rb", buffering=0)  # noqa: SIM115 - open for the lifetime of the process
        try:
            self._process = fork_supervisor(
                (child_requests.fileno(), child_life.fileno(), child_output),
                (limits.memory_mb, limits.namespaces, tuple(sandbox)),
            )
        finally:
            child_requests.close()
            child_life.close()
            os.close(child_output)
        self._reader = _OutputReader(self._output.fileno())

    def send(self, request: dict[str, Any], limit_s: float, image: Image | None = None) -> None:
        """Send a request, with an image where there is one.

        Raises:
            TimeoutError: The process does not read.
            OSError: The connection is closed.
        """
        send(self._requests, json.dumps(request).encode(), limit_s=limit_s)
        if image is not None:
            send(self._requests, np.ascontiguousarray(image).data, limit_s=limit_s)

    def receive(self, limit_s: float) -> dict[str, Any]:
        """Receive a reply.

        Raises:
            TrackerFault: None came, it cannot be read, or it is an error.
        """
        try:
            content = receive(self._requests, limit_bytes=_MAX_REPLY_BYTES, limit_s=limit_s)
            message: object = json.loads(content)
        except TimeoutError:
            raise TrackerFault(f"no answer within {limit_s:g} s") from None
        except (EOFError, OSError):
            raise TrackerFault(self.exit_reason()) from None
        except (ChannelError, ValueError, RecursionError) as error:
            raise unreadable(error) from None
        if not isinstance(message, dict):
            raise TrackerFault("its answer cannot be read: it is no table")
        reply = cast("dict[str, Any]", message)
        if "error" in reply:
            raise TrackerFault(
                one_line(str(reply["error"])), printable(str(reply.get("traceback", "")), LONGEST_TRACEBACK)
            )
        return reply

    def end_episode(self) -> bool:
        """End an episode; whether the process can serve another."""
        try:
            self.send({"command": "end"}, _END_S)
            if self.receive(_END_S) != {"ended": True}:
                return False
            # An episode's process may have written more than it was asked for.
            self._requests.setblocking(False)
            self._requests.recv(1)
        except BlockingIOError:
            return True
        except (TrackerFault, OSError):
            return False
        return False

    def take_output(self) -> str | None:
        """Stop listening; the beginning of what was printed since `listen`, or None. May be called twice."""
        return self._reader.stop()

    @property
    def printed(self) -> str | None:
        """The beginning of what was printed so far, or None."""
        return self._reader.text

    def listen(self) -> None:
        """Read what is printed from now on."""
        self._reader = _OutputReader(self._output.fileno())

    def exit_reason(self) -> str:
        """How the process ended."""
        try:
            how: object = json.loads(receive(self._life, limit_bytes=1000, limit_s=_END_S))
        except (EOFError, OSError, ChannelError, ValueError):
            how = None
        report = cast("dict[str, float]", how) if isinstance(how, dict) else {}
        if "memory_mb" in report:
            return f"it and its children used more than the memory limit of {report['memory_mb']:g} MB"
        if "processes" in report:
            return f"it started {report['processes']:g} processes or more"
        self._process.wait(_END_S)
        code = int(report["exit"]) if "exit" in report else self._process.exit_code
        if code is None or (not code and not report):
            return "it closed its side of the connection"
        if code < 0:
            return f"its process was ended by {signal.Signals(-code).name}"
        return f"its process ended with exit code {code}"

    def close(self) -> None:
        """End the process and its children. May be called twice."""
        self._life.close()
        # On Linux the supervisor ends all of them.
        if not self._process.wait(_END_S if sys.platform == "linux" else 0.0):
            self._process.kill()
            self._process.wait(_END_S)
        self._requests.close()
        self._reader.stop()
        self._output.close()


class _OutputReader:
    """Reads a pipe beside the process that writes to it, and keeps the beginning."""

    def __init__(self, descriptor: int) -> None:
        os.set_blocking(descriptor, False)
        self._kept = bytearray()
        self._count = 0
        self._stopped, self._stop = os.pipe()
        self._thread: threading.Thread | None = threading.Thread(target=self._run, args=(descriptor,), daemon=True)
        self._thread.start()

    @property
    def text(self) -> str | None:
        """What was read so far, or None."""
        if not self._count:
            return None
        text = printable(bytes(self._kept).decode(errors="replace").strip(), 2 * _MAX_OUTPUT_BYTES)
        more = self._count - len(self._kept)
        return f"{text} [and {more} bytes more]" if more else text

    def stop(self) -> str | None:
        """Read what the pipe still holds, and no more. May be called twice."""
        if self._thread is not None:
            os.close(self._stop)
            self._thread.join()
            os.close(self._stopped)
            self._thread = None
        return self.text

    def _run(self, descriptor: int) -> None:
        last = math.inf
        while self._count < last:
            # Nothing but the end of this object is ever read from the second pipe.
            if last == math.inf and self._stopped in wait([descriptor, self._stopped]):
                last = self._count + _MAX_PIPE_BYTES
            try:
                content = os.read(descriptor, 65536)
            except BlockingIOError:
                if last < math.inf:
                    return
                continue
            except OSError:
                return
            if not content:
                return
            self._count += len(content)
            self._kept += content[: max(_MAX_OUTPUT_BYTES - len(self._kept), 0)]


def unreadable(error: Exception) -> TrackerFault:
    """The fault of a tracker whose reply is wrong."""
    return TrackerFault(f"its answer cannot be read: {one_line(str(error))}")


def took_ms(reply: dict[str, Any], began_s: float) -> float:
    """Time of a call as the child measured it, at most as long as the parent waited; raises TrackerFault."""
    ms = reply.get("ms", 0.0)
    if isinstance(ms, bool) or not isinstance(ms, (int, float)) or not math.isfinite(ms) or ms < 0.0:
        raise TrackerFault("its answer cannot be read: the time taken is no number of milliseconds")
    return min(float(ms), (time.monotonic() - began_s) * 1e3)
