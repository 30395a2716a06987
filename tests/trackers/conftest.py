"""Synthetic sequences with known boxes."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from tests.trackers.following import Scene


def draw_scene(count: int = 12, width: int = 120, height: int = 90, step_px: float = 2.0) -> Scene:
    """A coloured, textured target that walks over a cluttered background.

    Returns:
        Images `(H, W, 3)` uint8 RGB, read-only, and `(N, 4)` true boxes.
    """
    rng = np.random.default_rng(7)
    background = rng.integers(40, 110, (height // 6 + 1, width // 6 + 1, 3), dtype=np.uint8)
    background = cv2.resize(background, None, fx=6, fy=6, interpolation=cv2.INTER_CUBIC)[:height, :width]
    target = cv2.resize(rng.integers(90, 250, (8, 5, 3), dtype=np.uint8), (20, 32), interpolation=cv2.INTER_CUBIC)
    target[:, :, 2] //= 4
    images: list[np.ndarray] = []
    truth: list[tuple[float, ...]] = []
    for index in range(count):
        x, y = round(20 + step_px * index), round(25 + step_px * index / 3)
        image = background.copy()
        image[y : y + 32, x : x + 20] = target
        image.setflags(write=False)
        images.append(image)
        truth.append((x, y, 20, 32))
    return images, np.array(truth, dtype=np.float64)


@pytest.fixture
def make_scene() -> Callable[..., Scene]:
    return draw_scene


@pytest.fixture(scope="session")
def scene() -> Scene:
    return draw_scene()
