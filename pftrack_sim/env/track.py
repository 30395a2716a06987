"""`Track-v0`: locate the target while the robot follows its script."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from pftrack_sim.core import boxes
from pftrack_sim.core.records import Estimate
from pftrack_sim.env.base import CameraEnv, Observation
from pftrack_sim.env.spaces import BoundingBox


class TrackEnv(CameraEnv):
    """Track from a moving camera; the robot follows the scenario's script.

    Action: `(4,)` box x, y, w, h [px] of the target in the frame of the observation. Boxes may leave the image.

    Reward: overlap (intersection over union) of that box with the amodal box of the target in that frame, clipped to
    the image (Ko et al. 2012, eq. 14); 0 while the target is out of view.

    Information: `truth` and `people` of the frame in the observation; after a step also `overlap` (the reward) and
    `scored` of the frame that was answered: whether the target could be seen, so that the frame counts in a mean.

    End: truncated after the scenario's duration; never terminated.

    Raises:
        BoxError: An invalid box: NaN, infinite, a negative size, or not of shape (4,).
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.action_space = BoundingBox(*self.image_size_px)

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Score the box on the frame shown and return the next frame."""
        answer = Estimate(boxes.checked(action, what="action"))
        shown = self._current
        reward = boxes.iou(shown.truth.box, answer.box)
        frame = self._advance(None, answer)
        info = {**self._info(frame), "overlap": reward, "scored": shown.truth.scored}
        return self._observation(frame), reward, False, self._over, info
