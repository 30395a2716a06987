"""Our trackers for programs that speak TraX, such as the VOT toolkit."""

from __future__ import annotations

import os
import socket
from typing import IO

from pftrack_sim.core.errors import PftrackError, TrackerError
from pftrack_sim.core.records import Estimate, Tracker
from pftrack_sim.core.text import one_line
from pftrack_sim.trackers.base import NeedsTruth
from pftrack_sim.trackers.trax.protocol import VERSION, Message, decode_box, decode_image, encode_box, parse


def serve(tracker: Tracker, name: str, requests: IO[bytes], replies: IO[bytes]) -> None:
    """Answer requests until the other side quits or closes the connection.

    The state has the property `confidence`. A problem is sent as the reason of a message `quit`.

    Args:
        tracker: The tracker.
        name: Sent in the greeting.
        requests: Read line by line.
        replies: Written line by line.

    Raises:
        PftrackError: A request that is none, an image that cannot be read, or an error of the tracker.
    """
    if isinstance(tracker, NeedsTruth):
        raise TrackerError(f"{name} needs the ground truth, which TraX does not send")
    hello = {
        "trax.version": str(VERSION),
        "trax.name": name,
        "trax.family": "pftrack-sim",
        "trax.image": "path;memory;buffer;",
        "trax.region": "rectangle;polygon;mask;",
        "trax.channels": "color;",
    }

    def reply(message: Message) -> None:
        replies.write(message.encode())
        replies.flush()

    reply(Message("hello", (), hello))
    try:
        for line in requests:
            request = parse(line)
            if request is None:
                continue
            if request.kind == "quit":
                return
            estimate = _answer(tracker, request)
            state = encode_box(estimate.box, ("rectangle",))
            reply(Message("state", (state,), {"confidence": f"{estimate.confidence:.6f}"}))
    except PftrackError as error:
        reply(Message("quit", (), {"trax.reason": one_line(str(error))}))
        raise


def _answer(tracker: Tracker, request: Message) -> Estimate:
    if request.kind == "initialize" and len(request.arguments) == 2:
        box = decode_box(request.arguments[1])
        if box is None:
            raise TrackerError("the region to start on is empty")
        tracker.init(decode_image(request.arguments[0]), box)
        return Estimate(box)
    if request.kind == "frame" and len(request.arguments) == 1:
        return tracker.update(decode_image(request.arguments[0]))
    given = f"{request.kind} with {len(request.arguments)} arguments"
    raise TrackerError(f"a TraX request must be initialize with image and region, or frame with an image; got {given}")


def connection() -> tuple[IO[bytes], IO[bytes]]:
    """The streams of this process: standard input and output, or the socket whose port is in `TRAX_SOCKET`.

    What the tracker prints goes to standard error from here on.

    Raises:
        TrackerError: Nothing listens at that port.
    """
    port = os.environ.get("TRAX_SOCKET")
    if port is not None:
        try:
            opened = socket.create_connection(("localhost", int(port)))
        except (OSError, ValueError, OverflowError) as error:
            raise TrackerError(f"no TraX client at the port TRAX_SOCKET={port}: {error}") from None
        return opened.makefile("rb"), opened.makefile("wb")
    requests, replies = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return requests, replies
