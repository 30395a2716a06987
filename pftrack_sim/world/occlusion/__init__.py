"""Things that come between the camera and the target when asked for, and for as long as asked."""

from pftrack_sim.world.occlusion.bodies import add_occluders, occluder_names, place
from pftrack_sim.world.occlusion.carts import add_carts
from pftrack_sim.world.occlusion.placement import Placement, plan_static
from pftrack_sim.world.occlusion.rehearsal import Rehearsal
from pftrack_sim.world.occlusion.sight import covered_by_box, covered_by_person, spans
from pftrack_sim.world.occlusion.walker import plan_walker

__all__ = [
    "Placement",
    "Rehearsal",
    "add_carts",
    "add_occluders",
    "covered_by_box",
    "covered_by_person",
    "occluder_names",
    "place",
    "plan_static",
    "plan_walker",
    "spans",
]
