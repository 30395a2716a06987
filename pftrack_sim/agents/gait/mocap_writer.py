"""From a gait to a model's mocap bodies."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.errors import UnknownNameError
from pftrack_sim.scene.layout import owner_name
from pftrack_sim.scene.people.person import PARTS


class MocapWriter:
    """The mocap bodies of some people.

    Args:
        model: Compiled model that has them.
        names: The people, in the order in which poses will come.

    Raises:
        UnknownNameError: Someone is not in the model.
    """

    def __init__(self, model: mujoco.MjModel, names: Sequence[str]) -> None:
        there = {model.body(index).name: int(model.body_mocapid[index]) for index in range(model.nbody)}
        known = {owner_name(name) for name, mocap in there.items() if mocap >= 0 and name.endswith(f"/{PARTS[0]}")}
        for name in names:
            if name not in known:
                raise UnknownNameError("person", name, known)
        self._ids = np.array([[there[f"{name}/{part}"] for part in PARTS] for name in names], dtype=np.intp)

    def write(self, data: mujoco.MjData, positions: NDArray[np.float64], quaternions: NDArray[np.float64]) -> None:
        """Put everyone in place.

        Args:
            data: Its `mocap_pos` and `mocap_quat` are set.
            positions: `(P, 13, 3)` [m].
            quaternions: `(P, 13, 4)` w, x, y, z.
        """
        data.mocap_pos[self._ids] = positions
        data.mocap_quat[self._ids] = quaternions
