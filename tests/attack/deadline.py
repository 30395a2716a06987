"""A deadline for code under attack: a hang becomes a failure of the test."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Generator


class Hang(BaseException):
    """The code under attack did not come back."""


@contextlib.contextmanager
def deadline(limit_s: float = 60.0) -> Generator[None]:
    """Raise `Hang` in the block when it takes longer; it is generous, because it finds hangs and judges no speed."""

    def ring(number: int, frame: object) -> None:
        raise Hang(f"no end within {limit_s:g} s")

    previous = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, limit_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)
