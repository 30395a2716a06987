"""Controllers: what a tracker says in, robot commands out. They never see the world or the truth."""

from pftrack_sim.controllers.avoiding import Avoiding
from pftrack_sim.controllers.base import Controller, RobotParameters
from pftrack_sim.controllers.registry import describe, make, names
from pftrack_sim.controllers.searching import Searching
from pftrack_sim.controllers.servo import Servo
from pftrack_sim.controllers.still import Still

__all__ = ["Avoiding", "Controller", "RobotParameters", "Searching", "Servo", "Still", "describe", "make", "names"]
