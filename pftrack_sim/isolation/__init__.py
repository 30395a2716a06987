"""A tracker in a process of its own, so that whatever it does hurts only itself."""

from pftrack_sim.isolation.answers import checked_answer
from pftrack_sim.isolation.tracker import IsolatedTracker, Limits, Misbehaviour

__all__ = ["IsolatedTracker", "Limits", "Misbehaviour", "checked_answer"]
