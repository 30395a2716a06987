"""People who pass by the target."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from pftrack_sim.scenario.axes.axis import Axis
from pftrack_sim.scenario.section import NotNegative, Positive, Share


class DistractorsAxis(Axis):
    """People who come along the target's way and pass close by it, one after the other, added to the scenario's own."""

    headline: ClassVar[str] = "count"
    unit: ClassVar[str] = "people"
    law: ClassVar[str] = (
        "count, times the severity and rounded, people pass the target, the first at at_s and one every every_s; each "
        "is nearest at distance_m. Their likeness is the Bhattacharyya coefficient aimed at, the same at any severity"
    )
    source: ClassVar[str] = "look-alikes that appear 3 to 8 times an episode: Lee et al. 2012, table 2"

    count: Annotated[int, Field(ge=0, le=8)] = Field(default=2, description="How many pass by at severity 1.")
    similarity: Share = Field(
        default=0.7, description="Likeness of clothes and build to the target's; 1 is a twin, 0 clearly different."
    )
    distance_m: Annotated[float, Field(ge=0.55, le=3.0)] = Field(
        default=0.8, description="From centre to centre, when nearest to the target."
    )
    at_s: NotNegative = Field(default=3.0, description="When the first one is nearest.")
    every_s: Positive = Field(default=3.0, description="From one passing to the next.")

    @property
    def passings_s(self) -> tuple[float, ...]:
        """When each one is nearest to the target, at this severity; none at severity 0."""
        return tuple(self.at_s + number * self.every_s for number in range(round(self.severity * self.count)))
