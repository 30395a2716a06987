"""Nested clocks: camera frames, control ticks, physics steps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

TICK_HZ = 25.0  # Lowest rate of control ticks, at which people and controllers move
PHYSICS_HZ = 500.0  # Lowest rate of physics steps


@dataclass(frozen=True)
class Clock:
    """Camera frames per second, control ticks in one frame, and physics steps in one tick."""

    rate_hz: float
    ticks: int
    steps: int

    @classmethod
    def for_rate(cls, rate_hz: float) -> Clock:
        """The fewest ticks and steps that meet `TICK_HZ` and `PHYSICS_HZ`.

        >>> Clock.for_rate(15.0)
        Clock(rate_hz=15.0, ticks=2, steps=17)
        """
        ticks = math.ceil(TICK_HZ / rate_hz)
        return cls(rate_hz, ticks, math.ceil(PHYSICS_HZ / (rate_hz * ticks)))

    @cached_property
    def tick_s(self) -> float:
        """Length of a tick."""
        return 1.0 / (self.rate_hz * self.ticks)

    @cached_property
    def step_s(self) -> float:
        """Length of a physics step."""
        return self.tick_s / self.steps

    def time_s(self, tick: int) -> float:
        """Time at the end of a tick counted from the start; a quotient, so that no rounding errors accumulate."""
        return tick / (self.rate_hz * self.ticks)
