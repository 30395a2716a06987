"""A controller of your own in twenty lines: turn towards the box, drive while it is small.

PYTHONPATH=examples pftrack-sim follow follow/plaza --controllers my_controller:Towards,servo
"""

from typing import Any

import numpy as np

from pftrack_sim.controllers import RobotParameters
from pftrack_sim.trackers import Estimate


class Towards:
    """Needs no model of the robot: two gains, on where the box is and how high."""

    def __init__(self, *, turn: float = 1.5, drive: float = 4.0) -> None:
        self._turn, self._drive = turn, drive

    def reset(self, robot: RobotParameters) -> None:
        """An episode begins: how high a person of 1.72 m is in the image at the wanted distance."""
        self._size = np.array(robot.image_size)
        self._height_px = 1.72 * robot.focal_px / robot.distance_m

    def act(self, estimate: Estimate, proprio: Any) -> Any:
        """Forward, turn, pan, tilt, in [-1, 1]; a left turn is positive."""
        x, _, w, h = estimate.box
        if w <= 0.0 or h <= 0.0:
            return np.zeros(4)
        aside = 1.0 - (2.0 * x + w) / self._size[0]
        return np.clip([self._drive * (1.0 - h / self._height_px), self._turn * aside, 0.0, 0.0], -1.0, 1.0)
