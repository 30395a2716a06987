"""Run a tracker in its own process, so that crashes, timeouts and memory leaks are isolated per tracker."""

from pftrack_sim.trackers.isolation.process import Limits, TrackerCode, TrackerFault, TrackerProcesses
from pftrack_sim.trackers.isolation.tracker import IsolatedTracker, try_make

__all__ = ["IsolatedTracker", "Limits", "TrackerCode", "TrackerFault", "TrackerProcesses", "try_make"]
