"""Controllers: what a tracker says in, robot commands out. They never see the world or the truth."""

from pftrack_sim.controllers.base import Controller
from pftrack_sim.controllers.registry import describe, make, names
from pftrack_sim.controllers.servo import Servo
from pftrack_sim.controllers.still import Still

__all__ = ["Controller", "Servo", "Still", "describe", "make", "names"]
