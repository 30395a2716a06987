"""What reaches the tracker of what the camera took: compressed, thinned out, with frames lost in bursts."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from pftrack_sim.scenario.axes.axis import Axis
from pftrack_sim.scenario.section import Positive

MOST_DROPPED = 0.9
"""Share of frames above which no severity goes: some must arrive."""

WORST_QUALITY = 3
"""JPEG quality below which no severity goes: what is below looks the same."""


class StreamAxis(Axis):
    """A radio link: JPEG frames at a lower rate, some of them lost, one after the other.

    A frame that is lost is never shown. The tracker sees the next that arrives; its truth is of the time it was taken.
    In a closed loop the last command holds meanwhile.
    """

    headline: ClassVar[str] = "dropped_share"
    unit: ClassVar[str] = "share of frames"
    law: ClassVar[str] = (
        "share dropped and loss of quality (100 - jpeg_quality) are multiplied by the severity, the rate is divided by "
        "it; frames are lost by a chain of two states whose bad state lasts burst_frames on average"
    )
    source: ClassVar[str] = (
        "Gilbert 1960, 'Capacity of a burst-noise channel'; Elliott 1963; JPEG quality as in the Independent JPEG "
        "Group's library"
    )

    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = Field(default=60, description="JPEG quality; 100 is best.")
    dropped_share: Annotated[float, Field(ge=0.0, le=MOST_DROPPED)] = Field(
        default=0.1, description="Share of the frames sent that are lost, in the long run."
    )
    burst_frames: Annotated[float, Field(ge=1.0)] = Field(
        default=3.0, description="Mean number of frames lost in a row."
    )
    rate_hz: Positive = Field(
        default=20.0, description="Frames sent per second; no more than the camera takes are sent at any severity."
    )

    @property
    def quality(self) -> int:
        """JPEG quality at this severity."""
        return max(WORST_QUALITY, round(100.0 - self.severity * (100.0 - self.jpeg_quality)))

    @property
    def lost(self) -> float:
        """Share of frames lost at this severity."""
        return min(MOST_DROPPED, self.severity * self.dropped_share)

    @property
    def sent_hz(self) -> float:
        """Frames sent per second at this severity, above 0."""
        return self.rate_hz / self.severity

    @property
    def transitions(self) -> tuple[float, float]:
        """Probabilities per frame of falling into the bad state, and of leaving it.

        Where so many frames are lost that bursts of the length asked for would have to touch, bursts are longer.
        """
        odds = self.lost / (1.0 - self.lost)
        leave = 1.0 / max(self.burst_frames, odds)
        return leave * odds, leave
