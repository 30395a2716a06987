"""The places: plaza, corridor, warehouse, street by night and by day, hall and park."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pftrack_sim.scenario.model import Lights, Place
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.places.builder import PlaceBuilder, add_ground_plane
from pftrack_sim.scene.places.corridor import build_corridor
from pftrack_sim.scene.places.hall import build_hall
from pftrack_sim.scene.places.park import build_park
from pftrack_sim.scene.places.plaza import build_plaza
from pftrack_sim.scene.places.seats import Seat, add_seats
from pftrack_sim.scene.places.street import build_street, build_street_by_day
from pftrack_sim.scene.places.warehouse import build_warehouse
from pftrack_sim.scene.scene_spec import SceneSpec

_BUILDERS: dict[str, Callable[[PlaceBuilder], WalkableArea]] = {
    "plaza": build_plaza,
    "corridor": build_corridor,
    "warehouse": build_warehouse,
    "street": build_street,
    "street-day": build_street_by_day,
    "hall": build_hall,
    "park": build_park,
}


def add_place(
    spec: SceneSpec,
    place: Place,
    lights: Lights,
    rng: np.random.Generator,
    patch_rng: np.random.Generator | None = None,
    seats: Sequence[Seat] = (),
) -> WalkableArea:
    """Add a place to a spec: ground, walls, furniture and lights. Returns its walkable area.

    Walls, pillars and everything else that is fixed has the same pose for every seed; loose furniture, posters and the
    goods on shelves are drawn from `rng`, the patches of light from `patch_rng` (by default the same for every seed).
    `seats` are those that people of the scenario sit on.
    """
    builder = PlaceBuilder(spec, rng, place.clutter, lights, patch_rng or np.random.default_rng(0))
    add_ground_plane(spec)
    add_seats(builder, seats)
    return _BUILDERS[place.kind](builder)
