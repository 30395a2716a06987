"""The four places: plaza, corridor, warehouse and street."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from pftrack_sim.scenario.model import Lights, Place
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.places.builder import PlaceBuilder, add_ground_plane
from pftrack_sim.scene.places.corridor import build_corridor
from pftrack_sim.scene.places.plaza import build_plaza
from pftrack_sim.scene.places.street import build_street
from pftrack_sim.scene.places.warehouse import build_warehouse

_BUILDERS: dict[str, Callable[[PlaceBuilder, Lights], WalkableArea]] = {
    "plaza": build_plaza,
    "corridor": build_corridor,
    "warehouse": build_warehouse,
    "street": build_street,
}


def add_place(
    spec: mujoco.MjSpec,
    place: Place,
    lights: Lights,
    rng: np.random.Generator,
    patch_rng: np.random.Generator | None = None,
) -> WalkableArea:
    """Add a place to a spec: ground, walls, furniture and lights. Returns its walkable area.

    Walls, pillars and everything else that is fixed has the same pose for every seed; loose furniture, posters and the
    goods on shelves are drawn from `rng`, the patches of light from `patch_rng` (by default the same for every seed).
    """
    builder = PlaceBuilder(spec, rng, place.clutter, lights, patch_rng or np.random.default_rng(0))
    add_ground_plane(spec)
    return _BUILDERS[place.kind](builder, lights)
