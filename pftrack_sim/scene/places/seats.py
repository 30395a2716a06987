"""Seats for people who sit down."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from pftrack_sim.scene.places.builder import Collider, Item, PlaceBuilder
from pftrack_sim.scene.places.catalogue import load_prop

SEAT_M = 0.46  # Height of a seat's top
_BEHIND = 0.245  # Distance of a seat's middle behind the feet of a person in front of it, in statures
_PROPS: dict[str, tuple[dict[str, str], Collider]] = {
    "bench": ({"wood": "wood-light"}, (0.9, 0.28, 0.82)),
    "couch": ({"cloth": "fabric-blue"}, (0.99, 0.34, 0.82)),
}


@dataclass(frozen=True)
class Seat:
    """A seat, of a kind of the catalogue, behind a person of some stature, who sits down in its middle.

    x, y are of the person's feet while standing in front of it, and `heading_rad` is where the person looks.
    """

    kind: Literal["bench", "couch"]
    x_m: float
    y_m: float
    heading_rad: float
    height_m: float

    @property
    def centre_m(self) -> tuple[float, float]:
        """x, y of its middle."""
        behind_m = _BEHIND * self.height_m
        return self.x_m - behind_m * math.cos(self.heading_rad), self.y_m - behind_m * math.sin(self.heading_rad)


def add_seats(builder: PlaceBuilder, seats: Sequence[Seat]) -> None:
    """Add seats, named `"seat-1"` onwards; people avoid them as they avoid all furniture."""
    for number, seat in enumerate(seats, start=1):
        textures, collider = _PROPS[seat.kind]
        yaw_rad = seat.heading_rad + 0.5 * math.pi  # The props face -y.
        position = (*seat.centre_m, 0.0)
        builder.add(Item(f"seat-{number}", load_prop(seat.kind, **textures), position, yaw_rad, collider))
