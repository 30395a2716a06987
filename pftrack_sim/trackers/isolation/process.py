"""Processes of isolated trackers, from the parent's side, with every failure as one exception type.

Requests, replies, what a process prints, how it ended, and the processes kept between episodes.
"""

from __future__ import annotations

import contextlib
import functools
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from typing import Any, cast

import numpy as np

from pftrack_sim.core.errors import ParameterError, PftrackError, RunError
from pftrack_sim.core.inputs import environment_of_programs
from pftrack_sim.core.records import Image
from pftrack_sim.core.text import LONGEST_TRACEBACK, one_line, printable
from pftrack_sim.trackers.isolation.child import LENGTH
from pftrack_sim.trackers.isolation.machine_code import MachineCode
from pftrack_sim.trackers.isolation.sandbox import sandbox_command
from pftrack_sim.trackers.registry import is_builtin

_MAX_REPLY_BYTES = 16 * 1024 * 1024
_MAX_OUTPUT_BYTES = 2000
_MAX_PIPE_BYTES = 1 << 20
_MAX_OPENED, _MAX_NAME = 10_000, 4096
"""Number of files that a tracker may open, and length of a name."""
_MOST_S, _MOST_MB = 1e6, 1e9
"""Largest limits of time and memory that the system takes."""
_END_S = 5.0
"""Time in which a supervisor must report how its tracker ended, and end itself."""

_START = (
    "import json, sys; settings = json.loads(sys.argv.pop()); sys.path[:] = settings['path']; "
    "from pftrack_sim.trackers.isolation.supervisor import supervise; supervise(settings)"
)


@dataclass(frozen=True)
class Limits:
    """Limits of an isolated tracker.

    Attributes:
        frame_s: Time for one frame.
        memory_mb: Memory besides Python's own; 0 is no limit. Enforced on Linux only.
        make_s: Time for making the tracker, including imports and model files.
        processes: Number of processes at which it is ended. Enforced on Linux only.
    """

    frame_s: float = 60.0
    memory_mb: float = 4096.0
    make_s: float = 120.0
    processes: int = 4096

    def __post_init__(self) -> None:
        if not 0.0 < self.frame_s <= _MOST_S or not 0.0 <= self.memory_mb <= _MOST_MB:
            raise ParameterError(
                f"the time limit must be above 0 and at most {_MOST_S:g} s, and the memory limit 0 to {_MOST_MB:g} MB, "
                f"got {self.frame_s:g} and {self.memory_mb:g}"
            )


@dataclass(frozen=True)
class TrackerCode:
    """What a process loads.

    Attributes:
        name: For `trackers.make`.
        preset: Preset.
        params: Parameters.
        limits: Limits.
        sandboxed: Whether it runs in a sandbox, see `sandbox`.
    """

    name: str
    preset: str = "default"
    params: Mapping[str, Any] = field(default_factory=dict[str, Any])
    limits: Limits = Limits()
    sandboxed: bool = False


class TrackerFault(Exception):
    """Failure of a tracker in one line, with its traceback where there is one."""

    def __init__(self, problem: str, traceback: str = "") -> None:
        super().__init__(problem)
        self.traceback = traceback


@functools.cache
def namespace_command() -> tuple[str, ...]:
    """Words before a command that give it PID and user namespaces of its own; none where the system has none."""
    words = ("unshare", "--user", "--map-current-user", "--pid", "--fork", "--kill-child")
    if sys.platform != "linux" or shutil.which(words[0]) is None:
        return ()
    return words if subprocess.run([*words, "true"], capture_output=True, check=False).returncode == 0 else ()


class TrackerProcess:
    """A process that makes a tracker and serves its episodes, one after the other.

    Args:
        code: What it loads.
        once: Whether it serves one episode only.

    Attributes:
        opened: Digests of the files that it has loaded and opened, by name, see `OpenedFiles`.

    Raises:
        RunError: No process can be started.
        ParameterError: There is no sandbox here.
    """

    def __init__(self, code: TrackerCode, *, once: bool) -> None:
        self.code = code
        self._broken = False
        self._machine_code: MachineCode | None = None
        environment = environment_of_programs()
        if not code.sandboxed and not is_builtin(code.name):
            with contextlib.suppress(OSError, PftrackError):  # an unknown name is reported by the process
                self._machine_code = MachineCode(code.name)
                environment["NUMBA_CACHE_DIR"] = str(self._machine_code.folder)
        if code.sandboxed:
            command, path = sandbox_command(code.params, code.limits.memory_mb)
        else:
            # It looks for modules where this process does (-P).
            command, path = [*namespace_command(), sys.executable, "-P"], sys.path
        self._requests, requests = socket.socketpair()
        self._life, life = socket.socketpair()
        settings = {
            "name": code.name,
            "preset": code.preset,
            "params": dict(code.params),
            "once": once,
            "path": path,
            "memory_mb": code.limits.memory_mb,
            "processes": code.limits.processes,
            "requests": requests.fileno(),
            "life": life.fileno(),
        }
        try:
            self._process = subprocess.Popen(
                [*command, "-c", _START, json.dumps(settings)],
                pass_fds=[requests.fileno(), life.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # no Ctrl-C reaches it
                env=environment,
            )
        except OSError as error:
            raise RunError(f"no process could be started for a tracker: {error}") from None
        finally:
            requests.close()
            life.close()
        assert self._process.stdout is not None
        self._output = self._process.stdout.fileno()
        os.set_blocking(self._output, False)
        self.listen()

    def send(self, request: dict[str, Any], limit_s: float, image: Image | None = None) -> None:
        """Send a request, with an image where there is one.

        Raises:
            TrackerFault: The process does not read, or has closed the connection.
        """
        pixels = [] if image is None else [np.ascontiguousarray(image).data.cast("B")]
        self._requests.settimeout(limit_s)
        try:
            for message in [json.dumps(request).encode(), *pixels]:
                self._requests.sendall(LENGTH.pack(len(message)))
                self._requests.sendall(message)
        except TimeoutError:
            raise self._fault(f"it did not read its image within {limit_s:g} s") from None
        except OSError:
            raise self._fault(self._exit_reason()) from None

    def receive(self, limit_s: float) -> dict[str, Any]:
        """Receive a reply; the whole of it has one deadline.

        Raises:
            TrackerFault: None came, it cannot be read, or it is an error.
        """
        end_s = time.monotonic() + limit_s
        try:
            (length,) = LENGTH.unpack(self._read(LENGTH.size, end_s))
            if length > _MAX_REPLY_BYTES:
                raise ValueError(f"a message of {length} bytes; at most {_MAX_REPLY_BYTES} are read")
            reply: object = json.loads(self._read(length, end_s))
            if not isinstance(reply, dict):
                raise ValueError("it is no table")
        except TimeoutError:
            raise self._fault(f"no answer within {limit_s:g} s") from None
        except (EOFError, OSError):
            raise self._fault(self._exit_reason()) from None
        except (ValueError, RecursionError) as error:
            raise self.unreadable(error) from None
        table = cast("dict[str, Any]", reply)
        if opened := table.pop("opened", None):
            self._note_opened(opened)
        if "error" in table:
            traceback = printable(str(table.get("traceback", "")), LONGEST_TRACEBACK)
            raise self._fault(one_line(str(table["error"])), traceback)
        return table

    def _note_opened(self, opened: object) -> None:
        entries = list(cast("dict[Any, Any]", opened).items()) if isinstance(opened, dict) else []
        if not all(isinstance(word, str) and len(word) < _MAX_NAME for entry in entries for word in entry):
            raise self._fault("its answer cannot be read: it names files wrongly")
        if len(self.opened) + len(entries) > _MAX_OPENED:
            raise self._fault(f"it opened more than {_MAX_OPENED} files")
        self.opened |= {printable(name, _MAX_NAME): digest for name, digest in entries}
        if self._machine_code is not None:
            self._machine_code.note(self.opened)

    def _read(self, count: int, end_s: float) -> bytearray:
        """Read from the connection, and beside it what is printed: one that waits for its output never answers."""
        content = bytearray()
        while len(content) < count:
            left_s = end_s - time.monotonic()
            output = [] if self._output_ended else [self._output]
            ready = wait([self._requests, *output], left_s) if left_s > 0.0 else []
            if not ready:
                raise TimeoutError
            if self._output in ready:
                self._read_output()
            if self._requests in ready:
                part = self._requests.recv(count - len(content))
                if not part:
                    raise EOFError
                content += part
        return content

    def unreadable(self, error: Exception) -> TrackerFault:
        """The fault that a reply is wrong."""
        return self._fault(f"its answer cannot be read: {one_line(str(error))}")

    def _fault(self, problem: str, traceback: str = "") -> TrackerFault:
        self._broken = True
        return TrackerFault(problem, traceback)

    def end_episode(self) -> bool:
        """End an episode; whether the process can serve another. It cannot after a fault."""
        if self._broken:
            return False
        try:
            self.send({"command": "end"}, _END_S)
            ended = self.receive(_END_S)
        except TrackerFault:
            return False
        # An episode's process may have written more than it was asked for.
        return ended == {"ended": True} and not wait([self._requests], 0.0)

    def listen(self) -> None:
        """Forget what was printed and opened so far."""
        self.opened: dict[str, str] = {}
        self._kept, self._printed_bytes, self._output_ended = bytearray(), 0, False

    @property
    def printed(self) -> str | None:
        """The beginning of what was printed since `listen`, or None."""
        self._read_rest()
        if not self._printed_bytes:
            return None
        text = printable(bytes(self._kept).decode(errors="replace").strip(), 2 * _MAX_OUTPUT_BYTES)
        more = self._printed_bytes - len(self._kept)
        return f"{text} [and {more} bytes more]" if more else text

    def _read_rest(self) -> None:
        last = self._printed_bytes + _MAX_PIPE_BYTES
        while self._printed_bytes < last and self._read_output():
            continue

    def _read_output(self) -> bool:
        """Read some of what was printed; whether there was any."""
        try:
            content = b"" if self._output_ended else os.read(self._output, 65536)
            self._output_ended = not content
        except BlockingIOError:
            return False
        self._printed_bytes += len(content)
        self._kept += content[: max(_MAX_OUTPUT_BYTES - len(self._kept), 0)]
        return bool(content)

    def _exit_reason(self) -> str:
        self._life.settimeout(_END_S)
        report: dict[str, float] = {}
        with contextlib.suppress(OSError, ValueError):
            report = json.loads(self._life.recv(1000))
        if "memory_mb" in report:
            return f"it and its children used more than the memory limit of {report['memory_mb']:g} MB"
        if "processes" in report:
            return f"it started {report['processes']:g} processes or more"
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_S)
        code = int(report["exit"]) if "exit" in report else self._process.returncode
        if code is None or (not code and not report):
            return "it closed its side of the connection"
        number = -code if code < 0 else code - 128
        if number in {*signal.Signals}:
            return f"its process was ended by {signal.Signals(number).name}"
        return f"its process ended with exit code {code}"

    def close(self) -> None:
        """End the process and its children. May be called twice."""
        with contextlib.suppress(OSError):
            self._life.shutdown(socket.SHUT_RDWR)  # the supervisor ends all of them
        self._life.close()
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        self._requests.close()
        self._read_rest()
        self._output_ended = True
        if self._process.stdout is not None:
            self._process.stdout.close()


class TrackerProcesses:
    """Processes of trackers, kept between episodes so that each is loaded once; ended by `close`."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: defaultdict[str, list[TrackerProcess]] = defaultdict(list)
        self._serve_once: set[str] = set()
        self._next: dict[str, TrackerProcess] = {}

    def take(self, code: TrackerCode) -> TrackerProcess:
        """A process that has loaded the tracker, or a new one that begins to; errors are those of `TrackerProcess`."""
        with self._lock:
            if self._idle[repr(code)]:
                process = self._idle[repr(code)].pop()
                process.listen()
                return process
            if repr(code) not in self._serve_once:
                return TrackerProcess(code, once=False)
            process = self._next.pop(repr(code), None) or TrackerProcess(code, once=True)
            # That of the next episode imports the tracker's code while this one runs.
            with contextlib.suppress(RunError):  # the next episode will say so
                self._next[repr(code)] = TrackerProcess(code, once=True)
            return process

    def give_back(self, process: TrackerProcess) -> None:
        """Keep a process that can serve another episode."""
        with self._lock:
            self._idle[repr(process.code)].append(process)

    def expect_one_episode(self, code: TrackerCode) -> None:
        """Load this tracker anew for each episode from now on: its processes can serve only one."""
        with self._lock:
            self._serve_once.add(repr(code))

    def close(self) -> None:
        """End the processes that are kept. May be called twice."""
        with self._lock:
            kept = [*sum(self._idle.values(), list[TrackerProcess]()), *self._next.values()]
            self._idle.clear()
            self._next.clear()
        for process in kept:
            process.close()

    def __enter__(self) -> TrackerProcesses:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
