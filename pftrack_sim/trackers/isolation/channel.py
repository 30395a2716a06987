"""Messages between a tracker's process and its parent: length and bytes over a socket, with a deadline and a bound."""

from __future__ import annotations

import math
import socket
import struct
import time
from typing import TypeAlias

_LENGTH = struct.Struct("!Q")

Bytes: TypeAlias = bytes | bytearray | memoryview


class ChannelError(Exception):
    """The other side broke the protocol."""


def send(connection: socket.socket, message: Bytes, *, limit_s: float | None = None) -> None:
    """Send a message.

    Args:
        connection: A stream socket.
        message: Bytes in one piece of memory.
        limit_s: Time for the whole message; None: no limit.

    Raises:
        TimeoutError: The other side does not read.
        OSError: The connection is closed.
    """
    view = memoryview(message).cast("B")
    connection.settimeout(limit_s)
    connection.sendall(_LENGTH.pack(view.nbytes))
    connection.sendall(view)


def receive(connection: socket.socket, *, limit_bytes: int, limit_s: float | None = None) -> bytearray:
    """Receive a message.

    Args:
        connection: A stream socket.
        limit_bytes: Longest message that is read.
        limit_s: Time for the whole message; None: no limit.

    Raises:
        TimeoutError: It did not arrive whole in time.
        EOFError: The connection was closed.
        OSError: The connection broke.
        ChannelError: The message is longer than allowed.
    """
    end_s = math.inf if limit_s is None else time.monotonic() + limit_s
    (length,) = _LENGTH.unpack(_exactly(connection, _LENGTH.size, end_s))
    if length > limit_bytes:
        raise ChannelError(f"a message of {length} bytes; at most {limit_bytes} are read")
    return _exactly(connection, length, end_s)


def _exactly(connection: socket.socket, count: int, end_s: float) -> bytearray:
    content = bytearray(count)
    view, done = memoryview(content), 0
    while done < count:
        left_s = end_s - time.monotonic()
        if left_s <= 0.0:
            raise TimeoutError
        connection.settimeout(None if math.isinf(left_s) else left_s)
        read = connection.recv_into(view[done:])
        if read == 0:
            raise EOFError
        done += read
    return content
