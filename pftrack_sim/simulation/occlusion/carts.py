"""Carts that drive themselves between camera and target: a cabinet as tall as people, and a low one.

A thing that stands cannot cover someone whom the robot follows straight behind; one that rolls along with the line of
sight covers anyone, anywhere, for as long as asked.
"""

from __future__ import annotations

import numpy as np

from pftrack_sim.agents.pedestrians.occlusion_trajectory import Crossing
from pftrack_sim.scenario.axes import OcclusionAxis
from pftrack_sim.scenario.model import Occluder
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.occluders.carts import HALF_THICKNESS_M, cart_names
from pftrack_sim.simulation.dry_run import DryRun
from pftrack_sim.simulation.occlusion.crossing import Mover, plan_walker

EDGE_M_S = 1.3
"""Speed of an edge across the line of sight: the target is covered and uncovered in about a quarter of a second."""

PERSON_EDGE_M_S = 1.1

HALF_WIDTH_M = (0.27, 0.36)
"""Narrowest and widest cart: at half way from camera to target, each covers a walking person's stride."""

TALL_M = 2.1
_LEAST_TALL_M = 0.4

_HEIGHTS = np.linspace(0.0, 1.0, 11)
_AREA_BELOW_SIDE = np.array([0.0, 0.118, 0.217, 0.324, 0.439, 0.568, 0.670, 0.768, 0.851, 0.940, 1.0])
_AREA_BELOW_BACK = np.array([0.0, 0.063, 0.131, 0.211, 0.305, 0.439, 0.592, 0.748, 0.898, 0.952, 1.0])
"""Share of a walking person's silhouette below a share of their stature, seen from the side and from behind: means
over several people and a stride, rendered. Striding legs show more of themselves from the side."""


def half_width_m(duration_s: float) -> float:
    """Half width of a cart that covers the line of sight for so long: the shorter, the narrower."""
    return float(np.clip(0.5 * EDGE_M_S * duration_s, *HALF_WIDTH_M))


def plan_axis_crossing(
    axis: OcclusionAxis, asked: Occluder, rehearsal: DryRun, layout: WalkableArea, name: str, depths: tuple[float, ...]
) -> Crossing:
    """How a cart or a person crosses for an axis.

    Args:
        axis: What is asked of all.
        asked: What is asked of this one.
        rehearsal: Where camera and target will be.
        layout: What stands there.
        name: What to call it in an error.
        depths: Depths to try, relative to what is asked.

    Raises:
        ParameterError: It cannot be done.
    """
    person = Mover("person", PERSON_EDGE_M_S, 0.22, 0.42, 0.2, depths)
    cart = Mover(
        "cart",
        EDGE_M_S,
        half_width_m(asked.duration_s),
        0.42,
        HALF_THICKNESS_M + 0.02,
        depths,
        (1.3, 0.9, 1.9, 0.65, 2.6),
    )
    return plan_walker(asked, rehearsal, layout, name, cart if cart_names(axis) else person)


def cart_height_m(axis: OcclusionAxis, crossing: Crossing, rehearsal: DryRun) -> float:
    """How tall a cart must be to cover the share asked for, half way through its time."""
    if axis.kind == "pillar":
        return TALL_M
    camera, target = rehearsal.at(crossing.at_s + 0.5 * crossing.duration_s)
    distance = float(np.hypot(*(target[0] - camera[0, :2])))
    _, ends = rehearsal.at([crossing.at_s, crossing.at_s + crossing.duration_s])
    walked, sight = ends[1] - ends[0], target[0] - camera[0, :2]
    lengths = float(np.hypot(*walked) * np.hypot(*sight))
    along = float((walked @ sight) ** 2 / lengths**2) if lengths > 1e-6 else 0.5
    below = along * _AREA_BELOW_BACK + (1.0 - along) * _AREA_BELOW_SIDE
    top = float(np.interp(axis.share, below, _HEIGHTS)) * rehearsal.target_height_m
    middle = min(max(crossing.depth * distance, 0.75), distance - 0.65)
    # The sight of that point passes over the cart at its front or at its back: the lower of the two decides.
    faces = (middle - HALF_THICKNESS_M, middle + HALF_THICKNESS_M)
    camera_z = float(camera[0, 2])
    return max(min(camera_z + (top - camera_z) * face / distance for face in faces), _LEAST_TALL_M)
