"""People: bodies of natural proportions, clothes, and a gait whose feet stay where they stand."""

from pftrack_sim.world.people.body import Person, add_person
from pftrack_sim.world.people.cast import sample_cast
from pftrack_sim.world.people.gait import Gait
from pftrack_sim.world.people.posing import Puppets

__all__ = ["Gait", "Person", "Puppets", "add_person", "sample_cast"]
