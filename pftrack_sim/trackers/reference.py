"""Reference trackers at both ends of the scale: `oracle` (ground truth) and `stay` (first box).

Apart from `baselines`, so that they load neither OpenCV nor Numba.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.parameters import Parameters


class Stay(BaseTracker):
    """Returns the first box in every frame: the least score of a useful tracker."""

    def _start(self, image: Image, box: Box) -> None:
        self._box = box

    def _follow(self, image: Image) -> Estimate:
        return Estimate(self._box)


class Oracle(Stay):
    """Returns the ground truth (`NeedsTruth`): the highest possible score.

    While the target is not in the image (a box that is NaN or without area), the last valid box is repeated.
    """

    def receive_truth(self, box: Box) -> None:
        """See `NeedsTruth.receive_truth`."""
        truth = np.array(box, dtype=np.float64)
        if truth.shape == (4,) and np.isfinite(truth).all() and boxes.area(truth) > 0.0:
            self._box = truth


def make(name: str, *, seed: int, preset: str, **params: Any) -> Stay:
    """Make `oracle` or `stay`. They have no parameters and use no random numbers."""
    Parameters.from_preset(name, preset, params)
    return Oracle() if name == "oracle" else Stay()
