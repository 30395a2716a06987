"""Rolling shutter: the rows of a frame are read one after the other."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from pftrack_sim.scenario.axes.axis import Axis


class RollingShutterAxis(Axis):
    """Each row is exposed at a time of its own, the top row first; at severity 0 all at once."""

    headline: ClassVar[str] = "readout_ms"
    unit: ClassVar[str] = "ms"
    law: ClassVar[str] = (
        "the readout is multiplied by the severity; a row at height y of H is exposed readout x (1 - y / H) before "
        "the frame's time, so an upright pole that moves at v px/s slants by v x readout over the image's height"
    )
    source: ClassVar[str] = "Meingast, Geyer & Sastry 2005; 20 ms is usual in phones and webcams"

    readout_ms: Annotated[float, Field(ge=0.0, le=200.0)] = Field(
        default=20.0, description="From the top of the image to its bottom."
    )
