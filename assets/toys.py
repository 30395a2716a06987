"""The atlas of toys and things that hands carry: 4 x 2 cells of 128 px."""

from __future__ import annotations

import cv2
import numpy as np
from brushes import Canvas, Colour, cloud, flat, grid, rectangle, speckled, text

N = 128
_PANELS: tuple[Colour, ...] = ((206, 40, 44), (240, 236, 226), (30, 84, 170), (244, 200, 40))


def _beach_ball(rng: np.random.Generator) -> Canvas:
    image = np.hstack([flat(N, N // 8, _PANELS[panel % 4]) for panel in range(8)])
    image[:10] = image[-10:] = (240, 236, 226)
    return image * (0.94 + 0.08 * cloud(rng, N, N, 1.6))[..., None]


def _football(rng: np.random.Generator) -> Canvas:
    image = speckled(rng, N, N, (232, 232, 226), 0.1, 1.4)
    for row, (y, count) in enumerate(((16, 2), (48, 4), (80, 4), (112, 2))):
        for column in range(count):
            x = int((column + 0.25 + 0.5 * (row % 2)) * N / count)
            angles = 2.0 * np.pi * np.arange(5) / 5
            points = np.stack([x + 11 * np.sin(angles), y - 11 * np.cos(angles)], axis=1)
            cv2.fillPoly(image, [points.astype(np.int32)], (30, 30, 34), cv2.LINE_AA)
    return image


def _juice(front: bool) -> Canvas:
    image = flat(N, N, (236, 122, 26))
    rectangle(image, 0.0, 0.0, 1.0, 0.16, (40, 120, 60))
    if front:
        text(image, "JUICE", (14, 48), 0.95, (250, 246, 232))
        for x, y in ((46, 88), (84, 82), (66, 104)):
            cv2.circle(image, (x, y), 19, (250, 196, 40), -1, cv2.LINE_AA)
            cv2.circle(image, (x - 5, y - 6), 5, (254, 232, 150), -1, cv2.LINE_AA)
            cv2.ellipse(image, (x + 12, y - 18), (10, 4), -30, 0, 360, (52, 140, 60), -1, cv2.LINE_AA)
    else:
        rectangle(image, 0.14, 0.26, 0.72, 0.5, (246, 240, 222))
        for line in range(7):
            rectangle(image, 0.2, 0.31 + 0.06 * line, 0.6 - 0.1 * (line % 3), 0.02, (70, 66, 60))
        for bar in range(12):
            rectangle(image, 0.2 + 0.05 * bar, 0.82, 0.02 if bar % 3 else 0.035, 0.12, (24, 24, 24))
    return image


def _letter(letter: str, ground: Colour, ink: Colour) -> Canvas:
    image = flat(N, N, ink)
    rectangle(image, 0.08, 0.08, 0.84, 0.84, ground)
    text(image, letter, (32, 98), 3.0, ink, 7)
    return image


def toys(rng: np.random.Generator) -> Canvas:
    """4 x 2 cells of 128, in the order of the atlas `toys`."""
    cells = [
        _beach_ball(rng),
        _football(rng),
        _juice(front=True),
        _juice(front=False),
        _letter("A", (244, 214, 60), (190, 36, 40)),
        _letter("B", (120, 190, 230), (24, 60, 140)),
        _letter("C", (168, 214, 110), (24, 100, 52)),
        speckled(rng, N, N, (226, 222, 212), 0.5, 0.9),
    ]
    return grid(cells, 4)
