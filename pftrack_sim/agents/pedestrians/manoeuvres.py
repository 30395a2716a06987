"""What the target does besides walking on, as a script over time."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pftrack_sim.scenario.axes import TargetAxis

ACCELERATION_M_S2 = 2.0
"""How hard the target speeds up and slows down for a manoeuvre."""

BACK_M_S = 0.9
"""Speed of walking back."""

LENGTHS_S = {"stop": 2.2, "turn": 5.2, "crouch": 3.8, "run": 3.0}
"""How long each manoeuvre takes, slowing down included."""

_FASTEST_WALK_M_S = 2.2


@dataclass(frozen=True)
class Wish:
    """What the target wants to do now.

    Attributes:
        speed_m_s: Along its path; negative is back.
        facing_rad: Angle of its heading to the path's direction.
        crouch: 0 upright, 1 squatting.
        running: Whether it runs.
    """

    speed_m_s: float
    facing_rad: float = 0.0
    crouch: float = 0.0
    running: bool = False


class Manoeuvres:
    """The script of one axis.

    Args:
        axis: What is asked.
        speed_m_s: Walking speed of the scenario.
    """

    def __init__(self, axis: TargetAxis, speed_m_s: float) -> None:
        self._axis = axis
        self.walk_m_s = speed_m_s
        if axis.on:
            self.walk_m_s = max(min(speed_m_s + axis.severity * axis.faster_m_s, _FASTEST_WALK_M_S), speed_m_s)

    def wish(self, time_s: float) -> Wish:
        """What the target wants to do at a time since the start."""
        axis = self._axis
        walk = Wish(self.walk_m_s)
        if not math.isfinite(axis.every_s):
            return walk
        begin_s, number = axis.at_s, 0
        while time_s >= begin_s:
            name = axis.manoeuvres[number % len(axis.manoeuvres)]
            if time_s < begin_s + LENGTHS_S[name]:
                return self._during(name, time_s - begin_s)
            # A step of walking in between, so that one can be told from the next.
            begin_s += max(axis.every_s, LENGTHS_S[name] + 0.6)
            number += 1
        return walk

    def _during(self, name: str, since_s: float) -> Wish:
        if name == "run":
            return Wish(self._axis.run_m_s, running=True)
        if name == "crouch":
            down = _ease((since_s - 1.0) / 0.7) - _ease((since_s - 2.7) / 0.7)
            return Wish(0.0, crouch=down)
        if name == "stop":
            return Wish(0.0)
        facing = math.pi * (_ease((since_s - 0.8) / 1.1) - _ease((since_s - 3.9) / 1.1))
        return Wish(-BACK_M_S if 1.9 <= since_s < 3.2 else 0.0, facing)


def _ease(share: float) -> float:
    """0 to 1, gently at both ends."""
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)
