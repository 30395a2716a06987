"""A process without threads that has imported what a tracker's supervisor needs, and forks one on request.

A fork of it costs a hundredth of a new interpreter. It is reached over a socket pair, not by a file, which a killed run
would leave behind. A server that does not answer in time, because it was stopped or killed from outside, is replaced.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from typing import Any, NoReturn

from pftrack_sim.core.errors import RunError
from pftrack_sim.core.inputs import environment_of_programs
from pftrack_sim.trackers.isolation.channel import ChannelError, receive, send

_IMPORT_S, _ANSWER_S = 60.0, 10.0
"""Time for the first answer, which follows the imports, and for the others."""

_MAX_BYTES = 1 << 20
_POLL_S = 0.002
_START = (
    "import sys; sys.path[:] = sys.argv[2:]; "
    "from pftrack_sim.trackers.isolation.fork_server import serve; serve(int(sys.argv[1]))"
)


class ForkServer:
    """Parent side of a server, which ends with this process."""

    def __init__(self) -> None:
        self._owner = os.getpid()
        self._limit_s, self._open = _IMPORT_S, True
        self._lock = threading.Lock()
        self._connection, theirs = socket.socketpair()
        with theirs:
            number = str(theirs.fileno())
            # In a session of its own no Ctrl-C reaches it. It looks for modules where this process does (-P).
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", _START, number, *sys.path],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                start_new_session=True,
                env=environment_of_programs(),
            )
        atexit.register(self.close)

    @property
    def usable(self) -> bool:
        """Whether it belongs to this process, which may be a fork, and has answered so far."""
        return self._open and self._owner == os.getpid()

    def ask(self, request: dict[str, Any], descriptors: Sequence[int] = ()) -> Any:
        """Send a request and return its answer.

        Raises:
            OSError, EOFError, ChannelError, ValueError: There is none; the server is closed.
        """
        with self._lock:
            try:
                send(self._connection, json.dumps(request).encode(), limit_s=self._limit_s)
                if descriptors:
                    socket.send_fds(self._connection, [b"d"], descriptors)
                answer = json.loads(receive(self._connection, limit_bytes=_MAX_BYTES, limit_s=self._limit_s))
            except BaseException:
                self.close()
                raise
            self._limit_s = _ANSWER_S
            return answer

    def close(self) -> None:
        """End the server, not what it forked. May be called twice."""
        atexit.unregister(self.close)
        self._open = False
        if self._owner == os.getpid():
            self._process.kill()
            self._process.wait()
        self._connection.close()


class ForkedProcess:
    """A process that a server forked.

    Attributes:
        pid: Its id.
        exit_code: Its exit code as that of `subprocess.Popen`; None while it runs, or where the server is gone.
    """

    def __init__(self, server: ForkServer, pid: int) -> None:
        self.pid, self.exit_code = pid, None
        self._server = server
        self._ended = False

    def wait(self, limit_s: float) -> bool:
        """Wait for the end of the process; returns whether it has ended."""
        end_s = time.monotonic() + limit_s
        while not self._ended:
            try:
                self._ended, self.exit_code = self._server.ask({"pid": self.pid})
            except (OSError, EOFError, ChannelError, ValueError):
                return False
            if not self._ended and time.monotonic() > end_s:
                return False
            time.sleep(0.0 if self._ended else _POLL_S)
        return True

    def kill(self) -> None:
        """Kill it, with its group if it leads one: the leader may end before the others."""
        if not self._ended:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                leads = os.getpgid(self.pid) == self.pid
                (os.killpg if leads else os.kill)(self.pid, signal.SIGKILL)


_server: ForkServer | None = None
_server_lock = threading.Lock()


def fork_supervisor(descriptors: Sequence[int], arguments: Sequence[Any]) -> ForkedProcess:
    """Fork a process that runs `supervise`, from the server of this process.

    Raises:
        RunError: Not on this system; or no server could be started.
    """
    global _server
    if not hasattr(os, "fork"):
        raise RunError("trackers in processes of their own need Linux or macOS; here there is --isolation never")
    problem: Exception | None = None
    with _server_lock:
        for _ in range(2):
            try:
                if _server is None or not _server.usable:
                    _server = ForkServer()
                request = {"folder": os.getcwd(), "path": sys.path, "arguments": arguments}
                return ForkedProcess(_server, int(_server.ask(request, descriptors)))
            except (OSError, EOFError, ChannelError, ValueError) as error:
                problem = error
    raise RunError(f"no process could be started for a tracker: {problem or 'no answer'}")


def serve(descriptor: int) -> NoReturn:
    """Serve requests until the parent closes the connection. Main function of the server."""
    from pftrack_sim.trackers.isolation.supervisor import supervise

    connection = socket.socket(fileno=descriptor)
    while True:
        try:
            request: dict[str, Any] = json.loads(receive(connection, limit_bytes=_MAX_BYTES))
            if "pid" in request:
                answer: Any = _exit_code(request["pid"])
            else:
                _, descriptors, _, _ = socket.recv_fds(connection, 1, 3)
                answer = os.fork()
                if answer == 0:
                    try:
                        connection.close()
                        os.chdir(request["folder"])
                        sys.path[:] = request["path"]
                        requests, life = (socket.socket(fileno=one) for one in descriptors[:2])
                        supervise(requests, life, descriptors[2], *request["arguments"])
                    finally:
                        os._exit(1)
                for one in descriptors:
                    os.close(one)
            send(connection, json.dumps(answer).encode())
        except (EOFError, OSError):
            os._exit(0)


def _exit_code(pid: int) -> tuple[bool, int | None]:
    """Whether a child has ended, and its exit code."""
    try:
        ended, status = os.waitpid(pid, os.WNOHANG)
    except ChildProcessError:  # it was told before
        return True, None
    return bool(ended), os.waitstatus_to_exitcode(status) if ended else None
