"""What the target does besides walking on."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field

from pftrack_sim.scenario.axes.axis import Axis
from pftrack_sim.scenario.section import NotNegative, Positive

Manoeuvre: TypeAlias = Literal["stop", "turn", "crouch", "run"]


class TargetAxis(Axis):
    """Manoeuvres of the target on its path, a robot that comes nearer and falls back, and a target lost from view."""

    headline: ClassVar[str] = "per_minute"
    unit: ClassVar[str] = "manoeuvres / min"
    law: ClassVar[str] = (
        "per_minute, faster_m_s, range_m and leave_s are multiplied by the severity; manoeuvres come in the order "
        "given, evenly in time or, where that is too fast, one after the other"
    )
    source: ClassVar[str] = "changes of posture, scale and view in Ko et al. 2012 and Kwon et al. 2005"

    per_minute: NotNegative = Field(default=12.0, description="Manoeuvres a minute at severity 1; 0 for none.")
    manoeuvres: Annotated[tuple[Manoeuvre, ...], Field(min_length=1)] = Field(
        default=("stop", "run", "crouch", "turn"),
        description="In this order, over and over. 'stop': stands still for a while; 'turn': faces about on the spot, "
        "walks back, and faces about again; 'crouch': stops, squats and rises; 'run': runs for a while.",
    )
    at_s: NotNegative = Field(default=2.0, description="When the first manoeuvre begins.")
    run_m_s: Annotated[float, Field(ge=2.2, le=3.2)] = Field(default=2.7, description="Speed of running.")
    faster_m_s: NotNegative = Field(default=0.1, description="Added to the walking speed at severity 1.")
    range_m: NotNegative = Field(
        default=0.4, description="How far the robot swings ahead of and behind its place beside or behind the target."
    )
    period_s: Positive = Field(
        default=12.0, description="Period of that swing; a short one asks for more than the robot's top speed."
    )
    leave_s: NotNegative = Field(default=0.5, description="How long the target is out of view at severity 1.")
    leave_at_s: NotNegative = Field(default=9.0, description="When it leaves; the operator's camera turns away.")

    @property
    def every_s(self) -> float:
        """Time from the beginning of a manoeuvre to the beginning of the next; infinite for none."""
        rate = self.severity * self.per_minute
        return 60.0 / rate if rate > 0.0 else float("inf")

    @property
    def swing_m(self) -> float:
        """Amplitude of the robot's swing at this severity."""
        return self.severity * self.range_m

    @property
    def away_s(self) -> float:
        """How long the target is out of view at this severity."""
        return self.severity * self.leave_s
