"""The time between a command and what the motors do about it."""

from __future__ import annotations

from collections import deque

from pftrack_sim.world.clock import Clock

Speeds = tuple[float, float, float, float]
"""Forward speed [m/s], turn, pan and tilt rate [rad/s]."""

_AT_REST: Speeds = (0.0, 0.0, 0.0, 0.0)


class Delay:
    """Holds commands back on the simulated clock.

    Args:
        clock: How often commands come, and what a physics step is.
        latency_ms: How long each is held back, rounded to a physics step. 0 passes everything on at once.
    """

    def __init__(self, clock: Clock, latency_ms: float) -> None:
        self._steps = clock.steps
        self._held = round(1e-3 * latency_ms / clock.step_s)
        self.reset()

    def reset(self) -> None:
        """Before the first command arrives, the motors are told to rest."""
        whole = self._held // self._steps
        self._queue: deque[Speeds] = deque([_AT_REST] * (whole + 1), maxlen=whole + 2)

    def pass_on(self, speeds: Speeds) -> list[tuple[int, Speeds]]:
        """Take the command of a tick.

        Returns:
            What reaches the motors during the tick: for how many physics steps, and which command.
        """
        self._queue.append(speeds)
        old, new = self._queue[0], self._queue[1]
        first = self._held % self._steps
        if first == 0:
            return [(self._steps, new)]
        return [(first, old), (self._steps - first, new)]
