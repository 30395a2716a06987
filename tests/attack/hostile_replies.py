"""Attacks by what a tracker answers and says."""

from __future__ import annotations

import json
import os
import stat
import struct
import time
from typing import Any

import numpy as np

from tests.attack.hostile import FINE, attack

# Replies ----------------------------------------------------------------------------------------------------------


def _sockets() -> list[int]:
    return [fd for fd in range(3, 256) if _is_socket(fd)]


def _is_socket(fd: int) -> bool:
    try:
        return stat.S_ISSOCK(os.fstat(fd).st_mode)
    except OSError:
        return False


def _inject(content: bytes) -> None:
    for fd in _sockets():
        os.write(fd, content)


def _inject_and_wait(content: bytes) -> None:
    _inject(content)
    time.sleep(3600)


def _message(content: bytes) -> bytes:
    return struct.pack("!Q", len(content)) + content


@attack
def half_a_reply(image: np.ndarray) -> Any:
    _inject_and_wait(struct.pack("!Q", 1000) + b"0123456789")


@attack
def half_a_length(image: np.ndarray) -> Any:
    _inject_and_wait(b"\0\0\0")


@attack
def half_a_reply_of_multiprocessing(image: np.ndarray) -> Any:
    _inject_and_wait(struct.pack("!i", 1000) + b"0123456789")


@attack
def endless_reply(image: np.ndarray) -> Any:
    _inject(struct.pack("!Q", 2**63))
    while True:
        _inject(b"x" * 65536)


@attack
def reply_drip(image: np.ndarray) -> Any:
    """A byte a moment: every read succeeds, the message never ends."""
    _inject(struct.pack("!Q", 10_000_000))
    while True:
        _inject(b" ")
        time.sleep(0.05)


@attack
def deep_reply(image: np.ndarray) -> Any:
    _inject(_message(b"[" * 200_000))
    return FINE


@attack
def reply_that_is_no_json(image: np.ndarray) -> Any:
    _inject(_message(b"\xff\xfe nonsense"))
    return FINE


@attack
def reply_that_is_a_list(image: np.ndarray) -> Any:
    _inject(_message(b"[1, 2, 3]"))
    return FINE


def _reply(**changes: Any) -> bytes:
    fine = {"ms": 1.0, "box": [1, 2, 30, 40], "confidence": 1.0, "occluded": False, "particles": None}
    return _message(json.dumps({**fine, **changes}).encode())


@attack
def occluded_is_text(image: np.ndarray) -> Any:
    _inject(_reply(occluded="perhaps"))
    return FINE


@attack
def confidence_is_a_table(image: np.ndarray) -> Any:
    _inject(_reply(confidence={"a": 1}))
    return FINE


@attack
def time_is_nan(image: np.ndarray) -> Any:
    _inject(_reply(ms=float("nan")))
    return FINE


@attack
def time_is_negative(image: np.ndarray) -> Any:
    _inject(_reply(ms=-1e300))
    return FINE


@attack
def particles_are_ragged(image: np.ndarray) -> Any:
    _inject(_reply(particles=[[1, 2], [3], "x"]))
    return FINE


@attack
def box_is_of_texts(image: np.ndarray) -> Any:
    _inject(_reply(box=["1", "2", "30", "40"]))
    return FINE


@attack
def error_is_a_tree(image: np.ndarray) -> Any:
    _inject(_message(json.dumps({"error": {"a": ["\udcff"] * 10_000}}).encode()))
    return FINE


# Texts ------------------------------------------------------------------------------------------------------------


@attack
def surrogate_in_exception(image: np.ndarray) -> Any:
    raise ValueError("\udcff")


@attack
def endless_exception(image: np.ndarray) -> Any:
    raise ValueError("x" * 50_000_000)


@attack
def terminal_codes_in_exception(image: np.ndarray) -> Any:
    raise ValueError("\x1b[2J\x00\r\nline two\u202egnp")


@attack
def formula_in_exception(image: np.ndarray) -> Any:
    raise ValueError('=HYPERLINK("http://x")</script><script>alert(1)</script>\' OR 1=1 --')


class Unspeakable(Exception):
    def __str__(self) -> str:
        raise RuntimeError("no message")


@attack
def exception_without_text(image: np.ndarray) -> Any:
    raise Unspeakable


@attack
def base_exception(image: np.ndarray) -> Any:
    raise KeyboardInterrupt


@attack
def prints_without_end(image: np.ndarray) -> Any:
    while True:
        os.write(1, b"\xff\x00\x1b[31m" * 8192)


@attack
def prints_surrogates(image: np.ndarray) -> Any:
    os.write(1, b"\xed\xb3\xbf\xff\xfe\x00\x1b]0;title\x07" * 20)
    return FINE
