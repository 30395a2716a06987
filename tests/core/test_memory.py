"""Freed memory is returned to the system."""

import ctypes
import os
from pathlib import Path

import pytest

from pftrack_sim.core.memory import return_freed_memory


def resident_mb() -> float:
    return float(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.skipif(
    not hasattr(ctypes.CDLL(None), "malloc_trim") or not Path("/proc/self/statm").exists(),
    reason="an allocator other than glibc's",
)
def test_what_lies_below_memory_in_use_is_returned():
    blocks = [bytearray(100_000) for _ in range(2000)]
    last = blocks.pop()
    blocks.clear()
    kept = resident_mb()
    return_freed_memory()
    assert kept - resident_mb() > 150.0
    assert len(last) == 100_000
