"""A MuJoCo scene with a robot, walking people, occluders and changing light."""

from pftrack_sim.world.world import World

__all__ = ["World"]
