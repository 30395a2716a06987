"""Shaking of the camera, on top of the scenario's own: wind, ground and road."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field, model_validator

from pftrack_sim.scenario.axes.axis import Axis
from pftrack_sim.scenario.section import NotNegative, Positive

Source: TypeAlias = Literal["wind", "ground", "road"]
RoadClass: TypeAlias = Literal["A", "B", "C", "D", "E"]


class JitterAxis(Axis):
    """The three shakes that Ko et al. 2012 name, each alone or together: wind, ground vibration, and the road."""

    headline: ClassVar[str] = "angular_rms_deg"
    unit: ClassVar[str] = "deg RMS"
    law: ClassVar[str] = (
        "RMS of wind and ground, and the height of the road's bumps, are multiplied by the severity; wind sways the "
        "mast about its foot with a first-order spectrum, ground is flat over its band, the road goes through wheels "
        "and suspension at the robot's speed"
    )
    source: ClassVar[str] = "Ko, Nam & Kwak 2012, section 1; ISO 8608:2016; Shinozuka & Deodatis 1991"

    sources: Annotated[tuple[Source, ...], Field(min_length=1)] = Field(
        default=("wind", "ground", "road"), description="Which shakes; the others are left out."
    )
    wind_rms_deg: NotNegative = Field(default=0.2, description="Gusts: RMS of each of pitch, yaw and roll.")
    wind_corner_hz: Annotated[float, Field(gt=0.0, le=20.0)] = Field(
        default=0.8, description="Gusts: frequency above which they fade (spectrum 1 / (1 + (f / corner)^2))."
    )
    ground_rms_deg: NotNegative = Field(default=0.3, description="Vibration: RMS of each of pitch, yaw and roll.")
    ground_rms_mm: NotNegative = Field(default=3.0, description="Vibration: RMS along each of x, y and z.")
    ground_band_hz: tuple[Positive, Positive] = Field(
        default=(2.0, 12.0), description="Vibration: lowest and highest frequency."
    )
    road_class: RoadClass = Field(
        default="B", description="Roughness of the road by ISO 8608: A (very good) to E (very poor)."
    )

    @model_validator(mode="after")
    def _band_is_ordered(self) -> JitterAxis:
        if self.ground_band_hz[0] >= self.ground_band_hz[1]:
            raise ValueError(f"ground_band_hz must be [low, high] with low < high, got {list(self.ground_band_hz)}")
        return self

    @property
    def angular_rms_deg(self) -> float:
        """RMS of each of pitch, yaw and roll by wind and ground together, at severity 1 (the road's is its own)."""
        wind = self.wind_rms_deg if "wind" in self.sources else 0.0
        ground = self.ground_rms_deg if "ground" in self.sources else 0.0
        return math.hypot(wind, ground)

    @property
    def roughness(self) -> float:
        """Factor on the heights of the road's bumps: the severity, or 0 without a road."""
        return self.severity if "road" in self.sources else 0.0
