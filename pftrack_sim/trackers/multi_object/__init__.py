"""Multi-object trackers: detections in, boxes with identities out; and one person of theirs as a tracker."""

from pftrack_sim.trackers.multi_object.followed import FollowedPerson, MultiObjectTracker

__all__ = ["FollowedPerson", "MultiObjectTracker"]
