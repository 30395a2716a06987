"""Writes poses of people to the mocap bodies of a model."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from pftrack_sim.core.errors import UnknownNameError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.layout import owner_name
from pftrack_sim.scene.people.person import PARTS


class MocapWriter:
    """The mocap bodies of some people.

    Args:
        model: Compiled model.
        names: Names of the people, in the order of the poses.

    Raises:
        UnknownNameError: A person is not in the model.
    """

    def __init__(self, model: mujoco.MjModel, names: Sequence[str]) -> None:
        mocap_ids = {model.body(body).name: int(model.body_mocapid[body]) for body in range(model.nbody)}
        known = [owner_name(name) for name, mocap in mocap_ids.items() if mocap >= 0 and name.endswith(f"/{PARTS[0]}")]
        for name in names:
            if name not in known:
                raise UnknownNameError("person", name, known)
        self._ids = np.array([[mocap_ids[f"{name}/{part}"] for part in PARTS] for name in names], dtype=np.intp)

    def write(self, data: mujoco.MjData, positions: FloatArray, quaternions: FloatArray) -> None:
        """Set `mocap_pos` and `mocap_quat`.

        Args:
            data: State of the model.
            positions: `(P, 13, 3)` [m].
            quaternions: `(P, 13, 4)` w, x, y, z.
        """
        data.mocap_pos[self._ids] = positions
        data.mocap_quat[self._ids] = quaternions
