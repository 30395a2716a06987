"""Delay between a command and its effect on the motors."""

from __future__ import annotations

from collections import deque
from typing import TypeAlias

from pftrack_sim.agents.clock import Clock

Speeds: TypeAlias = tuple[float, float, float, float]  # Forward speed [m/s], turn, pan and tilt rate [rad/s]
_AT_REST: Speeds = (0.0, 0.0, 0.0, 0.0)


class CommandDelay:
    """Delays commands by a constant latency, rounded to physics steps."""

    def __init__(self, clock: Clock, latency_ms: float) -> None:
        self._clock = clock
        self._latency_steps = round(1e-3 * latency_ms / clock.step_s)
        self.reset()

    def reset(self) -> None:
        """Command zero speeds until the first command arrives."""
        self._last = _AT_REST
        self._queue: deque[tuple[int, Speeds]] = deque()
        self._append(self._latency_steps, _AT_REST)

    def segments(self, speeds: Speeds, delay_s: float = 0.0) -> list[tuple[int, Speeds]]:
        """Take the command of a tick, and return what reaches the motors during the tick.

        The command is given `delay_s` into the tick; until then the previous one stays in force.

        Returns:
            Numbers of physics steps, which sum to those of a tick, each with the command in force.
        """
        delay = min(round(delay_s / self._clock.step_s), self._clock.steps)
        self._append(delay, self._last)
        self._append(self._clock.steps - delay, speeds)
        if delay < self._clock.steps:
            self._last = speeds
        segments: list[tuple[int, Speeds]] = []
        missing = self._clock.steps
        while missing > 0:
            steps, first = self._queue.popleft()
            if steps > missing:
                self._queue.appendleft((steps - missing, first))
            segments.append((min(steps, missing), first))
            missing -= segments[-1][0]
        return segments

    def _append(self, steps: int, speeds: Speeds) -> None:
        if steps > 0:
            self._queue.append((steps, speeds))
