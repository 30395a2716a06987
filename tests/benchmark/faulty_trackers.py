"""Strangers' trackers that go wrong, each in its own way, at their second update (frame 2)."""

from __future__ import annotations

import ctypes
import os
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from pftrack_sim.core.records import Estimate

BAD_FRAME = 2


class Stranger:
    """Says the first box until its bad moment comes.

    Args:
        misdeed: What it does then; what that returns is its answer.
    """

    def __init__(self, misdeed: Callable[[np.ndarray], Any]) -> None:
        self._misdeed = misdeed

    def init(self, image: np.ndarray, box: np.ndarray) -> None:
        self._seen, self._box = 0, np.array(box)

    def update(self, image: np.ndarray) -> Any:
        self._seen += 1
        if self._seen >= BAD_FRAME:
            return self._misdeed(image)
        return Estimate(self._box)


def good(**_: Any) -> Stranger:
    return Stranger(lambda image: Estimate([1, 2, 30, 40]))


def raises(**_: Any) -> Stranger:
    def misdeed(image: np.ndarray) -> Any:
        raise ValueError("lost my way")

    return Stranger(misdeed)


def says_nan(**_: Any) -> Stranger:
    return Stranger(lambda image: Estimate([np.nan, 0, 5, 5]))


def wrong_shape(**_: Any) -> Stranger:
    return Stranger(lambda image: np.zeros(3))


def says_nothing(**_: Any) -> Stranger:
    return Stranger(lambda image: None)


def endless(**_: Any) -> Stranger:
    def misdeed(image: np.ndarray) -> Any:
        while True:
            pass

    return Stranger(misdeed)


def segfault(**_: Any) -> Stranger:
    return Stranger(lambda image: ctypes.string_at(0))


def sys_exit(**_: Any) -> Stranger:
    return Stranger(lambda image: sys.exit(0))


def os_exit(**_: Any) -> Stranger:
    return Stranger(lambda image: os._exit(3))


def greedy(**_: Any) -> Stranger:
    def misdeed(image: np.ndarray) -> Any:
        hoard = [np.empty(10_000_000) for _ in range(100)]
        return Estimate([float(len(hoard)), 0, 5, 5])

    return Stranger(misdeed)


def scribbles(**_: Any) -> Stranger:
    def misdeed(image: np.ndarray) -> Any:
        image[:] = 0
        return Estimate([1, 2, 30, 40])

    return Stranger(misdeed)


def prints(**_: Any) -> Stranger:
    def misdeed(image: np.ndarray) -> Any:
        os.write(1, b"rubbish " * 20_000)
        os.write(2, b"more rubbish\n")
        return Estimate([1, 2, 30, 40])

    return Stranger(misdeed)


def cannot_be_made_later(*, seed: int, **_: Any) -> Stranger:
    if seed == 4:
        raise OSError("no weights")
    return good()


def slow(**_: Any) -> Stranger:
    def misdeed(image: np.ndarray) -> Any:
        time.sleep(0.02)
        return Estimate([1, 2, 30, 40])

    return Stranger(misdeed)


def dies_while_imported(**_: Any) -> Stranger:
    os._exit(5)
