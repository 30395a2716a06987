"""Memory of processes, as Linux tells it; elsewhere nothing is known and nothing limited."""

from __future__ import annotations

import contextlib
import ctypes
import sys
from collections.abc import Generator
from pathlib import Path


def sum_kb(path: str, names: tuple[str, ...]) -> float:
    """Sum of some lines of a file in `/proc` [kB]; 0 where it cannot be read."""
    try:
        lines = Path(path).read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return 0.0
    return sum(float(line.split()[1]) for line in lines if line.startswith(names))


def data_segment_kb() -> float:
    """Data of this process, of which accelerator libraries use far less than they reserve of its address space."""
    return sum_kb("/proc/self/status", ("VmData:",))


def return_freed_memory() -> None:
    """Return to the system what this process has freed; glibc's allocator keeps some hundred MB of it otherwise."""
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)


@contextlib.contextmanager
def memory_limit(more_mb: float) -> Generator[None]:
    """Let this process take only so much more memory in the block: what needs more fails with MemoryError there."""
    if sys.platform != "linux":
        yield
        return
    import resource

    before = resource.getrlimit(resource.RLIMIT_DATA)
    most = int((data_segment_kb() + 1024 * more_mb) * 1024)
    wanted = most if before[0] == resource.RLIM_INFINITY else min(most, before[0])
    resource.setrlimit(resource.RLIMIT_DATA, (wanted, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, before)
