"""Controllers: estimates of a tracker in, robot commands out. They get neither the world nor the ground truth."""

from pftrack_sim.controllers.base import Controller, RobotParameters
from pftrack_sim.controllers.registry import code_digest, describe, make, names

__all__ = ["Controller", "RobotParameters", "code_digest", "describe", "make", "names"]
