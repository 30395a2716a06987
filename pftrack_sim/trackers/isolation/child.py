"""The inside of a tracker's process: make it, then answer frame by frame until the other side hangs up.

Answers go out as JSON, never pickled: a stranger's object must not be able to run code on the other side.
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
from pftrack_sim.core.records import Estimate, Tracker
from pftrack_sim.trackers.base import check_unmodified, checked_estimate

MAX_PARTICLES = 10_000
"""More are not sent: they are for drawing only."""


def serve(orders: Connection, noise: Connection, memory_limit_mb: float) -> None:
    """Run a tracker until told to stop. The target of the process.

    Args:
        orders: Where questions come from and answers go.
        noise: Where everything goes that is printed.
        memory_limit_mb: Memory that the tracker may take; 0 is no limit.
    """
    _detach(noise)
    tracker: Tracker | None = None
    shared: SharedMemory | None = None
    while True:
        try:
            order: dict[str, Any] = json.loads(orders.recv_bytes())
        except (EOFError, OSError):
            # Nobody is left to talk to; a tracker's threads or exit handlers must not keep the process alive.
            os._exit(0)
        if shared is None or ("memory" in order and shared.name != order["memory"]):
            shared = SharedMemory(order["memory"]) if "memory" in order else None
        try:
            if tracker is None:
                _limit_memory(memory_limit_mb)
                tracker = trackers.make(order["name"], seed=order["seed"], preset=order["preset"], **order["params"])
                reply: dict[str, Any] = {"needs_truth": isinstance(tracker, trackers.NeedsTruth)}
            else:
                assert shared is not None
                reply = _answer(tracker, order, shared)
        except BaseException as error:  # noqa: BLE001 - sys.exit and the like are a stranger's mistakes too
            reply = {"error": _told(error, memory_limit_mb), "kind": type(error).__name__}
        orders.send_bytes(json.dumps(reply).encode())


def _answer(tracker: Tracker, order: dict[str, Any], shared: SharedMemory) -> dict[str, Any]:
    shape = tuple(order["shape"])
    original = np.ndarray(shape, dtype=np.uint8, buffer=shared.buf)
    given = original.copy()
    if order["truth"] is not None and isinstance(tracker, trackers.NeedsTruth):
        tracker.receive_truth(np.array(order["truth"]))
    began = time.perf_counter()
    if order["do"] == "init":
        tracker.init(given, np.array(order["box"]))
        ms = (time.perf_counter() - began) * 1e3
        check_unmodified(given, original)
        return {"ms": ms}
    said = tracker.update(given)
    ms = (time.perf_counter() - began) * 1e3
    return {"ms": ms, **_as_json(checked_estimate(said, given, original))}


def _as_json(said: Estimate) -> dict[str, Any]:
    particles = None if said.particles is None else said.particles[:MAX_PARTICLES].tolist()
    return {
        "box": said.box.tolist(),
        "confidence": said.confidence,
        "occluded": said.occluded,
        "particles": particles,
    }


def _told(error: BaseException, memory_limit_mb: float) -> str:
    text = f"{type(error).__name__}: {error}"[:500]
    return f"{text} (memory limit {memory_limit_mb:g} MB)" if isinstance(error, MemoryError) else text


def _detach(noise: Connection) -> None:
    """No terminal, no signals from it, no core files; what is printed goes to whoever listens."""
    sys.stdin = open(os.devnull)  # noqa: SIM115 - for as long as the process lives
    for stream in (1, 2):
        os.dup2(noise.fileno(), stream)
    noise.close()
    faulthandler.enable()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "setsid"):
        with contextlib.suppress(OSError):
            os.setsid()
    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        # A tracker that holds the interpreter's lock for ever notices nothing: the kernel ends it with its parent.
        ctypes.CDLL(None, use_errno=True).prctl(1, int(signal.SIGKILL))


def _limit_memory(limit_mb: float) -> None:
    if limit_mb <= 0 or sys.platform != "linux":
        return
    import resource

    with open("/proc/self/status", encoding="ascii") as status:
        used_kb = next(int(line.split()[1]) for line in status if line.startswith("VmData:"))
    # Not the address space: accelerator libraries reserve far more of that than they use.
    limit = used_kb * 1024 + int(limit_mb * 1024 * 1024)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
