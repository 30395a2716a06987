"""Child process of an isolated tracker: make the tracker, then serve requests until the connection is closed.

Replies are JSON, never pickled, so that objects of third-party code cannot run code in the parent process.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import json
import os
import signal
import sys
import time
from multiprocessing.connection import Connection
from multiprocessing.shared_memory import SharedMemory
from typing import Any

import numpy as np

from pftrack_sim import trackers
from pftrack_sim.core.records import Tracker
from pftrack_sim.trackers.base import check_unmodified, checked_estimate

MAX_PARTICLES = 10_000
"""Number of particles sent, which are for drawing only."""


def serve(requests: Connection, output: Connection, memory_limit_mb: float) -> None:
    """Serve a tracker until the parent closes the connection. Target function of the process.

    Args:
        requests: Connection for requests and replies.
        output: Connection for everything printed.
        memory_limit_mb: Memory limit of the tracker; 0 is no limit.
    """
    _detach(output)
    tracker: Tracker | None = None
    shared: SharedMemory | None = None
    while True:
        try:
            request: dict[str, Any] = json.loads(requests.recv_bytes())
        except (EOFError, OSError):
            # The parent is gone: exit without waiting for threads or exit handlers of the tracker.
            os._exit(0)
        if shared is None or ("memory" in request and shared.name != request["memory"]):
            shared = SharedMemory(request["memory"]) if "memory" in request else None
        try:
            if tracker is None:
                _limit_memory(memory_limit_mb)
                seed, preset = request["seed"], request["preset"]
                tracker = trackers.make(request["name"], seed=seed, preset=preset, **request["params"])
                reply: dict[str, Any] = {"needs_truth": isinstance(tracker, trackers.NeedsTruth)}
            else:
                assert shared is not None
                reply = _call(tracker, request, shared)
        except BaseException as error:  # noqa: BLE001 - third-party code may call sys.exit
            text = f"{type(error).__name__}: {error}"[:500]
            limit = f" (memory limit {memory_limit_mb:g} MB)" if isinstance(error, MemoryError) else ""
            reply = {"error": text + limit}
        requests.send_bytes(json.dumps(reply).encode())


def _call(tracker: Tracker, request: dict[str, Any], shared: SharedMemory) -> dict[str, Any]:
    """Call `init` or `update` and return the reply, with the time taken [ms]."""
    original = np.ndarray(tuple(request["shape"]), dtype=np.uint8, buffer=shared.buf)
    image = original.copy()
    if request["truth"] is not None and isinstance(tracker, trackers.NeedsTruth):
        tracker.receive_truth(np.array(request["truth"]))
    start_s = time.perf_counter()
    if request["command"] == "init":
        tracker.init(image, np.array(request["box"]))
        ms = (time.perf_counter() - start_s) * 1e3
        check_unmodified(image, original)
        return {"ms": ms}
    output = tracker.update(image)
    ms = (time.perf_counter() - start_s) * 1e3
    estimate = checked_estimate(output, image, original)
    return {
        "ms": ms,
        "box": estimate.box.tolist(),
        "confidence": estimate.confidence,
        "occluded": estimate.occluded,
        "particles": None if estimate.particles is None else estimate.particles[:MAX_PARTICLES].tolist(),
    }


def _detach(output: Connection) -> None:
    """Disconnect from terminal, keyboard signals and core files; redirect standard output and error."""
    sys.stdin = open(os.devnull)  # noqa: SIM115 - open for the lifetime of the process
    for stream in (1, 2):
        os.dup2(output.fileno(), stream)
    output.close()
    faulthandler.enable()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "setsid"):
        with contextlib.suppress(OSError):
            os.setsid()
    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        # The kernel ends this process with its parent (PR_SET_PDEATHSIG), even one that holds the GIL.
        ctypes.CDLL(None, use_errno=True).prctl(1, int(signal.SIGKILL))


def _limit_memory(limit_mb: float) -> None:
    if limit_mb <= 0 or sys.platform != "linux":
        return
    import resource

    with open("/proc/self/status", encoding="ascii") as status:
        used_kb = next(int(line.split()[1]) for line in status if line.startswith("VmData:"))
    # Data segment, not address space: accelerator libraries reserve far more address space than they use.
    limit = used_kb * 1024 + int(limit_mb * 1024 * 1024)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
