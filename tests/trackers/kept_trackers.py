"""Third-party trackers that write down how often they are loaded, and show what an earlier episode left behind."""

from __future__ import annotations

import functools
import os
import random
import threading
from pathlib import Path
from typing import Any

import numpy as np

from pftrack_sim.core.records import Estimate


def note(log: str | None, what: str) -> None:
    if log is not None:
        with Path(log).open("a") as file:
            file.write(f"{what} {os.getpid()}\n")


HISTORY: list[float] = []
"""State of the module that nobody clears."""


class Leaky:
    """Answers with everything that it may remember, and with random numbers of every kind."""

    def __init__(self, seed: int = 0) -> None:
        self._rng = np.random.default_rng(seed)
        self._own: list[float] = []

    def init(self, image: np.ndarray, box: np.ndarray) -> None:
        self._box = np.array(box)

    def update(self, image: np.ndarray) -> Estimate:
        HISTORY.append(1.0)
        self._own.append(1.0)
        drawn = self._rng.random() + random.random() + np.random.random()  # noqa: NPY002
        return Estimate([len(HISTORY), len(self._own), 5 + drawn, 5 + image.mean()])


def reads_seed(*, seed: int, log: str | None = None, **_: Any) -> Leaky:
    model(log)
    note(log, "made")
    return Leaky(seed)


@functools.cache
def model(log: str | None) -> str:
    note(log, "loaded")
    return "weights"


class WithReset(Leaky):
    def reset(self, seed: int) -> None:
        Leaky.__init__(self, seed)
        HISTORY.clear()


def with_reset(*, seed: int, log: str | None = None, **_: Any) -> WithReset:
    note(log, "made")
    return WithReset(seed)


def with_thread(*, seed: int, log: str | None = None, **_: Any) -> Leaky:
    note(log, "made")
    threading.Thread(target=threading.Event().wait, daemon=True).start()
    return Leaky(seed)


class Raises(Leaky):
    def update(self, image: np.ndarray) -> Estimate:
        os.write(1, b"where am I?\n")
        return self.look(image)

    def look(self, image: np.ndarray) -> Estimate:
        raise ValueError("lost my way")


def raises(*, log: str | None = None, **_: Any) -> Raises:
    note(log, "made")
    return Raises()


class LeavesAChild(Leaky):
    """Its box holds the id of a child in a session of its own."""

    def init(self, image: np.ndarray, box: np.ndarray) -> None:
        read, write = os.pipe()
        if os.fork() == 0:
            os.setsid()
            if os.fork() == 0:
                os.write(write, os.readlink("/proc/self").encode())
                threading.Event().wait()
            os._exit(0)
        self._child = int(os.read(read, 100))

    def update(self, image: np.ndarray) -> Estimate:
        return Estimate([self._child, 0, 5, 5])


def leaves_a_child(**_: Any) -> LeavesAChild:
    return LeavesAChild()


class Prints(Leaky):
    def __init__(self, seed: int) -> None:
        self._seed = seed

    def init(self, image: np.ndarray, box: np.ndarray) -> None:
        print(f"my seed is {self._seed}")  # noqa: T201 - kept with the episode


def prints(*, seed: int, **_: Any) -> Prints:
    return Prints(seed)
