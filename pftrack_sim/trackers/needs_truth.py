"""The one door through which the truth may reach a tracker."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from pftrack_sim.core.boxes import Box


@runtime_checkable
class NeedsTruth(Protocol):
    """A tracker that is told the truth of each frame, before `init` and before every `update`.

    It exists for yardsticks such as `oracle`: whoever runs a tracker looks for this method and, where it is there,
    says what is true. A tracker without it never learns the truth.
    """

    def tell(self, box: Box) -> None:
        """Hear the target's true box in the frame about to come.

        Args:
            box: `(4,)` box [px]; NaN or of no area when the target is not in the image.
        """
        ...
