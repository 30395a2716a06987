"""The atlas of small surfaces that furniture and vehicles are made of: 8 x 8 cells of 128 px."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from brushes import Canvas, Colour, cloud, flat, grid, hue_of, rectangle, shaded, speckled, text, wood

Cell = Callable[[np.random.Generator], Canvas]
N = 128


def _paint(colour: Colour, contrast: float = 0.16) -> Cell:
    return lambda rng: speckled(rng, N, N, colour, contrast, 1.3)


def _wood(colour: Colour, boards: int = 1) -> Cell:
    return lambda rng: wood(rng, N, N, colour, boards)


def _leaves(colour: Colour, dots: Colour | None = None) -> Cell:
    def draw(rng: np.random.Generator) -> Canvas:
        image = flat(N, N, tuple(0.42 * c for c in colour))
        for _ in range(900):
            x, y = rng.integers(0, N, 2).tolist()
            tone = float(rng.uniform(0.55, 1.35))
            shade = tuple(min(255.0, tone * c) for c in colour)
            axes = (int(rng.integers(2, 6)), int(rng.integers(1, 3)))
            cv2.ellipse(image, (x, y), axes, float(rng.uniform(0, 180)), 0, 360, shade, -1, cv2.LINE_AA)
        for _ in range(0 if dots is None else 90):
            x, y = rng.integers(3, N - 3, 2).tolist()
            cv2.circle(image, (x, y), int(rng.integers(2, 5)), dots or colour, -1, cv2.LINE_AA)
        return image

    return draw


def _stripes(first: Colour, second: Colour, count: int, diagonal: bool = False) -> Cell:
    def draw(rng: np.random.Generator) -> Canvas:
        x, y = np.meshgrid(np.arange(N), np.arange(N))
        phase = (x + (y if diagonal else 0)) * count // N % 2
        image = np.where(phase[..., None] == 0, np.array(first, np.float32), np.array(second, np.float32))
        return image.astype(np.float32) * (0.88 + 0.2 * cloud(rng, N, N, 1.3))[..., None]

    return draw


def _carton(colour: Colour, mark: str) -> Cell:
    def draw(rng: np.random.Generator) -> Canvas:
        image = speckled(rng, N, N, colour, 0.2, 1.3)
        image[::3] *= 0.975
        ink = tuple(0.35 * c for c in colour)
        image[:, 56:72] = 0.6 * image[:, 56:72] + 0.4 * np.array([214, 196, 156], np.float32)
        if mark == "label":
            rectangle(image, 0.56, 0.5, 0.36, 0.34, (238, 236, 228))
            for row in range(4):
                rectangle(image, 0.6, 0.54 + 0.05 * row, float(rng.uniform(0.12, 0.28)), 0.022, (60, 60, 60))
            for bar in range(10):
                rectangle(image, 0.6 + 0.028 * bar, 0.74, float(rng.uniform(0.006, 0.02)), 0.08, (30, 30, 30))
        elif mark == "arrows":
            for x in (24, 92):
                cv2.arrowedLine(image, (x, 104), (x, 68), ink, 5, tipLength=0.45)
            cv2.rectangle(image, (10, 60), (118, 112), ink, 2)
        elif mark == "fragile":
            rectangle(image, 0.08, 0.55, 0.84, 0.26, (186, 44, 36))
            text(image, "FRAGILE", (14, 94), 0.75, (250, 246, 236))
        elif mark == "logo":
            cv2.circle(image, (38, 84), 22, (36, 84, 150), -1, cv2.LINE_AA)
            cv2.circle(image, (38, 84), 11, colour, -1, cv2.LINE_AA)
            text(image, "NORD", (64, 94), 0.65, (36, 84, 150))
        cv2.rectangle(image, (0, 0), (N - 1, N - 1), tuple(0.6 * c for c in colour), 2)
        return image

    return draw


def _wheel(rng: np.random.Generator) -> Canvas:
    image = flat(N, N, (22, 22, 24))
    cv2.circle(image, (64, 64), 42, (150, 152, 156), -1, cv2.LINE_AA)
    for spoke in range(5):
        turn = 2 * np.pi * spoke / 5 + 0.3
        at = (int(64 + 27 * np.cos(turn)), int(64 + 27 * np.sin(turn)))
        cv2.circle(image, at, 9, (40, 40, 44), -1, cv2.LINE_AA)
    cv2.circle(image, (64, 64), 8, (90, 92, 96), -1, cv2.LINE_AA)
    return image * float(rng.uniform(0.98, 1.0))


def _side_glass(rng: np.random.Generator) -> Canvas:
    image = shaded(flat(N, N, (70, 86, 96)), 1.35, 0.55)
    rectangle(image, 0.47, 0.0, 0.06, 1.0, (24, 26, 30))
    cv2.rectangle(image, (0, 0), (N - 1, N - 1), (24, 26, 30), 5)
    return image + 4.0 * float(rng.random())


def _front_glass(rng: np.random.Generator) -> Canvas:
    image = shaded(flat(N, N, (78, 96, 108)), 1.4, 0.5)
    cv2.rectangle(image, (0, 0), (N - 1, N - 1), (24, 26, 30), 6)
    return image + 4.0 * float(rng.random())


def _nose(lamp: Colour) -> Cell:
    """The front or back of a car below the glass: grille, lamps and plate, on neutral paint."""

    def draw(rng: np.random.Generator) -> Canvas:
        image = speckled(rng, N, N, (70, 74, 80), 0.1, 1.2)
        rectangle(image, 0.26, 0.36, 0.48, 0.26, (26, 28, 30))
        for row in range(4):
            rectangle(image, 0.28, 0.39 + 0.06 * row, 0.44, 0.02, (120, 122, 126))
        for x in (0.03, 0.77):
            rectangle(image, x, 0.28, 0.2, 0.22, lamp)
        rectangle(image, 0.34, 0.68, 0.32, 0.14, (236, 236, 226))
        text(image, "PF-20", (47, 101), 0.4, (20, 20, 30), 1)
        return image

    return draw


def _fins(colour: Colour) -> Cell:
    def draw(rng: np.random.Generator) -> Canvas:
        x = np.arange(N)
        image = flat(N, N, colour) * (0.72 + 0.34 * np.abs(np.sin(np.pi * x / 10.7)))[None, :, None]
        rectangle(image, 0, 0, 1, 0.05, tuple(1.05 * c for c in colour))
        return image.astype(np.float32) * float(rng.uniform(0.99, 1.0))

    return draw


def _spines(rng: np.random.Generator) -> Canvas:
    image = flat(N, N, (58, 44, 34))
    for shelf in range(3):
        base = 42 * (shelf + 1)
        x = 2
        while x < N - 6:
            w, h = int(rng.integers(4, 10)), int(rng.integers(26, 37))
            colour = hue_of(float(rng.uniform(0, 180)), float(rng.uniform(60, 200)), float(rng.uniform(80, 230)))
            cv2.rectangle(image, (x, base - h), (x + w - 1, base), colour, -1)
            x += w
        cv2.line(image, (0, base + 1), (N, base + 1), (120, 88, 58), 3)
    return image


def _magazines(rng: np.random.Generator) -> Canvas:
    image = flat(N, N, (60, 62, 66))
    for row in range(4):
        for column in range(5):
            colour = hue_of(float(rng.uniform(0, 180)), 170, float(rng.uniform(120, 240)))
            rectangle(image, 0.02 + 0.195 * column, 0.03 + 0.245 * row, 0.17, 0.2, colour)
            rectangle(image, 0.02 + 0.195 * column, 0.03 + 0.245 * row, 0.17, 0.05, (246, 244, 238))
    return image


def _clock(rng: np.random.Generator) -> Canvas:
    image = flat(N, N, (40, 42, 46))
    cv2.circle(image, (64, 64), 58, (240, 238, 230), -1, cv2.LINE_AA)
    for hour in range(12):
        turn = 2 * np.pi * hour / 12
        ends = [(int(64 + r * np.cos(turn)), int(64 + r * np.sin(turn))) for r in (44, 54)]
        cv2.line(image, ends[0], ends[1], (20, 20, 20), 4)
    cv2.line(image, (64, 64), (64, 26), (20, 20, 20), 4, cv2.LINE_AA)
    cv2.line(image, (64, 64), (90, 76), (20, 20, 20), 5, cv2.LINE_AA)
    return image * float(rng.uniform(0.99, 1.0))


def _door(colour: Colour, window: bool) -> Cell:
    """A door leaf with two panels or a window; drawn wide, hung 0.95 m x 2.05 m."""

    def draw(rng: np.random.Generator) -> Canvas:
        image = wood(rng, N, N, colour).transpose(1, 0, 2).copy()
        dark, light = tuple(0.6 * c for c in colour), tuple(min(255.0, 1.2 * c) for c in colour)
        for y, h in ((0.08, 0.4), (0.56, 0.36)):
            rectangle(image, 0.14, y, 0.72, h, dark, 3)
            rectangle(image, 0.16, y + 0.02, 0.68, h - 0.04, light, 1)
        if window:
            rectangle(image, 0.22, 0.1, 0.56, 0.3, (60, 66, 66))
            rectangle(image, 0.24, 0.11, 0.52, 0.28, (150, 170, 172))
            cv2.line(image, (40, 48), (86, 16), (190, 206, 206), 4, cv2.LINE_AA)
        rectangle(image, 0.06, 0.97, 0.9, 0.03, dark)
        rectangle(image, 0.82, 0.5, 0.1, 0.03, (220, 214, 196))
        rectangle(image, 0.84, 0.46, 0.05, 0.12, (196, 190, 172), 2)
        return image

    return draw


def _fruit(rng: np.random.Generator) -> Canvas:
    image = flat(N, N, (84, 62, 40))
    for column, hue in enumerate((4, 14, 24, 52, 168)):
        for _ in range(40):
            x, y = int(rng.integers(column * 25 + 3, column * 25 + 24)), int(rng.integers(4, 124))
            cv2.circle(image, (x, y), 6, hue_of(hue, 210, float(rng.uniform(150, 235))), -1, cv2.LINE_AA)
            cv2.circle(image, (x - 2, y - 2), 1, (250, 250, 240), -1)
    return image


def _sign(words: str, back: Colour, ink: Colour, scale: float) -> Cell:
    def draw(rng: np.random.Generator) -> Canvas:
        image = speckled(rng, N, N, back, 0.06, 1.2)
        (width, _), _ = cv2.getTextSize(words, cv2.FONT_HERSHEY_DUPLEX, scale, 2)
        text(image, words, ((N - width) // 2, 64 + int(11 * scale)), scale, ink)
        cv2.rectangle(image, (3, 3), (N - 4, N - 4), ink, 3)
        return image

    return draw


def _slats(rng: np.random.Generator) -> Canvas:
    image = wood(rng, N, N, (176, 138, 88), 5)
    for row in range(5):
        image[row * 25 + 18 : row * 25 + 25] = (40, 30, 22)
    return image


def _wrapped(rng: np.random.Generator) -> Canvas:
    image = _carton((150, 140, 130), "label")(rng)
    x, y = np.meshgrid(np.arange(N), np.arange(N))
    sheen = 0.5 + 0.5 * np.sin((x * 0.6 + y) * 0.22 + 5.0 * cloud(rng, N, N, 1.5))
    return 0.72 * image + 70.0 * (sheen**3)[..., None]


# The order is the order of cells in pftrack_sim/scene/places/materials.py.
PARTS: tuple[tuple[str, Cell], ...] = (
    ("wood-light", _wood((190, 150, 100), 4)),
    ("wood-dark", _wood((104, 70, 44), 3)),
    ("wood-green", _wood((58, 92, 66), 4)),
    ("wood-plain", _wood((150, 108, 66))),
    ("steel", _paint((138, 142, 148))),
    ("steel-dark", _paint((58, 62, 68))),
    ("steel-blue", _paint((44, 82, 140))),
    ("paint-orange", _paint((206, 98, 34))),
    ("paint-red", _paint((168, 36, 34))),
    ("paint-yellow", _paint((220, 176, 44))),
    ("hazard", _stripes((226, 184, 40), (28, 28, 30), 8, diagonal=True)),
    ("rubber", _paint((32, 32, 34))),
    ("chrome", _paint((196, 200, 204), 0.3)),
    ("white", _paint((226, 224, 218), 0.08)),
    ("paint-silver", _paint((168, 172, 178), 0.06)),
    ("paint-blue", _paint((40, 66, 120), 0.06)),
    ("carton-plain", _carton((186, 146, 98), "plain")),
    ("carton-label", _carton((178, 138, 92), "label")),
    ("carton-arrows", _carton((196, 158, 110), "arrows")),
    ("carton-fragile", _carton((170, 128, 84), "fragile")),
    ("carton-logo", _carton((204, 172, 128), "logo")),
    ("carton-white", _carton((222, 220, 212), "logo")),
    ("carton-blue", _carton((72, 104, 152), "label")),
    ("wrapped", _wrapped),
    ("leaves-dark", _leaves((62, 104, 40))),
    ("leaves-light", _leaves((112, 148, 54))),
    ("hedge", _leaves((50, 86, 44))),
    ("bark", _paint((92, 74, 58), 0.7)),
    ("soil", _paint((76, 58, 44), 0.5)),
    ("flowers-red", _leaves((66, 110, 50), (208, 44, 60))),
    ("flowers-yellow", _leaves((72, 116, 52), (238, 200, 60))),
    ("terracotta", _paint((176, 98, 66), 0.25)),
    ("side-glass", _side_glass),
    ("front-glass", _front_glass),
    ("nose", _nose((236, 234, 220))),
    ("tail", _nose((176, 30, 30))),
    ("wheel", _wheel),
    ("concrete", _paint((150, 148, 142), 0.3)),
    ("stone", _paint((186, 176, 156), 0.3)),
    ("awning-red", _stripes((178, 44, 44), (236, 228, 212), 8)),
    ("awning-green", _stripes((44, 104, 74), (236, 228, 212), 8)),
    ("awning-blue", _stripes((48, 84, 140), (236, 228, 212), 8)),
    ("awning-sand", _stripes((206, 166, 104), (176, 120, 66), 8)),
    ("fabric-red", _paint((150, 46, 50), 0.3)),
    ("fabric-blue", _paint((62, 84, 128), 0.3)),
    ("fabric-green", _paint((70, 112, 84), 0.3)),
    ("radiator", _fins((214, 210, 200))),
    ("grille", _fins((82, 84, 86))),
    ("books", _spines),
    ("magazines", _magazines),
    ("clock", _clock),
    ("door-wood", _door((146, 98, 58), window=False)),
    ("door-window", _door((92, 120, 126), window=True)),
    ("door-red", _door((142, 62, 54), window=True)),
    ("fruit", _fruit),
    ("sign-exit", _sign("EXIT", (24, 120, 70), (240, 246, 240), 1.1)),
    ("sign-stop", _sign("STOP", (180, 36, 36), (244, 240, 236), 1.1)),
    ("sign-parking", _sign("P", (36, 76, 160), (244, 244, 250), 2.6)),
    ("sign-aisle", _sign("A 12", (240, 200, 50), (24, 24, 26), 1.1)),
    ("slats", _slats),
    ("paint-green", _paint((44, 92, 62), 0.06)),
    ("paint-maroon", _paint((104, 30, 38), 0.06)),
    ("paint-black", _paint((34, 36, 40), 0.06)),
    ("paint-cream", _paint((214, 204, 180), 0.06)),
)


def parts(rng: np.random.Generator) -> Canvas:
    """8 x 8 cells of 128."""
    return grid([draw(rng) for _, draw in PARTS], 8)
