"""What people move with or on, and what they can do meanwhile."""

from __future__ import annotations

from typing import Literal, TypeAlias

Mobility: TypeAlias = Literal["wheelchair", "bicycle", "scooter", "pram"]

ABLE: dict[Mobility, frozenset[str]] = {
    "wheelchair": frozenset({"stop", "turn", "approach", "look_around", "pace", "walk_off"}),
    "bicycle": frozenset({"stop", "look_around", "pace", "walk_off"}),
    "scooter": frozenset({"stop", "look_around", "pace", "walk_off"}),
    "pram": frozenset({"stop", "look_around", "pace", "walk_off", "run"}),
}
"""Kinds of actions that are possible with it."""

TOP_SHARE: dict[Mobility, float] = {"wheelchair": 0.8}
"""Height of the crown of who sits, as a share of the stature."""
