"""Noise of the sensor: photons are counted, and reading them out adds some of its own."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from pftrack_sim.scenario.axes.axis import Axis
from pftrack_sim.scenario.section import NotNegative, Positive


class NoiseAxis(Axis):
    """The camera model of EMVA 1288: Poisson electrons, Gaussian read noise, a gain. Night is dark: photons are few."""

    headline: ClassVar[str] = "gain"
    unit: ClassVar[str] = "x analogue gain"
    law: ClassVar[str] = (
        "gain and read noise are multiplied by the severity; a white pixel is full_well_e / gain electrons, their "
        "number is Poisson, read noise in electrons is added, and the sum is clipped, display-coded and rounded"
    )
    source: ClassVar[str] = (
        "EMVA Standard 1288, release 4.0, section 2; typical values are round numbers for a small CMOS"
    )

    full_well_e: Positive = Field(default=10000.0, description="Electrons of a white pixel at gain 1.")
    read_noise_e: NotNegative = Field(default=6.0, description="Standard deviation of what reading out adds [e-].")
    gain: Positive = Field(
        default=4.0, description="Analogue gain, as ISO / 100: less light is enough for white, with fewer electrons."
    )

    @property
    def white_e(self) -> float:
        """Electrons of a white pixel at this severity, above 0."""
        return self.full_well_e / (self.severity * self.gain)
