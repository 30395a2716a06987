"""Our trackers for programs that speak TraX, such as the VOT toolkit, through the reference implementation `vot-trax`.

Its client is not used for the other direction: it ends its own process by a segmentation fault where a greeting names
no region format, as versions 1 and 4 of the protocol allow, and takes a program that has died for a lost target.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

from pftrack_sim.core.errors import PftrackError, TrackerError
from pftrack_sim.core.image_files import MAX_FILE_BYTES, decode
from pftrack_sim.core.inputs import read_bytes
from pftrack_sim.core.records import Estimate, Image, Tracker
from pftrack_sim.core.text import one_line
from pftrack_sim.trackers.base import NeedsTruth

_END_S = 10.0
"""Time to end in after the client."""


def serve(tracker: Tracker, name: str) -> None:
    """Answer the client over standard input and output, or the socket whose port is in `TRAX_SOCKET`, until it quits.

    The state has the property `confidence`. A problem is sent as the reason of a message `quit`. What the tracker
    prints goes to standard error. Where nothing listens at the port, the library goes on trying.

    Args:
        tracker: The tracker.
        name: Sent in the greeting.

    Raises:
        PftrackError: `vot-trax` is not installed, nothing listens at the port, a request that is none, an image that
            cannot be read, or an error of the tracker.
    """
    if isinstance(tracker, NeedsTruth):
        raise TrackerError(f"{name} needs the ground truth, which TraX does not send")
    try:
        import trax
    except ImportError:
        raise TrackerError("serving a tracker needs the extra: pip install 'pftrack-sim[trax]'") from None
    _check_port(os.environ.get("TRAX_SOCKET"))
    server: Any = trax.Server(
        ["rectangle"], ["path", "memory", "buffer"], tracker_name=name, tracker_family="pftrack-sim"
    )
    if "TRAX_SOCKET" not in os.environ and hasattr(select, "poll"):
        threading.Thread(target=_end_without_client, daemon=True).start()
    try:
        with contextlib.redirect_stdout(sys.stderr):
            while (request := server.wait()).type != "quit":
                estimate = _answer(tracker, request)
                state = trax.Rectangle.create(*estimate.box)
                server.status([(state, {"confidence": f"{estimate.confidence:.6f}"})])
    except trax.TraxException as error:
        raise TrackerError(one_line(str(error))) from None
    except PftrackError as error:
        server.quit(one_line(str(error)))
        raise


def _end_without_client() -> None:
    """End this process soon after its client: vot-trax blocks forever on an incomplete message."""
    client = select.poll()
    client.register(0, 0)  # wakes when standard input is closed and read
    client.poll()
    time.sleep(_END_S)
    print("pftrack-sim: the client has gone", file=sys.stderr, flush=True)  # noqa: T201 - of the command line
    os._exit(2)


def _check_port(port: str | None) -> None:
    """Raise `TrackerError` where nobody listens at a port: the library would go on trying without an end."""
    if port is None:
        return
    if not port.isdecimal() or not 0 < int(port) < 65536:
        raise TrackerError(f"TRAX_SOCKET must be a port from 1 to 65535, got {port!r}")
    # Not by a connection, which a client that waits for one would take for the tracker's: a free port can be bound.
    with socket.socket() as probe, contextlib.suppress(OSError):
        probe.bind(("127.0.0.1", int(port)))
        raise TrackerError(f"nothing listens at port {port}, which TRAX_SOCKET names: start the client first")


def _answer(tracker: Tracker, request: Any) -> Estimate:
    image = _pixels(request.image["color"])
    if request.type == "frame":
        return tracker.update(image)
    box = np.array(request.objects[0][0].bounds())
    tracker.init(image, box)
    return Estimate(box)


def _pixels(sent: Any) -> Image:
    """`(H, W, 3)` uint8 RGB of an image of the library."""
    if sent.type() == "memory":
        pixels = sent.array()
        return np.repeat(pixels, 3 // pixels.shape[2], axis=2)
    try:
        return decode(sent.buffer() if sent.type() == "buffer" else read_bytes(Path(sent.path()), MAX_FILE_BYTES))
    except OSError as error:
        raise TrackerError(f"the image {sent.path()!r} cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise TrackerError(f"the image {error}") from None
