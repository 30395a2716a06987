"""The controller that does nothing: what following is worth is measured against it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.controllers.base import RobotParameters
from pftrack_sim.core.records import Estimate


class Still:
    """Stands still and looks ahead."""

    def reset(self, rig: RobotParameters) -> None:
        """Nothing to forget."""

    def act(self, estimate: Estimate, proprio: NDArray[Any]) -> NDArray[np.float64]:
        """`(4,)` zeros."""
        return np.zeros(4)
