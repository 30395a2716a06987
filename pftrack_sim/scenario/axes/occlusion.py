"""Covers that come between the camera and the target on request."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from pftrack_sim.scenario.axes.axis import Axis
from pftrack_sim.scenario.section import NotNegative, Positive, Share


class OcclusionAxis(Axis):
    """Covers that come between the camera and the target, each at its time, added to the scenario's own.

    They move with the line of sight, so that a second of cover is a second in every scenario, wherever the robot
    drives: cabinets and low carts that drive themselves, and people who walk along for as long as they are asked to.
    """

    headline: ClassVar[str] = "duration_s"
    unit: ClassVar[str] = "s"
    law: ClassVar[str] = (
        "the target's centre line is behind a cover from at_s for duration_s, times the severity; cover k comes when "
        "gap_s have passed since the one before has gone"
    )
    source: ClassVar[str] = "spans of full and partial occlusion in Ko et al. 2012, table 2 and figure 5"

    kind: Literal["pillar", "wall", "stranger", "lookalike"] = Field(
        default="pillar",
        description="'pillar': a cabinet as tall as people; 'wall': a low cart that covers from the feet upwards; "
        "'stranger': someone in other clothes; 'lookalike': someone in the same.",
    )
    duration_s: Positive = Field(default=1.0, description="How long each one covers the centre line at severity 1.")
    share: Annotated[float, Field(gt=0.0, le=1.0)] = Field(
        default=1.0, description="Share of the target's visible body that a wall covers; others cover it whole."
    )
    count: Annotated[int, Field(ge=0, le=6)] = Field(default=1, description="How many.")
    at_s: NotNegative = Field(default=4.0, description="When the first one begins.")
    gap_s: NotNegative = Field(default=2.0, description="From the end of one to the beginning of the next.")
    depth: Annotated[float, Field(ge=0.3, le=0.7)] = Field(
        default=0.5, description="Where it passes on the line from the camera (0) to the target (1), if there is room."
    )

    @property
    def spans_s(self) -> tuple[tuple[float, float], ...]:
        """Beginning and length of each cover at this severity; none at severity 0."""
        if not self.on:
            return ()
        length = self.severity * self.duration_s
        return tuple((self.at_s + number * (length + self.gap_s), length) for number in range(self.count))

    @property
    def likeness(self) -> Share:
        """Likeness of people who cross to the target."""
        return 1.0 if self.kind == "lookalike" else 0.0
