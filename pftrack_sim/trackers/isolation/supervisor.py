"""Supervisor of a tracker's process: it ends with everything it started, and its memory is watched.

    parent --- supervisor --- init --- tracker --- whatever the tracker starts

On Linux the init is the first process of a PID namespace (with a user namespace, which needs no privileges): processes
inside cannot signal anything outside, and the kernel ends all of them with the init. Where namespaces are not allowed
the init and the supervisor are subreapers: what the tracker leaves behind becomes their child and is killed. Elsewhere
the tracker runs in this process, without an init.
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
import struct
import sys
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NoReturn

from pftrack_sim.trackers.isolation.channel import send
from pftrack_sim.trackers.isolation.child import serve

_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
_CLONE_NEWUSER, _CLONE_NEWPID = 0x10000000, 0x20000000
_WATCH_PERIOD_S = 0.1
_KILL_S = 5.0
_MAX_PROCESSES = 4096
_STATUS = struct.Struct("!i")


def supervise(
    requests: socket.socket, life: socket.socket, output: Connection, memory_limit_mb: float, namespaces: bool
) -> None:
    """Run a tracker until it ends or the parent closes `life`. Target function of the process.

    Args:
        requests: For requests, images and replies of the tracker.
        life: Its end ends everything; the supervisor sends one message over it: how the tracker ended.
        output: Connection for everything printed.
        memory_limit_mb: Memory limit of the tracker and its children together; 0 is no limit.
        namespaces: Whether to use namespaces where the system allows it.
    """
    _detach(output)
    if sys.platform != "linux":
        serve(requests, memory_limit_mb)
        return
    import resource

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _keep_descriptors(0, 1, 2, requests.fileno(), life.fileno())
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    contained = namespaces and _enter_namespaces()
    status, status_of_init = os.pipe()
    init = os.fork()
    if init == 0:
        life.close()
        os.close(status)
        _run_init(requests, status_of_init, memory_limit_mb, contained)
    os.close(status_of_init)
    requests.close()
    how = _watch(life, status, init, memory_limit_mb)
    _end(init)
    with contextlib.suppress(OSError):
        send(life, json.dumps(how).encode(), limit_s=_KILL_S)
    os._exit(0)


def _run_init(requests: socket.socket, status: int, memory_limit_mb: float, contained: bool) -> NoReturn:
    """Fork the tracker's process, wait for it and for orphans, and pass on how it ended."""
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    tracker = os.fork()
    if tracker == 0:
        os.close(status)
        _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        _limit(memory_limit_mb, contained)
        serve(requests, memory_limit_mb)
        os._exit(0)
    requests.close()
    while True:
        ended, how = os.waitpid(-1, 0)
        if ended == tracker:
            os.write(status, _STATUS.pack(os.waitstatus_to_exitcode(how)))
            os._exit(0)


def _watch(life: socket.socket, status: int, init: int, memory_limit_mb: float) -> dict[str, float]:
    """Wait until the tracker ends, needs too much memory, or is no longer wanted; returns how it ended."""
    own_kb = _memory_kb(os.getpid())
    while True:
        ready, _, _ = select.select([life, status], [], [], _WATCH_PERIOD_S if memory_limit_mb > 0 else None)
        if status in ready:
            content = os.read(status, _STATUS.size)
            return {"exit": _STATUS.unpack(content)[0]} if len(content) == _STATUS.size else {}
        if life in ready:
            return {}
        if memory_limit_mb > 0 and _uses_more(init, memory_limit_mb * 1024, own_kb):
            return {"memory_mb": memory_limit_mb}


def _end(init: int) -> None:
    """Kill the init and every descendant; in a namespace the kernel does."""
    end_s = time.monotonic() + _KILL_S
    while time.monotonic() < end_s:
        children = _children(os.getpid())
        for pid in {init, *children, *(below for child in children for below in _descendants(child))}:
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        try:
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        except ChildProcessError:
            return
        time.sleep(0.002)


def _uses_more(init: int, limit_kb: float, own_kb: float) -> bool:
    """Whether the descendants use more memory than allowed, besides what each was forked with."""
    processes = _descendants(init)
    if sum(max(_memory_kb(pid) - own_kb, 0.0) for pid in processes) <= limit_kb:
        return False
    # Pages that forks share were counted once for each: the exact figure is slower.
    return sum(max(_proportional_kb(pid), 0.0) for pid in processes) > limit_kb


def _memory_kb(pid: int) -> float:
    """Anonymous and shared memory in use, without mapped files."""
    return _sum_kb(f"/proc/{pid}/status", ("RssAnon:", "RssShmem:", "VmSwap:"))


def _proportional_kb(pid: int) -> float:
    path = f"/proc/{pid}/smaps_rollup"
    return _sum_kb(path, ("Pss_Anon:", "Pss_Shmem:", "SwapPss:")) or _memory_kb(pid)


def _sum_kb(path: str, names: tuple[str, ...]) -> float:
    try:
        lines = Path(path).read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return 0.0
    return sum(float(line.split()[1]) for line in lines if line.startswith(names))


def _children(pid: int) -> list[int]:
    found: list[int] = []
    with contextlib.suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            found += [int(word) for word in (task / "children").read_text(encoding="ascii").split()]
    return found


def _descendants(pid: int) -> list[int]:
    found, rest = list[int](), [pid]
    while rest and len(found) < _MAX_PROCESSES:
        found += (children := _children(rest.pop()))
        rest += children
    return found


def _enter_namespaces() -> bool:
    """Put the processes forked from here on into PID and user namespaces of their own, if the system allows it."""
    user, group = os.getuid(), os.getgid()
    if _libc().unshare(_CLONE_NEWUSER | _CLONE_NEWPID):
        return False
    with contextlib.suppress(OSError):  # without the maps the processes run as nobody: files stay those of the user
        Path("/proc/self/setgroups").write_text("deny", encoding="ascii")
        Path("/proc/self/uid_map").write_text(f"{user} {user} 1", encoding="ascii")
        Path("/proc/self/gid_map").write_text(f"{group} {group} 1", encoding="ascii")
    return True


def _limit(memory_mb: float, contained: bool) -> None:
    """Limits of the tracker's process."""
    import resource

    if contained:  # elsewhere the user's other processes would count
        _set_limit(resource.RLIMIT_NPROC, _MAX_PROCESSES)
    if memory_mb <= 0:
        return
    limit = int(memory_mb * 1024 * 1024)
    _set_limit(resource.RLIMIT_FSIZE, limit)
    # A write beyond the limit is an error of the tracker (EFBIG), not a signal.
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    # Data segment, not address space: accelerator libraries reserve far more address space than they use.
    _set_limit(resource.RLIMIT_DATA, int(_sum_kb("/proc/self/status", ("VmData:",)) * 1024) + limit)


def _set_limit(which: int, value: int) -> None:
    import resource

    hard = resource.getrlimit(which)[1]
    wanted = value if hard == resource.RLIM_INFINITY else min(value, hard)
    resource.setrlimit(which, (wanted, wanted))


def _detach(output: Connection) -> None:
    """Disconnect from terminal and keyboard signals; redirect standard output and error."""
    sys.stdin = open(os.devnull)  # noqa: SIM115 - open for the lifetime of the process
    os.dup2(sys.stdin.fileno(), 0)
    for stream in (1, 2):
        os.dup2(output.fileno(), stream)
    output.close()
    faulthandler.enable()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "setsid"):
        with contextlib.suppress(OSError):
            os.setsid()


def _keep_descriptors(*kept: int) -> None:
    """Close all other descriptors: a tracker's child would hold the pipes of the parent's helpers open."""
    for name in os.listdir("/proc/self/fd"):
        if int(name) not in kept:
            with contextlib.suppress(OSError):
                os.close(int(name))


def _prctl(option: int, value: int) -> None:
    _libc().prctl(option, int(value), 0, 0, 0)


def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)
