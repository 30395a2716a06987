"""The robot's range finder: a fan of beams at the height of the hull, all to the front."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.proprioception import RANGE_ANGLES_RAD, RANGE_M
from pftrack_sim.scene.layout import HIDDEN_GROUP
from pftrack_sim.scene.robot import BASE

HEIGHT_M = 0.2
"""Of the beams above the ground, with the robot at rest: shins of people, and everything that stands on the ground."""


class RangeFinder:
    """Measures distances from the middle of the axle to what the robot would bump into.

    The beams meet the shapes that collide, not those that are drawn, so a table is as wide for them as for the hull.
    They are fixed to the chassis: on a robot that nods they may meet the ground. They pass through the robot itself.

    Args:
        model: Has the robot.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._base = model.body(BASE).id
        self._beams = np.stack(
            [np.cos(RANGE_ANGLES_RAD), np.sin(RANGE_ANGLES_RAD), np.zeros_like(RANGE_ANGLES_RAD)], axis=1
        )
        self._groups = np.zeros(6, dtype=np.uint8)
        self._groups[HIDDEN_GROUP] = 1
        self._met = np.empty(len(self._beams), dtype=np.int32)

    def look(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """`(37,)` ranges [m] along `proprio.RANGE_ANGLES_RAD`, at most `RANGE_M`.

        Args:
            data: Its poses of geoms must be up to date.
        """
        rotation = data.xmat[self._base].reshape(3, 3)
        eye = data.xpos[self._base] + HEIGHT_M * rotation[:, 2]
        ranges = np.empty(len(self._beams))
        mujoco.mj_multiRay(
            self._model,
            data,
            eye,
            (self._beams @ rotation.T).ravel(),
            self._groups,
            True,
            self._base,
            self._met,
            ranges,
            None,
            len(ranges),
            RANGE_M,
        )
        # Without a hit the range is -1.
        return np.where(ranges < 0.0, RANGE_M, np.minimum(ranges, RANGE_M))
