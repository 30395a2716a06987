"""Supervisor of a tracker's process: it ends with everything it started, and its memory is watched.

    parent --- supervisor --- init --- tracker, loaded --- tracker, in an episode --- whatever it starts

On Linux the init is the first process of a PID namespace (with a user namespace, which needs no privileges): processes
inside cannot signal anything outside, and the kernel ends all of them with the init. Where namespaces are not allowed
the init and the supervisor are subreapers: what the tracker leaves behind becomes their child and is killed. With
`--isolation container` the init is the first process of a sandbox. On other systems the tracker runs in this process,
without an init.
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
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from pftrack_sim.trackers.isolation.channel import send
from pftrack_sim.trackers.isolation.child import serve
from pftrack_sim.trackers.isolation.process_tree import (
    END_S,
    MAX_PROCESSES,
    descendants,
    end_descendants,
    memory_kb,
    proportional_kb,
    sum_kb,
)

_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
_CLONE_NEWUSER, _CLONE_NEWPID = 0x10000000, 0x20000000
_WATCH_PERIOD_S = 0.1
_STATUS = struct.Struct("!i")


def supervise(
    requests: socket.socket,
    life: socket.socket,
    output: int,
    memory_limit_mb: float,
    namespaces: bool,
    sandbox: Sequence[str],
) -> None:
    """Run a tracker until it ends or the parent closes `life`. Target function of the process.

    Args:
        requests: For requests, images and replies of the tracker.
        life: Its end ends everything; the supervisor sends one message over it: how the tracker ended.
        output: Descriptor for everything printed.
        memory_limit_mb: Memory limit of the tracker and its children together; 0 is no limit.
        namespaces: Whether to use namespaces where the system allows it.
        sandbox: Command line that runs Python in a sandbox; empty without one.
    """
    _detach(output)
    if sys.platform != "linux":
        serve(requests, memory_limit_mb, contained=False)
    import resource

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _keep_descriptors(0, 1, 2, requests.fileno(), life.fileno())
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    contained = not sandbox and namespaces and _enter_namespaces()
    status, status_of_init = os.pipe()
    init = os.fork()
    if init == 0:
        life.close()
        os.close(status)
        if sandbox:
            _enter_sandbox(sandbox, requests, status_of_init, memory_limit_mb)
        _run_init(requests, status_of_init, memory_limit_mb, contained)
    os.close(status_of_init)
    requests.close()
    how = _watch(life, status, init, memory_limit_mb)
    end_descendants((init,))
    with contextlib.suppress(OSError):
        send(life, json.dumps(how).encode(), limit_s=END_S)
    os._exit(0)


def _enter_sandbox(command: Sequence[str], requests: socket.socket, status: int, memory_limit_mb: float) -> NoReturn:
    """Become the sandbox, whose first process is the init."""
    for descriptor in (requests.fileno(), status):
        os.set_inheritable(descriptor, True)
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    os.execvp(command[0], [*command, str(requests.fileno()), str(status), str(memory_limit_mb)])


def run_in_sandbox(requests: str, status: str, memory_limit_mb: str) -> NoReturn:
    """Init of a sandbox, given descriptors and the memory limit as words of its command line."""
    _print_whole_lines()
    _run_init(socket.socket(fileno=int(requests)), int(status), float(memory_limit_mb), contained=True)


def _run_init(requests: socket.socket, status: int, memory_limit_mb: float, contained: bool) -> NoReturn:
    """Fork the tracker's process, wait for it and for orphans, and pass on how it ended."""
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    tracker = os.fork()
    if tracker == 0:
        os.close(status)
        # Where the system shares processor time among sessions, many processes do not slow their supervisor down.
        os.setsid()
        _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        # What an episode leaves behind becomes a child of the process that is kept, which kills it.
        _prctl(_PR_SET_CHILD_SUBREAPER, 1)
        _limit(memory_limit_mb, contained)
        serve(requests, memory_limit_mb, contained)
    requests.close()
    while True:
        ended, how = os.waitpid(-1, 0)
        if ended == tracker:
            os.write(status, _STATUS.pack(os.waitstatus_to_exitcode(how)))
            os._exit(0)


def _watch(life: socket.socket, status: int, init: int, memory_limit_mb: float) -> dict[str, float]:
    """Wait until the tracker ends, exceeds a limit, or is no longer wanted; returns how it ended."""
    own_kb = memory_kb(os.getpid())
    while True:
        ready, _, _ = select.select([life, status], [], [], _WATCH_PERIOD_S)
        if status in ready:
            content = os.read(status, _STATUS.size)
            return {"exit": _STATUS.unpack(content)[0]} if len(content) == _STATUS.size else {}
        if life in ready:
            return {}
        processes = descendants(init)
        if len(processes) >= MAX_PROCESSES:
            return {"processes": MAX_PROCESSES}
        if memory_limit_mb > 0 and _use_more(processes, memory_limit_mb * 1024, own_kb):
            return {"memory_mb": memory_limit_mb}


def _use_more(processes: Sequence[int], limit_kb: float, own_kb: float) -> bool:
    """Whether processes use more memory than allowed, besides what each was forked with."""
    if sum(max(memory_kb(pid) - own_kb, 0.0) for pid in processes) <= limit_kb:
        return False
    # Pages that forks share were counted once for each: the exact figure is slower.
    return sum(max(proportional_kb(pid), 0.0) for pid in processes) > limit_kb


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

    if contained:  # elsewhere the user's other processes would count; it does not hold for root
        _set_limit(resource.RLIMIT_NPROC, MAX_PROCESSES)
    if memory_mb <= 0:
        return
    limit = int(memory_mb * 1024 * 1024)
    _set_limit(resource.RLIMIT_FSIZE, limit)
    # A write beyond the limit is an error of the tracker (EFBIG), not a signal.
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    # Data segment, not address space: accelerator libraries reserve far more address space than they use.
    _set_limit(resource.RLIMIT_DATA, int(sum_kb("/proc/self/status", ("VmData:",)) * 1024) + limit)


def _set_limit(which: int, value: int) -> None:
    import resource

    hard = resource.getrlimit(which)[1]
    wanted = value if hard == resource.RLIM_INFINITY else min(value, hard)
    resource.setrlimit(which, (wanted, wanted))


def _detach(output: int) -> None:
    """Disconnect from terminal and keyboard signals; redirect standard output and error."""
    sys.stdin = open(os.devnull)  # noqa: SIM115 - open for the lifetime of the process
    os.dup2(sys.stdin.fileno(), 0)
    for stream in (1, 2):
        os.dup2(output, stream)
    os.close(output)
    _print_whole_lines()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "setsid"):
        with contextlib.suppress(OSError):
            os.setsid()


def _print_whole_lines() -> None:
    """Write printed lines at once: a process that is killed loses what is in its buffers."""
    sys.stdout, sys.stderr = (
        open(one, "w", buffering=1, encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
        for one in (1, 2)
    )
    faulthandler.enable()


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
