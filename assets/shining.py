"""The atlas of what shines at night: lit windows, neon signs, lamps."""

from __future__ import annotations

import cv2
import numpy as np
from brushes import Canvas, Colour, flat, grid, rectangle, shaded, text
from fronts import display
from parts import Cell, N


def _lit_window(rng: np.random.Generator, index: int) -> Canvas:
    tone = [(255, 214, 140), (255, 232, 182), (214, 226, 255), (255, 196, 120)][index % 4]
    image = shaded(flat(N, N, tone), 0.75, 1.0)
    if index % 2:
        for side in (0.0, 0.74):
            rectangle(image, side, 0.0, 0.26, 1.0, tuple(0.72 * c for c in tone))
    if index % 3 == 1:
        rectangle(image, 0.3, 0.55, 0.2, 0.45, tuple(0.3 * c for c in tone))
        cv2.circle(image, (52, 62), 9, tuple(0.3 * c for c in tone), -1, cv2.LINE_AA)
    if index % 3 == 2:
        rectangle(image, 0.1, 0.62, 0.8, 0.05, tuple(0.4 * c for c in tone))
    cv2.line(image, (64, 0), (64, N), tuple(0.3 * c for c in tone), 5)
    cv2.line(image, (0, 44), (N, 44), tuple(0.3 * c for c in tone), 4)
    cv2.rectangle(image, (0, 0), (N - 1, N - 1), tuple(0.25 * c for c in tone), 6)
    return image * float(rng.uniform(0.9, 1.0))


def _lit_display(rng: np.random.Generator) -> Canvas:
    warm = np.array((1.35, 1.12, 0.8), np.float32)
    image = np.clip(warm * display(rng, N, N) + shaded(flat(N, N, (60, 46, 24)), 1.0, 0.6), 0.0, 255.0)
    cv2.rectangle(image, (0, 0), (N - 1, N - 1), (40, 34, 30), 5)
    return image


def _neon(words: str, colour: Colour) -> Cell:
    def draw(rng: np.random.Generator) -> Canvas:
        image = flat(N, N, (14, 12, 18))
        glow = image.copy()
        (width, _), _ = cv2.getTextSize(words, cv2.FONT_HERSHEY_DUPLEX, 1.0, 2)
        text(glow, words, ((N - width) // 2, 76), 1.0, colour, 4)
        image = image + 0.9 * cv2.GaussianBlur(glow, (0, 0), 5)
        text(image, words, ((N - width) // 2, 76), 1.0, tuple(min(255.0, 60 + c) for c in colour), 2)
        cv2.rectangle(image, (8, 32), (N - 9, 96), colour, 2)
        return image * float(rng.uniform(0.98, 1.0))

    return draw


def glow(rng: np.random.Generator) -> Canvas:
    """4 x 4 cells of 128: lit windows (4), lit shop windows (4), neon signs (4), panels and bulbs (4)."""
    cells = [_lit_window(rng, index) for index in range(4)]
    cells += [_lit_display(rng) for _ in range(4)]
    signs = (("CAFE", (255, 90, 90)), ("HOTEL", (90, 200, 255)), ("OPEN", (120, 255, 140)), ("CINEMA", (255, 130, 240)))
    cells += [_neon(words, colour)(rng) for words, colour in signs]
    panel = flat(N, N, (250, 250, 244))
    for at in (0.25, 0.5, 0.75):
        rectangle(panel, 0.0, at - 0.012, 1.0, 0.024, (206, 206, 200))
    cv2.rectangle(panel, (0, 0), (N - 1, N - 1), (190, 190, 186), 6)
    cells += [panel, flat(N, N, (255, 216, 150)), flat(N, N, (250, 250, 250)), flat(N, N, (240, 60, 50))]
    return grid(cells, 4)
