"""Process of an isolated tracker: make the tracker, then serve requests until the connection is closed.

Replies are JSON, never pickled, so that objects of third-party code cannot run code in the parent process. Images
arrive as bytes: no shared memory is left behind by a process that is killed.
"""

from __future__ import annotations

import json
import os
import socket
import time
from typing import Any

import numpy as np

from pftrack_sim import trackers
from pftrack_sim.core.records import Tracker
from pftrack_sim.core.text import describe_error
from pftrack_sim.trackers.base import check_unmodified, checked_estimate
from pftrack_sim.trackers.isolation.channel import receive, send

MAX_PARTICLES = 10_000
"""Number of particles sent, which are for drawing only."""

_MAX_REQUEST_BYTES = 1 << 30


def serve(requests: socket.socket, memory_limit_mb: float) -> None:
    """Serve a tracker until the parent closes the connection; does not return.

    Args:
        requests: For requests, images and replies.
        memory_limit_mb: Memory limit of the tracker, for messages.
    """
    tracker: Tracker | None = None
    while True:
        try:
            request: dict[str, Any] = json.loads(receive(requests, limit_bytes=_MAX_REQUEST_BYTES))
            pixels = receive(requests, limit_bytes=_MAX_REQUEST_BYTES) if "shape" in request else b""
        except (EOFError, OSError):
            # The parent is gone: exit without waiting for threads or exit handlers of the tracker.
            os._exit(0)
        try:
            if tracker is None:
                seed, preset = request["seed"], request["preset"]
                tracker = trackers.make(request["name"], seed=seed, preset=preset, **request["params"])
                reply: dict[str, Any] = {"needs_truth": isinstance(tracker, trackers.NeedsTruth)}
            else:
                reply = _call(tracker, request, pixels)
        except BaseException as error:  # noqa: BLE001 - third-party code may call sys.exit
            limit = f" (memory limit {memory_limit_mb:g} MB)" if isinstance(error, MemoryError) else ""
            reply = {"error": describe_error(error) + limit}
        try:
            send(requests, json.dumps(reply).encode())
        except OSError:
            os._exit(0)


def _call(tracker: Tracker, request: dict[str, Any], pixels: bytes | bytearray) -> dict[str, Any]:
    """Call `init` or `update` and return the reply, with the time taken [ms]."""
    original = np.frombuffer(pixels, dtype=np.uint8).reshape(request["shape"])
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
