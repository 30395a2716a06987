"""Motion blur: the shutter stays open while the camera and the people move."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from pftrack_sim.scenario.axes.axis import Axis


class BlurAxis(Axis):
    """The frame integrates the light of the whole exposure; at severity 0 it is an instant."""

    headline: ClassVar[str] = "exposure_ms"
    unit: ClassVar[str] = "ms"
    law: ClassVar[str] = (
        "the exposure is multiplied by the severity; an edge that moves at v px/s is smeared over v x exposure, in "
        "linear light. The frame's time is the end of its exposure"
    )
    source: ClassVar[str] = "Potmesil & Chakravarty 1983 (temporal box filter); 10 ms is a usual indoor exposure"

    exposure_ms: Annotated[float, Field(ge=0.0, le=200.0)] = Field(
        default=10.0, description="How long the shutter is open."
    )
