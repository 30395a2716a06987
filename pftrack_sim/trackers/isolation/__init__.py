"""Run a tracker in its own process, so that crashes, timeouts and memory leaks are isolated per tracker."""

from pftrack_sim.trackers.isolation.tracker import IsolatedTracker, Limits, TrackerFault, try_make

__all__ = ["IsolatedTracker", "Limits", "TrackerFault", "try_make"]
