"""The two ends of the scale: `oracle` is told the truth, `stay` never looks."""

from __future__ import annotations

from typing import Any

import numpy as np

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.params import check_names, check_preset
from pftrack_sim.trackers.registry import PRESETS


class Oracle(BaseTracker):
    """Says what it was told (`NeedsTruth`): the highest score there is.

    When the target is not in the image (a box that is NaN or has no area), it repeats the last box it knows.
    """

    def __init__(self) -> None:
        super().__init__()
        self._told: Box | None = None

    def receive_truth(self, box: Box) -> None:
        """Hear the target's true box in the frame about to come; `(4,)` [px], NaN or without area when not there."""
        truth = np.array(box, dtype=np.float64)
        if truth.shape == (4,) and np.isfinite(truth).all() and boxes.area(truth) > 0.0:
            self._told = truth

    def _start(self, image: Image, box: Box) -> None:
        self._told = box

    def _follow(self, image: Image) -> Estimate:
        assert self._told is not None
        return Estimate(self._told)


class Stay(BaseTracker):
    """Says the first box for ever: what a tracker must beat to be worth its time."""

    def __init__(self) -> None:
        super().__init__()
        self._box = boxes.NO_BOX

    def _start(self, image: Image, box: Box) -> None:
        self._box = box

    def _follow(self, image: Image) -> Estimate:
        return Estimate(self._box)


def make_oracle(*, seed: int, preset: str, **params: Any) -> Oracle:
    """Factory of `oracle`; it has no parameters, and nothing in it is random."""
    check_preset("oracle", PRESETS, preset)
    check_names("oracle", [], params)
    return Oracle()


def make_stay(*, seed: int, preset: str, **params: Any) -> Stay:
    """Factory of `stay`; it has no parameters, and nothing in it is random."""
    check_preset("stay", PRESETS, preset)
    check_names("stay", [], params)
    return Stay()
