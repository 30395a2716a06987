"""A tracker in a process of its own, so that whatever it does hurts only itself."""

from pftrack_sim.trackers.isolation.answers import checked_answer
from pftrack_sim.trackers.isolation.tracker import IsolatedTracker, Limits, TrackerFault

__all__ = ["IsolatedTracker", "Limits", "TrackerFault", "checked_answer"]
