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


def good(**_: Any) -> FaultyTracker:
    return FaultyTracker(lambda image: Estimate([1, 2, 30, 40]))


def raises(**_: Any) -> FaultyTracker:
    def fault(image: np.ndarray) -> Any:
        raise ValueError("lost my way")

    return FaultyTracker(fault)


def returns_nan(**_: Any) -> FaultyTracker:
    return FaultyTracker(lambda image: Estimate([np.nan, 0, 5, 5]))


def returns_an_array(**_: Any) -> FaultyTracker:
    return FaultyTracker(lambda image: np.zeros(3))


def returns_none(**_: Any) -> FaultyTracker:
    return FaultyTracker(lambda image: None)


def never_returns(**_: Any) -> FaultyTracker:
    def fault(image: np.ndarray) -> Any:
        while True:
            pass

    return FaultyTracker(fault)


def segfaults(**_: Any) -> FaultyTracker:
    return FaultyTracker(lambda image: ctypes.string_at(0))


def kills_its_process(**_: Any) -> FaultyTracker:
    return FaultyTracker(lambda image: os.kill(os.getpid(), signal.SIGKILL))


def calls_sys_exit(**_: Any) -> FaultyTracker:
    return FaultyTracker(lambda image: sys.exit(0))


def calls_os_exit(**_: Any) -> FaultyTracker:
    return FaultyTracker(lambda image: os._exit(3))


def takes_too_much_memory(**_: Any) -> FaultyTracker:
    def fault(image: np.ndarray) -> Any:
        arrays = [np.empty(10_000_000) for _ in range(100)]
        return Estimate([float(len(arrays)), 0, 5, 5])

    return FaultyTracker(fault)


def writes_into_its_image(**_: Any) -> FaultyTracker:
    def fault(image: np.ndarray) -> Any:
        image[:] = 0
        return Estimate([1, 2, 30, 40])

    return FaultyTracker(fault)


def prints(**_: Any) -> FaultyTracker:
    def fault(image: np.ndarray) -> Any:
        os.write(1, b"rubbish " * 20_000)
        os.write(2, b"more rubbish\n")
        return Estimate([1, 2, 30, 40])

    return FaultyTracker(fault)


class StopsItsClock(FaultyTracker):
    def __init__(self) -> None:
        super().__init__(lambda image: Estimate(self._box))
        time.perf_counter = lambda: 0.0

    def update(self, image: np.ndarray) -> Any:
        time.sleep(0.03)
        return super().update(image)


def stops_its_clock(**_: Any) -> FaultyTracker:
    return StopsItsClock()


def fails_for_seed_4(*, seed: int, **_: Any) -> FaultyTracker:
    if seed == 4:
        raise OSError("no weights")
    return good()


def ends_while_imported(**_: Any) -> FaultyTracker:
    os._exit(5)


class _FarAway(FaultyTracker):
    def update(self, image: np.ndarray) -> Any:
        return self._fault(image)


def far_away(**_: Any) -> FaultyTracker:
    return _FarAway(lambda image: Estimate([0, 0, 1, 1]))


def returns_a_list(**_: Any) -> FaultyTracker:
    return _FarAway(lambda image: [1.0, 2.0, 30.0, 40.0])


class Corners:
    """Answers the first box by its corners, as a plain tuple."""

    def init(self, image: np.ndarray, box: np.ndarray) -> None:
        x, y, w, h = box
        self._corners = (x, y, x + w, y + h)

    def update(self, image: np.ndarray) -> Any:
        return self._corners


def corners(**_: Any) -> Corners:
    return Corners()
