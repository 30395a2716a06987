"""Where the target has walked: the way to it when the straight one is barred."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

STEP_M = 0.25
"""The target's way is remembered in steps of this length."""

LONGEST_M = 15.0
"""So much of it: the robot is never that far behind and still sees the target."""


class Trail:
    """The target's way in the frame of the odometry, newest point last.

    A person who has gone round a corner has shown the way round it. The robot makes for the newest point of the trail
    that it can reach in a straight line, and so cuts no corner that the person did not cut.
    """

    def __init__(self) -> None:
        self._points: deque[NDArray[np.float64]] = deque(maxlen=round(LONGEST_M / STEP_M))

    def forget(self) -> None:
        """Forget all of it."""
        self._points.clear()

    def add(self, target_m: NDArray[np.float64]) -> None:
        """The target is here now.

        Args:
            target_m: `(2,)` in the frame of the odometry.
        """
        if not self._points or np.hypot(*(target_m - self._points[-1])) >= STEP_M:
            self._points.append(target_m)

    def shorten(self) -> None:
        """Forget all but where the target is: the straight way is free."""
        while len(self._points) > 1:
            self._points.popleft()

    def next(
        self, robot_m: NDArray[np.float64], heading_rad: float, is_clear: Callable[[float, float], bool]
    ) -> tuple[float, float] | None:
        """The newest point with a clear way to it.

        Args:
            robot_m: `(2,)` in the frame of the odometry.
            heading_rad: In the same frame.
            is_clear: Whether the straight way at a bearing, for a distance, is clear.

        Returns:
            Its bearing off the robot's heading [rad] and the length of the way over it to the target [m]; None when
            there is no such point.
        """
        onward = 0.0
        last: NDArray[np.float64] | None = None
        for point in reversed(self._points):
            if last is not None:
                onward += float(np.hypot(*(last - point)))
            last = point
            dx, dy = (point - robot_m).tolist()
            distance = math.hypot(dx, dy)
            bearing = math.remainder(math.atan2(dy, dx) - heading_rad, 2.0 * math.pi)
            if distance < STEP_M:
                return None  # here already, and nothing newer can be reached
            if is_clear(bearing, distance):
                return bearing, distance + onward
        return None
