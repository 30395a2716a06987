"""First process of an isolated tracker: it starts the tracker, watches its limits, and ends with all that it started.

    run --- supervisor --- tracker, loaded --- tracker, in an episode --- whatever it starts

On Linux the supervisor is the first process of a PID namespace where the system allows one (`process`, `sandbox`):
processes inside cannot signal anything outside, and the kernel ends all of them with the supervisor. Elsewhere it is a
subreaper: what the tracker leaves behind becomes its child and is killed.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import json
import os
import select
import signal
import socket
import sys
import time
from io import TextIOWrapper
from pathlib import Path
from typing import Any, NoReturn

from pftrack_sim.core.memory import data_segment_kb, sum_kb
from pftrack_sim.trackers.isolation.child import Server

_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
_WATCH_PERIOD_S = 0.1
_END_S = 5.0
"""Time for ending processes."""


def supervise(settings: dict[str, Any]) -> NoReturn:
    """Run a tracker until it ends or the parent closes the socket `life`. Main function of the process.

    Args:
        settings: Descriptors of the sockets `requests` and `life`, `memory_mb` and `processes` of `Limits`, and what
            the tracker is made of, see `child.Server`.
    """
    for stream in (sys.stdout, sys.stderr):
        # Printed lines are written at once: a process that is killed loses what is in its buffers.
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(encoding="utf-8", errors="backslashreplace", line_buffering=True)
    faulthandler.enable()
    requests, life = (socket.socket(fileno=settings[key]) for key in ("requests", "life"))
    contained = os.getpid() == 1
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    tracker = os.fork()
    if tracker == 0:
        life.close()
        # Where the system shares processor time among sessions, many processes do not slow their supervisor down.
        os.setsid()
        _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        # What an episode leaves behind becomes a child of the process that is kept, which kills it.
        _prctl(_PR_SET_CHILD_SUBREAPER, 1)
        _limit(settings["memory_mb"])
        Server(requests, settings, lambda: end_descendants(contained=contained)).run()
    requests.close()
    how = _watch(life, tracker, settings["memory_mb"], settings["processes"])
    with contextlib.suppress(OSError):
        life.sendall(json.dumps(how).encode())
    if not contained:
        end_descendants(contained=False)
    os._exit(0)


def _watch(life: socket.socket, tracker: int, memory_mb: float, max_processes: int) -> dict[str, float]:
    """Wait until the tracker ends, exceeds a limit, or is no longer wanted; returns how it ended."""
    own_kb = _memory_kb("self")
    while not select.select([life], [], [], _WATCH_PERIOD_S)[0]:
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            if ended[0] == tracker:
                return {"exit": os.waitstatus_to_exitcode(ended[1])}
        processes = _descendants(max_processes)
        if len(processes) >= max_processes:
            return {"processes": max_processes}
        limit_kb = memory_mb * 1024
        if (
            memory_mb > 0
            and sum(max(_memory_kb(pid) - own_kb, 0.0) for pid in processes) > limit_kb
            # Pages that forks share were counted once for each: the exact figure is slower.
            and sum(_proportional_kb(pid) for pid in processes) > limit_kb
        ):
            return {"memory_mb": memory_mb}
    return {}


def end_descendants(*, contained: bool) -> None:
    """Kill and reap every descendant of this process, which must be a subreaper so that none escapes it.

    Args:
        contained: Whether all processes but this one and the first belong to the tracker. `/proc` may then show the
            numbers of another namespace.
    """
    end_s = time.monotonic() + _END_S
    while time.monotonic() < end_s:
        for pid in [-1] if contained else map(int, _descendants()):
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        try:
            while os.waitpid(-1, os.WNOHANG)[0]:
                continue
        except ChildProcessError:
            return
        time.sleep(0.002)


def _descendants(at_most: int = 4096) -> list[str]:
    """Children of this process, theirs, and so on: their names in Linux's `/proc`."""
    found, rest = list[str](), ["self"]
    while rest and len(found) < at_most:
        with contextlib.suppress(OSError):
            for task in Path(f"/proc/{rest.pop()}/task").iterdir():
                below = (task / "children").read_text(encoding="ascii").split()
                found += below
                rest += below
    return found


def _memory_kb(pid: str) -> float:
    """Anonymous and shared memory in use, without mapped files."""
    return sum_kb(f"/proc/{pid}/status", ("RssAnon:", "RssShmem:", "VmSwap:"))


def _proportional_kb(pid: str) -> float:
    """As `_memory_kb`, with pages that several processes share divided among them; slower."""
    return sum_kb(f"/proc/{pid}/smaps_rollup", ("Pss_Anon:", "Pss_Shmem:", "SwapPss:")) or _memory_kb(pid)


def _limit(memory_mb: float) -> None:
    """Limits of the tracker's process, which its children inherit (Linux)."""
    if sys.platform != "linux":
        return
    import resource

    limits = {resource.RLIMIT_CORE: 0}
    if memory_mb > 0:
        limits[resource.RLIMIT_FSIZE] = int(memory_mb * 1024 * 1024)
        limits[resource.RLIMIT_DATA] = int((memory_mb * 1024 + data_segment_kb()) * 1024)
        # A write beyond the limit is an error of the tracker (EFBIG), not a signal.
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    for which, value in limits.items():
        hard = resource.getrlimit(which)[1]
        least = value if hard == resource.RLIM_INFINITY else min(value, hard)
        resource.setrlimit(which, (least, least))


def _prctl(option: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, int(value), 0, 0, 0)
