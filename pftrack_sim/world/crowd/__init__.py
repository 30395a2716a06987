"""Where people walk: the target on its script, strangers about their business, and walkers who cross on request."""

from pftrack_sim.world.crowd.crossing import Crossing
from pftrack_sim.world.crowd.crowd import Crowd
from pftrack_sim.world.crowd.ground import Ground
from pftrack_sim.world.crowd.passing import Passing, away_from, plan_passing
from pftrack_sim.world.crowd.routes import Routes

__all__ = ["Crossing", "Crowd", "Ground", "Passing", "Routes", "away_from", "plan_passing"]
