"""Third-party trackers with one fault each, at their second update (frame 2)."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from pftrack_sim.core.records import Estimate

BAD_FRAME = 2


class FaultyTracker:
    """Returns the first box until `BAD_FRAME`.

    Args:
        fault: Called from then on; its result is returned.
    """

    def __init__(self, fault: Callable[[np.ndarray], Any]) -> None:
        self._fault = fault

    def init(self, image: np.ndarray, box: np.ndarray) -> None:
        self._seen, self._box = 0, np.array(box)

    def update(self, image: np.ndarray) -> Any:
        self._seen += 1
        if self._seen >= BAD_FRAME:
            return self._fault(image)
        return Estimate(self._box)


def _with(
    fault: Callable[[np.ndarray], Any], kind: type[FaultyTracker] = FaultyTracker
) -> Callable[..., FaultyTracker]:
    """A factory of trackers with this fault."""
    return lambda **_: kind(fault)


class _AtOnce(FaultyTracker):
    """Has its fault from the first update on."""

    def update(self, image: np.ndarray) -> Any:
        return self._fault(image)


def _raise(image: np.ndarray) -> Any:
    raise ValueError("lost my way")


def _hang(image: np.ndarray) -> Any:
    while True:
        pass


def _take_memory(image: np.ndarray) -> Any:
    arrays = [np.empty(10_000_000) for _ in range(100)]
    return Estimate([float(len(arrays)), 0, 5, 5])


def _draw(image: np.ndarray) -> Any:
    image[:] = 0
    return Estimate([1, 2, 30, 40])


def _print(image: np.ndarray) -> Any:
    os.write(1, b"rubbish " * 20_000)
    os.write(2, b"more rubbish\n")
    return Estimate([1, 2, 30, 40])


good = _with(lambda image: Estimate([1, 2, 30, 40]))
raises = _with(_raise)
returns_nan = _with(lambda image: Estimate([np.nan, 0, 5, 5]))
returns_an_array = _with(lambda image: np.zeros(3))
returns_none = _with(lambda image: None)
returns_a_list = _with(lambda image: [1.0, 2.0, 30.0, 40.0], _AtOnce)
far_away = _with(lambda image: Estimate([0, 0, 1, 1]), _AtOnce)
never_returns = _with(_hang)
segfaults = _with(lambda image: ctypes.string_at(0))
kills_its_process = _with(lambda image: os.kill(os.getpid(), signal.SIGKILL))
calls_sys_exit = _with(lambda image: sys.exit(0))
calls_os_exit = _with(lambda image: os._exit(3))
takes_too_much_memory = _with(_take_memory)
writes_into_its_image = _with(_draw)
prints = _with(_print)


class StopsItsClock(FaultyTracker):
    def __init__(self, **_: Any) -> None:
        super().__init__(lambda image: Estimate(self._box))
        time.perf_counter = lambda: 0.0

    def update(self, image: np.ndarray) -> Any:
        time.sleep(0.03)
        return super().update(image)


class _Late(Estimate):
    def __del__(self) -> None:
        time.sleep(0.03)


works_in_a_finalizer = _with(lambda image: _Late([0, 0, 1, 1]), _AtOnce)


def fails_for_seed_4(*, seed: int, **_: Any) -> FaultyTracker:
    if seed == 4:
        raise OSError("no weights")
    return good()


def ends_while_imported(**_: Any) -> FaultyTracker:
    os._exit(5)


class Corners(FaultyTracker):
    """Answers the first box by its corners, as a plain tuple."""

    def __init__(self, **_: Any) -> None:
        super().__init__(lambda image: None)

    def update(self, image: np.ndarray) -> Any:
        x, y, w, h = self._box
        return (x, y, x + w, y + h)
