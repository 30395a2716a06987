"""Descendants of a process and their memory, from Linux's `/proc`."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from pathlib import Path

MAX_PROCESSES = 4096
"""Descendants that are looked at; a tracker with as many is ended."""

END_S = 5.0
"""Time for ending processes."""


def children(pid: int) -> list[int]:
    """Children of a process."""
    found: list[int] = []
    with contextlib.suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            found += [int(word) for word in (task / "children").read_text(encoding="ascii").split()]
    return found


def descendants(pid: int) -> list[int]:
    """Children of a process, theirs, and so on."""
    found, rest = list[int](), [pid]
    while rest and len(found) < MAX_PROCESSES:
        found += (below := children(rest.pop()))
        rest += below
    return found


def end_descendants(also: tuple[int, ...] = (), *, contained: bool = False) -> None:
    """Kill and reap every descendant of this process, which must be a subreaper so that none escapes it.

    Args:
        also: Ids of children, which are killed even where `/proc` does not list them.
        contained: Whether this process is in a PID namespace in which all others are its descendants, but the first,
            which cannot be killed from inside; `/proc` may be that of another namespace.
    """
    end_s = time.monotonic() + END_S
    while time.monotonic() < end_s:
        for pid in (-1,) if contained else also:
            _kill(pid)
        if not contained:
            found = descendants(os.getpid())
            # A group ends at once, with what it is forking.
            for pid in [*(-group for group in _groups(found)), *found]:
                _kill(pid)
        if _reaped_all():
            return
        time.sleep(0.002)


def _kill(pid: int) -> None:
    with contextlib.suppress(OSError):
        os.kill(pid, signal.SIGKILL)


def _groups(processes: list[int]) -> set[int]:
    """Process groups, without the one of this process."""
    found: set[int] = set()
    for pid in processes:
        with contextlib.suppress(OSError):
            found.add(os.getpgid(pid))
    return found - {os.getpgrp()}


def _reaped_all() -> bool:
    """Reap the children that have ended; whether there are no others."""
    try:
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    except ChildProcessError:
        return True
    return False


def memory_kb(pid: int) -> float:
    """Anonymous and shared memory in use, without mapped files."""
    return sum_kb(f"/proc/{pid}/status", ("RssAnon:", "RssShmem:", "VmSwap:"))


def proportional_kb(pid: int) -> float:
    """As `memory_kb`, with pages that several processes share divided among them; slower."""
    return sum_kb(f"/proc/{pid}/smaps_rollup", ("Pss_Anon:", "Pss_Shmem:", "SwapPss:")) or memory_kb(pid)


def sum_kb(path: str, names: tuple[str, ...]) -> float:
    """Sum of some lines of a file in `/proc`; 0 where it cannot be read."""
    try:
        lines = Path(path).read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return 0.0
    return sum(float(line.split()[1]) for line in lines if line.startswith(names))
