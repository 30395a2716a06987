"""A Gymnasium space for bounding boxes.

`gymnasium.spaces.Box` bounds each number separately, so most of its samples are no boxes of the image, and it wants
actions normalised to [-1, 1]. This space contains every valid box and samples boxes inside the image.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from pftrack_sim.core import boxes
from pftrack_sim.core.errors import BoxError


class BoundingBox(gym.Space[NDArray[np.float64]]):
    """All boxes x, y, w, h [px] with finite numbers and sizes >= 0; they may leave the image.

    Args:
        width_px: Image width; `sample` stays inside.
        height_px: Image height.
        seed: Seed of `sample`.
    """

    def __init__(self, width_px: int, height_px: int, seed: int | np.random.Generator | None = None) -> None:
        super().__init__(shape=(4,), dtype=np.float64, seed=seed)
        self.width_px = width_px
        self.height_px = height_px

    @property
    def is_np_flattenable(self) -> bool:
        """Boxes are flat already, but unbounded: wrappers that need bounds cannot flatten them."""
        return False

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

    def to_jsonable(self, sample_n: Iterable[NDArray[np.float64]]) -> list[list[float]]:
        """Boxes as lists."""
        return [np.asarray(box).tolist() for box in sample_n]

    def from_jsonable(self, sample_n: list[Any]) -> list[NDArray[np.float64]]:
        """Lists as boxes."""
        return [np.asarray(box, dtype=np.float64) for box in sample_n]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, BoundingBox) and self.width_px == other.width_px and self.height_px == other.height_px

    def __hash__(self) -> int:
        return hash((BoundingBox, self.width_px, self.height_px))

    def __repr__(self) -> str:
        return f"BoundingBox({self.width_px}, {self.height_px})"


@batch_space.register(BoundingBox)
def _batch(space: BoundingBox, n: int = 1) -> gym.spaces.Box:
    """Actions of a vector environment: `(n, 4)` numbers, so that an array of boxes can be passed."""
    return gym.spaces.Box(-np.inf, np.inf, (n, 4), np.float64, seed=space.np_random)
