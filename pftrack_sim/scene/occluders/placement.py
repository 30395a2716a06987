"""Pose and size of a standing occluder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pftrack_sim.scene.layout import Footprint


@dataclass(frozen=True)
class Placement:
    """A standing thing that covers the target's centre line.

    Attributes:
        kind: What it is.
        centre_m: x, y of its centre.
        half_m: Half its width and half its thickness.
        yaw_rad: Angle of its width to the world's x.
        height_m: How tall it is.
        depth: Where it stands on the line from the camera (0) to the target (1).
        spans_s: When it covers the target's centre line in the rehearsal: as asked, and then perhaps again later.
    """

    kind: Literal["pillar", "wall", "boxes"]
    centre_m: tuple[float, float]
    half_m: tuple[float, float]
    yaw_rad: float
    height_m: float
    depth: float
    spans_s: tuple[tuple[float, float], ...]

    def footprint(self, name: str) -> Footprint:
        """What people walk around."""
        return Footprint(name, self.centre_m, self.half_m, self.yaw_rad, self.height_m)
