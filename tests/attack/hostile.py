"""A third-party tracker that attacks the run in one way, from its second update (frame 2) on."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from pftrack_sim.core.records import Estimate

ATTACKS: dict[str, Callable[..., Hostile]] = {}
"""A factory of every attack by its name."""

BAD_FRAME = 2
MARK = f"hostile{os.environ.get('PYTEST_XDIST_WORKER', '')}".encode()
"""Name of its processes; another one in each worker of the tests, which all attack a run of their own."""
FINE = Estimate([1, 2, 30, 40])


class Hostile:
    def __init__(self, attack: Callable[..., Any]) -> None:
        self._attack = attack

    def init(self, image: np.ndarray, box: np.ndarray) -> None:
        self._seen, self._box = 0, np.array(box)
        if sys.platform == "linux":
            ctypes.CDLL(None).prctl(15, MARK, 0, 0, 0)  # the name of this process and its children

    def update(self, image: np.ndarray) -> Any:
        self._seen += 1
        return self._attack(image) if self._seen >= BAD_FRAME else Estimate(self._box)


def attack(function: Callable[[np.ndarray], Any]) -> Callable[..., Hostile]:
    """A factory of trackers that call the function."""
    ATTACKS[function.__name__] = lambda **_: Hostile(function)
    return ATTACKS[function.__name__]
