"""Reference trackers at both ends of the scale: the truth (`oracle`, `oracle-visible`) and the first box (`stay`).

Apart from `baselines`, so that they load neither OpenCV nor Numba.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import Field

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

    def receive_truth(self, box: Box, visible_fraction: float) -> None:
        """See `NeedsTruth.receive_truth`."""
        truth = np.array(box, dtype=np.float64)
        if truth.shape == (4,) and np.isfinite(truth).all() and boxes.area(truth) > 0.0:
            self._box = truth


class VisibleOracleParameters(Parameters):
    """Parameters of `oracle-visible`: the least visible fraction of the target at which it is seen."""

    least_visible: Annotated[float, Field(ge=0.0, le=1.0)] = 0.1


class VisibleOracle(Oracle):
    """Returns the ground truth while enough of the target is visible, else the last box as an occlusion.

    It sees no more than the camera does: what a robot does not reach with it, its controller or the scene prevents.
    """

    def __init__(self, params: VisibleOracleParameters) -> None:
        super().__init__()
        self.params = params
        self._hidden = False

    def receive_truth(self, box: Box, visible_fraction: float) -> None:
        """See `NeedsTruth.receive_truth`."""
        self._hidden = not visible_fraction >= self.params.least_visible
        if not self._hidden:
            super().receive_truth(box, visible_fraction)

    def _follow(self, image: Image) -> Estimate:
        return Estimate(self._box, confidence=0.0 if self._hidden else 1.0, occluded=self._hidden)


def make(name: str, *, seed: int, preset: str, **params: Any) -> Stay:
    """Make `oracle`, `oracle-visible` or `stay`, which use no random numbers."""
    if name == "oracle-visible":
        return VisibleOracle(VisibleOracleParameters.from_preset(name, preset, params))
    Parameters.from_preset(name, preset, params)
    return Oracle() if name == "oracle" else Stay()
