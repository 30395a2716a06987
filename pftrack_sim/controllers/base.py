"""What every controller is."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.records import Estimate


@runtime_checkable
class Controller(Protocol):
    """An estimate and the robot's own senses in, a command out, once a frame."""

    def reset(self, image_size: tuple[int, int], fovy_rad: float | None = None) -> None:
        """Forget everything from before: an episode begins.

        Args:
            image_size: Width, height [px].
            fovy_rad: Vertical field of view, where the caller knows it; None keeps what the controller was made with.
        """
        ...

    def act(self, estimate: Estimate, proprio: NDArray[Any]) -> NDArray[np.float64]:
        """The command until the next frame.

        Args:
            estimate: What the tracker says of this frame.
            proprio: `(n,)` as `pftrack_sim.proprio.PROPRIO_NAMES` says.

        Returns:
            `(4,)` forward speed, turn rate, pan rate, tilt rate, in [-1, 1] of the robot's limits.
        """
        ...
