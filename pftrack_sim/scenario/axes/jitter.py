"""Vibration of the camera, on top of the scenario's own."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field, model_validator

from pftrack_sim.scenario.axes.axis import Axis
from pftrack_sim.scenario.section import NotNegative, Positive


class JitterAxis(Axis):
    """Vibration of the camera on its mount, added to the scenario's own."""

    headline: ClassVar[str] = "angular_rms_deg"
    unit: ClassVar[str] = "deg RMS"
    law: ClassVar[str] = "band-limited Gaussian motion; every RMS is multiplied by the severity"
    source: ClassVar[str] = "spectral representation: Shinozuka & Deodatis 1991"

    angular_rms_deg: NotNegative = Field(default=0.35, description="RMS of each of roll, pitch and yaw at severity 1.")
    translational_rms_mm: NotNegative = Field(default=4.0, description="RMS along each of x, y and z at severity 1.")
    band_hz: tuple[Positive, Positive] = Field(default=(1.0, 12.0), description="Lowest and highest frequency.")

    @model_validator(mode="after")
    def _band_is_ordered(self) -> JitterAxis:
        if self.band_hz[0] >= self.band_hz[1]:
            raise ValueError(f"band_hz must be [low, high] with low < high, got {list(self.band_hz)}")
        return self
