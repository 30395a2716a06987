"""The time between a command and what the motors do about it."""

from __future__ import annotations

from collections import deque

from pftrack_sim.agents.clock import Clock

Speeds = tuple[float, float, float, float]
"""Forward speed [m/s], turn, pan and tilt rate [rad/s]."""

_AT_REST: Speeds = (0.0, 0.0, 0.0, 0.0)


class CommandDelay:
    """Holds commands back on the simulated clock, to the physics step.

    Args:
        clock: How often commands come, and what a physics step is.
        latency_ms: How long each is held back. 0 passes everything on at once.
    """

    def __init__(self, clock: Clock, latency_ms: float) -> None:
        self._clock = clock
        self._held = round(1e-3 * latency_ms / clock.step_s)
        self.reset()

    def reset(self) -> None:
        """Before the first command arrives, the motors are told to rest."""
        self._last = _AT_REST
        self._line: deque[tuple[int, Speeds]] = deque()
        self._append(self._held, _AT_REST)

    def segments(self, speeds: Speeds, late_s: float = 0.0) -> list[tuple[int, Speeds]]:
        """Take the command of a tick.

        Args:
            speeds: The command.
            late_s: How far into the tick it is given; until then the one before stays in force.

        Returns:
            What reaches the motors during the tick: for how many physics steps, and which command.
        """
        late = min(round(late_s / self._clock.step_s), self._clock.steps)
        self._append(late, self._last)
        self._append(self._clock.steps - late, speeds)
        if late < self._clock.steps:
            self._last = speeds
        out: list[tuple[int, Speeds]] = []
        wanted = self._clock.steps
        while wanted > 0:
            steps, first = self._line.popleft()
            if steps > wanted:
                self._line.appendleft((steps - wanted, first))
            out.append((min(steps, wanted), first))
            wanted -= out[-1][0]
        return out

    def _append(self, steps: int, speeds: Speeds) -> None:
        if steps > 0:
            self._line.append((steps, speeds))
