"""Lens distortion: straight lines become curves."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from pftrack_sim.scenario.axes.axis import Axis


class DistortionAxis(Axis):
    """The Brown-Conrady lens as OpenCV writes it; at severity 0 a pinhole."""

    headline: ClassVar[str] = "radial"
    unit: ClassVar[str] = "|k1|"
    law: ClassVar[str] = (
        "every coefficient is multiplied by the severity; a ray with slopes (x, y) falls where cv2.projectPoints puts "
        "it. The camera matrix stays as it is: the middle of the image keeps its scale"
    )
    source: ClassVar[str] = "Brown 1966; OpenCV, camera calibration; coefficients of a usual wide-angle webcam"

    k1: float = Field(default=-0.25, description="Radial, r^2: negative is a barrel, positive a cushion.")
    k2: float = Field(default=0.08, description="Radial, r^4.")
    p1: float = Field(default=0.0, description="Tangential: the sensor is tilted about the horizontal.")
    p2: float = Field(default=0.0, description="Tangential: the sensor is tilted about the vertical.")
    k3: float = Field(default=0.0, description="Radial, r^6.")

    @property
    def coefficients(self) -> tuple[float, float, float, float, float]:
        """OpenCV's k1, k2, p1, p2, k3 at this severity."""
        s = self.severity
        return s * self.k1, s * self.k2, s * self.p1, s * self.p2, s * self.k3

    @property
    def radial(self) -> float:
        """Size of k1 at severity 1: how bent the lines are, whichever way."""
        return abs(self.k1)
