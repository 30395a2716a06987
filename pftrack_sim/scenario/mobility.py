"""What people move with or on, and what they can do meanwhile."""

from __future__ import annotations

from typing import Literal, TypeAlias

Mobility: TypeAlias = Literal["wheelchair", "bicycle", "scooter", "pram", "crutches"]

ABLE: dict[Mobility, frozenset[str]] = {
    "wheelchair": frozenset({"stop", "turn", "approach", "look_around", "pace", "walk_off"}),
    "bicycle": frozenset({"stop", "look_around", "pace", "walk_off"}),
    "scooter": frozenset({"stop", "look_around", "pace", "walk_off"}),
    "pram": frozenset({"stop", "look_around", "pace", "walk_off", "run"}),
    "crutches": frozenset({"stop", "look_around", "pace"}),
}
"""Kinds of actions that are possible with it."""

TOP_SHARE: dict[Mobility, float] = {"wheelchair": 0.8}
"""Height of the crown of who sits, as a share of the stature."""

USUAL_SPEED_M_S: dict[Mobility, float] = {"crutches": 0.8}
TOP_SPEED_M_S: dict[Mobility | None, float] = {"crutches": 1.1}
"""Usual and highest walking speed; on forearm crutches mean, and mean and two standard deviations, of Demir and
Yildirim, Neurosciences 24:36 (2019): 48.5 +- 8.2 m/min."""
