"""Controllers: estimates of a tracker in, robot commands out. They get neither the world nor the ground truth."""

from pftrack_sim.controllers.base import Controller, RobotParameters
from pftrack_sim.controllers.registry import describe, make, names

__all__ = ["Controller", "RobotParameters", "describe", "make", "names"]
