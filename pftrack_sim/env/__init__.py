"""Gymnasium environments, and the simulation under them."""

from pftrack_sim.env.spaces import BoundingBox
from pftrack_sim.env.tasks import FollowEnv, TrackAndFollowEnv, TrackEnv
from pftrack_sim.simulation.simulation import Simulation

__all__ = ["BoundingBox", "FollowEnv", "Simulation", "TrackAndFollowEnv", "TrackEnv"]
