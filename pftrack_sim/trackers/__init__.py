"""Trackers: pixels in, boxes out. Nothing here can see the truth, except `oracle`, which is told it.

    tracker = make("ko2012", seed=3)
    tracker.init(image, box)
    estimate = tracker.update(next_image)

Built so that a paper is a few lines: `filter` moves and weighs particles and knows no pixels, `appearance` compares
image regions and knows no filter, and one module per paper puts them together with its numbers in a frozen dataclass.

Whatever the tracker, `Estimate.confidence` means one thing: how similar what lies under the box is to the tracker's
model of the target, from 0 to 1, where 1 is identical. A tracker that measures no similarity reports 1 while it
has found the target, and 0 when it says it has not.
"""

from __future__ import annotations

from pftrack_sim.trackers.base import NeedsTruth
from pftrack_sim.trackers.registry import PRESETS, describe, make, names

__all__ = ["PRESETS", "NeedsTruth", "describe", "make", "names"]
