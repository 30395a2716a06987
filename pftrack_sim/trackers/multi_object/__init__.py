"""Multi-object trackers: detections in, boxes with identities out; and one person of theirs as a tracker."""
