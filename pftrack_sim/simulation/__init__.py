"""One episode: dry run, plan, compilation, and the loop that moves the world and takes frames."""

from pftrack_sim.simulation.simulation import Simulation

__all__ = ["Simulation"]
