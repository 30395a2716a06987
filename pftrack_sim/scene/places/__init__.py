"""The four places: `furnish` builds one into a spec."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from pftrack_sim.scenario.model import Lights, Place
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.places.corridor import build_corridor
from pftrack_sim.scene.places.plaza import build_plaza
from pftrack_sim.scene.places.stage import Stage
from pftrack_sim.scene.places.street import build_street
from pftrack_sim.scene.places.warehouse import build_warehouse

_BUILDERS: dict[str, Callable[[Stage, Lights], WalkableArea]] = {
    "plaza": build_plaza,
    "corridor": build_corridor,
    "warehouse": build_warehouse,
    "street": build_street,
}


def furnish(spec: mujoco.MjSpec, place: Place, lights: Lights, rng: np.random.Generator) -> WalkableArea:
    """Build a place into a spec: ground, walls, furniture and lights.

    Walls, pillars and everything else that is fixed stands where it stands for every seed; loose furniture, posters
    and what lies on shelves is drawn.

    Args:
        spec: The model under construction; gains bodies, meshes, materials, textures, lights and statistics.
        place: Which place, and how much loose furniture.
        lights: Where the sun stands and whether there are shadows.
        rng: Draws what varies.

    Returns:
        Where one can walk.

    Raises:
        PftrackError: A texture is missing from the installation.
    """
    stage = Stage(spec, rng, clutter=place.clutter, shadows=lights.shadows)
    stage.floor()
    return _BUILDERS[place.kind](stage, lights)
