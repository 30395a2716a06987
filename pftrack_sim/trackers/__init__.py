"""Trackers: images in, boxes out. No tracker gets the ground truth, except those that implement `NeedsTruth`.

    tracker = make("ko2012", seed=3)
    tracker.init(image, box)
    estimate = tracker.update(next_image)

A multi-object tracker has `update(detections, image) -> TrackedBoxes`; `FollowedPerson` makes it a tracker of one.

`filters` holds particle filters without any knowledge of images, `features` appearance models without any knowledge of
filters; one module per paper combines them and holds its parameters.

`Estimate.confidence` is the similarity between the estimated box and the tracker's model of the target, from 0 to 1
(identical). Trackers that measure no similarity report 1, and 0 in frames where they report a loss. With the parameter
`recognition` it is that of a memory of how the target looked at first, on one scale for all.
"""

from __future__ import annotations

from pftrack_sim.core.records import Estimate, TrackedBoxes
from pftrack_sim.trackers.base import PRESETS, NeedsDetections, NeedsTruth
from pftrack_sim.trackers.multi_object.followed import FollowedPerson, MultiObjectTracker
from pftrack_sim.trackers.registry import code_digest, describe, factory, is_builtin, make, names

__all__ = [
    "PRESETS",
    "Estimate",
    "FollowedPerson",
    "MultiObjectTracker",
    "NeedsDetections",
    "NeedsTruth",
    "TrackedBoxes",
    "code_digest",
    "describe",
    "factory",
    "is_builtin",
    "make",
    "names",
]
