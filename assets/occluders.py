"""Textures of static occluders: concrete, brick and crate wood."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]


def concrete(size_px: int = 256) -> Image:
    """`(size, size, 3)` one metre of concrete: blotches, grain, and the marks of its formwork."""
    rng = np.random.default_rng(11)
    grain = rng.normal(0.0, 5.0, (size_px, size_px))
    blotches = cv2.resize(rng.normal(0.0, 9.0, (12, 12)), (size_px, size_px), interpolation=cv2.INTER_CUBIC)
    runs = cv2.resize(rng.normal(0.0, 5.0, (2, 24)), (size_px, size_px), interpolation=cv2.INTER_CUBIC)
    level = 158.0 + grain + blotches + runs
    level[:2] -= 30.0
    level[size_px // 2 : size_px // 2 + 2] -= 18.0
    for row in (size_px // 4, 3 * size_px // 4):
        for column in (size_px // 4, 3 * size_px // 4):
            cv2.circle(level, (column, row), max(1, size_px // 60), 100.0, -1)
    return _tint(level, (1.0, 0.985, 0.95))


def brick(size_px: int = 256, courses: int = 8) -> Image:
    """`(size, size, 3)` one metre of brickwork in running bond; it tiles."""
    rng = np.random.default_rng(12)
    image = np.empty((size_px, size_px, 3))
    image[:] = (176.0, 168.0, 156.0)
    course, length, mortar = size_px // courses, size_px // 4, max(2, size_px // 90)
    for row in range(courses):
        offset = (row % 2) * length // 2
        for column in range(4):
            colour = np.array([150.0, 78.0, 58.0]) * rng.uniform(0.78, 1.15) + rng.normal(0.0, 5.0, 3)
            columns = (np.arange(column * length + mortar, (column + 1) * length) + offset) % size_px
            rows = np.arange(row * course + mortar, (row + 1) * course)
            image[np.ix_(rows, columns)] = colour
    image += rng.normal(0.0, 6.0, (size_px, size_px, 1))
    return np.clip(image, 0, 255).astype(np.uint8)


def crate(size_px: int = 128) -> Image:
    """`(size, size, 3)` one side of a wooden crate: boards, a frame and a brace."""
    rng = np.random.default_rng(13)
    streaks = cv2.resize(rng.normal(0.0, 10.0, (size_px, 5)), (size_px, size_px), interpolation=cv2.INTER_LINEAR)
    level = 150.0 + streaks
    board = size_px // 6
    for row in range(0, size_px, board):
        level[row : row + board] += rng.normal(0.0, 9.0)
        level[row : row + 2] = 70.0
    edge, frame = size_px // 8, size_px - 1
    brace = np.zeros((size_px, size_px), np.uint8)
    cv2.line(brace, (edge, frame - edge), (frame - edge, edge), 255, edge)
    for begin, end in (((0, 0), (frame, edge)), ((0, frame - edge), (frame, frame))):
        cv2.rectangle(brace, begin, end, 255, -1)
        cv2.rectangle(brace, begin[::-1], end[::-1], 255, -1)
    wood = 172.0 + cv2.resize(rng.normal(0.0, 9.0, (5, size_px)), (size_px, size_px), interpolation=cv2.INTER_LINEAR)
    level = np.where(brace > 0, wood, level)
    level[cv2.morphologyEx(brace, cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8)) > 0] = 85.0
    return _tint(level, (1.0, 0.8, 0.55))


def _tint(level: NDArray[np.float64], rgb: tuple[float, float, float]) -> Image:
    return np.clip(level[..., None] * np.array(rgb), 0, 255).astype(np.uint8)
