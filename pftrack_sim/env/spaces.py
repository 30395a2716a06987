"""A Gymnasium space for bounding boxes."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from pftrack_sim.core import boxes
from pftrack_sim.core.errors import BoxError


class BoundingBox(gym.spaces.Box):
    """All boxes x, y, w, h [px] with finite numbers and sizes >= 0; they may leave the image, samples do not.

    It is a `Box`, so that wrappers and vector environments take it: `low` and `high`, `(4,)` float64, are those of
    boxes whose corner lies in the image and that are not larger than it. `RescaleAction` maps to them, `ClipAction`
    clips to them.
    """

    def __init__(self, width_px: int, height_px: int, seed: int | np.random.Generator | None = None) -> None:
        high = np.array([width_px, height_px, width_px, height_px], dtype=np.float64)
        super().__init__(np.zeros(4), high, dtype=np.float64, seed=seed)
        self.width_px, self.height_px = width_px, height_px

    def sample(self, mask: None = None, probability: None = None) -> NDArray[np.float64]:
        """A random box with its corners inside the image, `(4,)` float64."""
        size = np.array([self.width_px, self.height_px], dtype=np.float64)
        corners = np.sort(self.np_random.uniform(0.0, 1.0, (2, 2)), axis=0) * size
        return np.concatenate([corners[0], corners[1] - corners[0]])

    def contains(self, x: Any) -> bool:
        """Whether `x` is a box."""
        try:
            boxes.checked(x)
        except BoxError:
            return False
        return True

    def __eq__(self, other: object) -> bool:
        return isinstance(other, BoundingBox) and self.width_px == other.width_px and self.height_px == other.height_px

    def __hash__(self) -> int:
        return hash((BoundingBox, self.width_px, self.height_px))

    def __repr__(self) -> str:
        return f"BoundingBox({self.width_px}, {self.height_px})"


@batch_space.register(BoundingBox)
def _batch(space: BoundingBox, n: int = 1) -> gym.spaces.Box:
    """Actions of a vector environment: `(n, 4)` numbers, whose samples are boxes."""
    return gym.spaces.Box(
        np.tile(space.low, (n, 1)), np.tile(space.high, (n, 1)), dtype=np.float64, seed=space.np_random
    )
