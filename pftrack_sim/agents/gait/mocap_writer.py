"""Writes poses of people to the mocap bodies of a model."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.people.person import PARTS


class MocapWriter:
    """The mocap bodies of the people with these names, in the order of the poses."""

    def __init__(self, model: mujoco.MjModel, names: Sequence[str]) -> None:
        mocap_ids = [[model.body(f"{name}/{part}").mocapid[0] for part in PARTS] for name in names]
        self._mocap_ids = np.array(mocap_ids, dtype=np.intp)

    def write(self, data: mujoco.MjData, positions: FloatArray, quaternions: FloatArray) -> None:
        """Set `mocap_pos` and `mocap_quat` from `(P, 13, 3)` positions [m] and `(P, 13, 4)` quaternions w, x, y, z."""
        data.mocap_pos[self._mocap_ids] = positions
        data.mocap_quat[self._mocap_ids] = quaternions
