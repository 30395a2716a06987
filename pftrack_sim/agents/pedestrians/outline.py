"""The ground that a person takes, with what it rides or pushes: what others keep clear of."""

from __future__ import annotations

import math
from typing import NamedTuple

from pftrack_sim.agents.pedestrians.avoidance import LEAST_PERSON_M
from pftrack_sim.agents.pedestrians.obstacle_map import Xy
from pftrack_sim.scenario.people import Target
from pftrack_sim.scene.people.mobility import footprint_m

_INSET = 0.5  # Of the ends of the line from those of the footprint, in half widths


class Outline(NamedTuple):
    """A line along the heading, and the distance to keep from it in addition to that from a person on foot.

    Attributes:
        rear_m: Where the line begins: 0 at the person, negative behind.
        front_m: Where it ends, ahead of the person.
    """

    rear_m: float = 0.0
    front_m: float = 0.0
    extra_m: float = 0.0

    @classmethod
    def of(cls, target: Target) -> Outline:
        """That of a target: no circle of `LEAST_PERSON_M` about a person at this distance enters its footprint."""
        if target.uses is None:
            return cls()
        rear_m, front_m, half_m = footprint_m(target.uses, target.height_m)
        inset_m = _INSET * half_m
        extra_m = math.hypot(inset_m, half_m) - 0.5 * LEAST_PERSON_M
        return cls(min(rear_m + inset_m, 0.0), max(front_m - inset_m, 0.0), max(extra_m, 0.0))

    def nearest(self, at_m: Xy, heading_rad: float, point_m: Xy) -> Xy:
        """The point of the line that is nearest to another, of a person at a place and heading."""
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        along = (point_m[0] - at_m[0]) * cos + (point_m[1] - at_m[1]) * sin
        along = min(max(along, self.rear_m), self.front_m)
        return at_m[0] + along * cos, at_m[1] + along * sin

    def reach_m(self, heading_rad: float, direction_rad: float) -> float:
        """How far it reaches beyond a person on foot in a direction."""
        cos = math.cos(heading_rad - direction_rad)
        return max(cos * self.front_m, cos * self.rear_m) + self.extra_m
