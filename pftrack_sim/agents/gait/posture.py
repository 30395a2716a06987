"""Postures: crouching, bending, sitting, looking aside, and arms that do not swing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


class Arm(NamedTuple):
    """Pose of an arm [rad], blended with its swing by `share` from 0 to 1.

    Attributes:
        shoulder: Flexion: 0 hangs along the trunk, positive forward.
        elbow: Flexion.
        outward: Abduction of the upper arm.
        forearm: Roll of the forearm outward.
    """

    share: float
    shoulder: float
    elbow: float
    outward: float = 0.0
    forearm: float = 0.0


@dataclass(frozen=True)
class Posture:
    """Posture of one person.

    Attributes:
        crouch: 0 upright, 1 a full squat.
        bend: 0 upright, 1 bent forward at the hips, hands towards the ground.
        sit: 0 upright, 1 seated on a bench.
        running: Whether the person runs instead of walking.
        look_rad: Turn of the head to the left; the trunk follows by a part of it.
        arms: Left and right arm; None swings.
    """

    crouch: float = 0.0
    bend: float = 0.0
    sit: float = 0.0
    running: bool = False
    look_rad: float = 0.0
    arms: tuple[Arm | None, Arm | None] = (None, None)


PLAIN = Posture()
