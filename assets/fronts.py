"""House fronts, shop windows and posters."""

from __future__ import annotations

import cv2
import numpy as np
from brushes import Canvas, Colour, cloud, flat, grid, hue_of, shaded, speckled, text
from tiling import brick


def _window(image: Canvas, rng: np.random.Generator, box: tuple[int, int, int, int], frame: Colour, style: str) -> None:
    x, y, w, h = box
    cv2.rectangle(image, (x - 4, y - 4), (x + w + 4, y + h + 4), tuple(0.55 * c for c in frame), -1)
    cv2.rectangle(image, (x - 3, y - 3), (x + w + 3, y + h + 3), frame, -1)
    glass = shaded(flat(h, w, (92, 116, 136)), float(rng.uniform(0.9, 1.5)), float(rng.uniform(0.4, 0.75)))
    if rng.random() < 0.55:
        curtain = tuple(float(v) for v in rng.uniform(150, 215, 3))
        width = int(w * rng.uniform(0.18, 0.4))
        glass[:, :width] = shaded(flat(h, width, curtain), 0.9, 0.7)
        if rng.random() < 0.7:
            glass[:, -width:] = shaded(flat(h, width, curtain), 0.9, 0.7)
    elif rng.random() < 0.4:
        drop = int(h * rng.uniform(0.2, 0.8))
        blind = flat(drop, w, tuple(float(v) for v in rng.uniform(160, 200, 3)))
        blind[::4] *= 0.75
        glass[:drop] = blind
    image[y : y + h, x : x + w] = glass
    image[y : y + 4, x : x + w] *= 0.55
    bars = {"cross": ([0.5], [0.36]), "sash": ([], [0.5]), "wide": ([0.33, 0.67], []), "tall": ([0.5], [0.25, 0.62])}
    across, down = bars[style]
    for share in across:
        cv2.line(image, (x + int(w * share), y), (x + int(w * share), y + h - 1), frame, 3)
    for share in down:
        cv2.line(image, (x, y + int(h * share)), (x + w - 1, y + int(h * share)), frame, 3)
    sill = tuple(min(255.0, 1.08 * c) for c in frame)
    cv2.rectangle(image, (x - 7, y + h + 3), (x + w + 7, y + h + 8), sill, -1)
    image[y + h + 9 : y + h + 14, x - 6 : x + w + 7] *= 0.72


def facade(rng: np.random.Generator, kind: str) -> Canvas:
    """One 512 x 512 cell: 12 m wide, 9 m tall."""
    size = 512
    if kind == "brick":
        small = cv2.resize(brick(rng, (156, 90, 66)), (256, 256), interpolation=cv2.INTER_AREA)
        image = np.tile(small, (2, 2, 1)).astype(np.float32)
        frame, style, bays, width, height = (226, 220, 206), "sash", 4, 56, 98
    elif kind == "cream":
        image = speckled(rng, size, size, (214, 188, 140), 0.14, 1.4)
        frame, style, bays, width, height = (240, 236, 226), "tall", 4, 52, 110
    elif kind == "rose":
        image = speckled(rng, size, size, (186, 128, 112), 0.16, 1.4)
        frame, style, bays, width, height = (235, 228, 214), "cross", 5, 46, 88
    else:
        image = speckled(rng, size, size, (134, 142, 148), 0.12, 1.5)
        frame, style, bays, width, height = (64, 70, 76), "wide", 3, 132, 92
    floor, bay = size // 3, size / bays
    for storey in range(3):
        band = storey * floor
        line = 0.72 if kind == "office" else 1.14
        image[band : band + 7] = np.clip(image[band : band + 7] * line, 0, 245)
        image[band + 7 : band + 10] *= 0.7
        for column in range(bays):
            x = int((column + 0.5) * bay - width / 2)
            y = band + 26 + (floor - 40 - height) // 2
            if kind == "cream":
                for side in (-1, 1):
                    left = x + (width + 6 if side > 0 else -30)
                    shutter = flat(height, 24, (74, 106, 92))
                    shutter[::5] *= 0.7
                    image[y : y + height, left : left + 24] = shutter
            _window(image, rng, (x, y, width, height), frame, style)
            if kind == "rose" and storey % 2 == 0:
                cv2.rectangle(image, (x - 8, y - 16), (x + width + 8, y - 6), frame, -1)
    if kind == "office":
        for column in range(bays + 1):
            x = int(column * bay)
            image[:, max(0, x - 4) : x + 4] *= 0.8
    stain = cloud(rng, size, size, 1.8)
    return image * (0.88 + 0.2 * stain)[..., None]


def facades(rng: np.random.Generator) -> Canvas:
    """2 x 2 cells: brick, cream, rose, office."""
    brick_, cream, rose, office = (facade(rng, kind) for kind in ("brick", "cream", "rose", "office"))
    return np.vstack([np.hstack([brick_, cream]), np.hstack([rose, office])])


SHOP_NAMES = (
    ("BAKERY", "BOOKS & MAPS", "CAFE LUNA"),
    ("PHARMACY", "FLOWERS", "OPTICIAN"),
    ("CYCLES", "RECORDS", "TEA HOUSE"),
    ("TAILOR", "HARDWARE", "GALLERY"),
)


def shops(rng: np.random.Generator) -> Canvas:
    """4 strips of 1024 x 256: each 12 m of ground floor, 3.6 m tall, with three shops and their doors."""
    strips: list[Canvas] = []
    for names in SHOP_NAMES:
        strip = speckled(rng, 256, 1024, tuple(float(v) for v in rng.uniform(110, 170, 3)), 0.2, 1.2)
        strip[236:] *= 0.6
        for index, name in enumerate(names):
            left = index * 341 + 12
            paint = tuple(float(v) for v in rng.uniform(30, 150, 3))
            cv2.rectangle(strip, (left, 22), (left + 317, 62), paint, -1)
            cv2.rectangle(strip, (left, 22), (left + 317, 62), tuple(0.5 * c for c in paint), 2)
            light = (240, 232, 208) if rng.random() < 0.7 else (236, 200, 96)
            text(strip, name, (left + 24 + 6 * (12 - len(name)), 53), 1.05, light)
            for x, w in ((left + 4, 112), (left + 200, 112)):
                strip[72:226, x : x + w] = display(rng, 154, w)
                cv2.rectangle(strip, (x, 72), (x + w, 226), paint, 4)
            door = left + 122
            strip[72:252, door : door + 72] = shaded(flat(180, 72, paint), 0.9, 0.7)
            strip[86:190, door + 10 : door + 62] = shaded(flat(104, 52, (94, 112, 122)), 1.2, 0.5)
            cv2.circle(strip, (door + 63, 200), 4, (220, 200, 120), -1)
        strips.append(strip)
    return np.vstack(strips)


def display(rng: np.random.Generator, height: int, width: int) -> Canvas:
    """A shop window: a dim room with mannequins, shelves or tables of goods, and what the glass reflects."""
    room = shaded(flat(height, width, (104, 94, 80)), 0.45, 1.0)
    floor = int(0.84 * height)
    room[floor:] = shaded(flat(height - floor, width, (126, 110, 90)), 0.8, 1.2)
    for x in np.linspace(0.2, 0.8, 3):
        cv2.circle(room, (int(x * width), 5), 4, (255, 238, 206), -1, cv2.LINE_AA)
    hue = float(rng.uniform(0, 180))
    kind = rng.integers(3)
    if kind == 0:
        for x in np.linspace(0.22, 0.78, int(rng.integers(2, 4))):
            _mannequin(room, rng, int(x * width), floor + int(0.05 * height), 0.62 * height, hue)
    elif kind == 1:
        for base in (0.34, 0.56, 0.8):
            _goods(room, rng, int(base * height), int(0.15 * height), hue)
    else:
        table = int(0.68 * height)
        cv2.rectangle(room, (int(0.1 * width), table), (int(0.9 * width), floor), (84, 64, 46), -1)
        _goods(room, rng, table, int(0.16 * height), hue)
        corner, opposite = (int(0.3 * width), int(0.14 * height)), (int(0.7 * width), int(0.4 * height))
        cv2.rectangle(room, corner, opposite, hue_of(hue, 90, 150), -1)
        cv2.rectangle(room, corner, opposite, (60, 50, 42), 2)
    room = cv2.GaussianBlur(room, (0, 0), 0.6).astype(np.float32)
    # The glass reflects houses across the street, the sky above their roofs, and a strip of light.
    roof = np.repeat(rng.integers(int(0.15 * height), int(0.45 * height), 5), -(-width // 5))[:width]
    sky = np.arange(height)[:, None] < roof
    streak = np.zeros((height, width), np.float32)
    corners = [[width // 3, 0], [width // 2, 0], [width // 6, height], [-width // 10, height]]
    cv2.fillPoly(streak, [np.array(corners)], 1.0, cv2.LINE_AA)
    mirrored = np.where(sky[..., None], np.array((150, 172, 196), np.float32), np.array((84, 78, 74), np.float32))
    return np.asarray(0.72 * room + (0.22 + 0.1 * streak[..., None]) * mirrored, dtype=np.float32)


def _mannequin(image: Canvas, rng: np.random.Generator, x: int, foot: int, tall: float, hue: float) -> None:
    skin = (206, 196, 182)
    coat, skirt = hue_of(hue + float(rng.uniform(-20, 20)), 110, float(rng.uniform(90, 200))), hue_of(hue + 90, 60, 90)
    shoulder, waist = 0.13 * tall, 0.08 * tall

    def at(across: float, up: float) -> tuple[int, int]:
        return (round(x + across), round(foot - up * tall))

    for side in (-1, 1):
        cv2.line(image, at(0.04 * side * tall, 0.0), at(0.04 * side * tall, 0.45), skin, max(2, round(0.05 * tall)))
        cv2.line(image, at(side * shoulder, 0.8), at(1.2 * side * shoulder, 0.45), coat, max(2, round(0.05 * tall)))
    legs = [at(-waist, 0.52), at(waist, 0.52), at(1.5 * waist, 0.26), at(-1.5 * waist, 0.26)]
    cv2.fillPoly(image, [np.array(legs)], skirt, cv2.LINE_AA)
    trunk = [at(-shoulder, 0.82), at(shoulder, 0.82), at(waist, 0.48), at(-waist, 0.48)]
    cv2.fillPoly(image, [np.array(trunk)], coat, cv2.LINE_AA)
    cv2.line(image, at(0.0, 0.8), at(0.0, 0.9), skin, max(2, round(0.05 * tall)))
    cv2.ellipse(image, at(0.0, 0.93), (max(2, round(0.055 * tall)), max(3, round(0.075 * tall))), 0, 0, 360, skin, -1)


def _goods(image: Canvas, rng: np.random.Generator, base: int, tallest: int, hue: float) -> None:
    """A shelf with goods of related colours."""
    width, x = image.shape[1], 5
    cv2.line(image, (0, base), (width, base), (70, 56, 44), 3)
    while x < width - 12:
        w, h = int(rng.integers(6, 15)), int(rng.integers(tallest // 2, tallest + 1))
        colour = hue_of(hue + float(rng.normal(0, 14)), float(rng.uniform(30, 130)), float(rng.uniform(90, 215)))
        if rng.random() < 0.3:
            cv2.ellipse(image, (x + w // 2, base - 2), (w // 2 + 1, h // 2), 0, 180, 360, colour, -1, cv2.LINE_AA)
        else:
            cv2.rectangle(image, (x, base - h), (x + w, base - 2), colour, -1)
            cv2.line(image, (x + w, base - h), (x + w, base - 2), tuple(0.6 * c for c in colour), 2)
        x += w + int(rng.integers(1, 6))


_INKS = ((38, 58, 92), (164, 62, 48), (206, 150, 62), (92, 122, 98), (48, 104, 112), (58, 54, 58), (176, 104, 92))
"""Of printed posters: navy, brick, ochre, sage, petrol, charcoal, old rose."""
_PAPER = (232, 226, 210)


def poster(rng: np.random.Generator, index: int) -> Canvas:
    """A 256 x 256 picture; hung 0.7-1.2 m wide."""
    back, front, accent = (_INKS[k] for k in rng.permutation(len(_INKS))[:3])
    image = shaded(flat(256, 256, back), 1.15, 0.85)
    kind = index % 8
    if kind == 0:
        for ring in range(7, 0, -1):
            cv2.circle(image, (128, 128), ring * 22, front if ring % 2 else back, -1, cv2.LINE_AA)
        cv2.rectangle(image, (0, 186), (255, 255), back, -1)
        text(image, "CONCERT", (46, 226), 1.1, _PAPER)
    elif kind == 1:
        image[:] = _PAPER
        for row in range(9):
            w = int(rng.integers(120, 215))
            cv2.rectangle(image, (20, 74 + row * 19), (20 + w, 81 + row * 19), (70, 70, 76), -1)
        cv2.rectangle(image, (0, 0), (255, 52), front, -1)
        text(image, "NOTICE", (58, 38), 1.2, (255, 255, 255))
    elif kind == 2:
        peaks = np.array([[0, 200], [60, 96], [104, 150], [160, 60], [255, 190], [255, 255], [0, 255]])
        image[:] = shaded(flat(256, 256, (214, 202, 176)), 0.8, 1.1)
        cv2.circle(image, (196, 58), 28, accent, -1, cv2.LINE_AA)
        cv2.fillPoly(image, [peaks], front, cv2.LINE_AA)
        cv2.fillPoly(image, [peaks + np.array([0, 46])], tuple(0.6 * c for c in front), cv2.LINE_AA)
        text(image, "TRAVEL", (56, 240), 1.2, _PAPER)
    elif kind == 3:
        image[:] = _PAPER
        cv2.rectangle(image, (0, 0), (255, 150), front, -1)
        text(image, "SALE", (40, 112), 2.4, _PAPER, 6)
        for row, width in enumerate((150, 190, 110)):
            cv2.rectangle(image, (32, 176 + row * 22), (32 + width, 186 + row * 22), accent, -1)
    elif kind == 4:
        # A head and shoulders against a spotlight.
        cv2.circle(image, (150, 110), 92, accent, -1, cv2.LINE_AA)
        cv2.ellipse(image, (128, 104), (38, 50), 0, 0, 360, front, -1, cv2.LINE_AA)
        cv2.ellipse(image, (128, 256), (96, 104), 0, 180, 360, front, -1, cv2.LINE_AA)
        cv2.rectangle(image, (0, 214), (255, 255), _PAPER, -1)
        text(image, "THEATRE", (50, 246), 1.0, back)
    elif kind == 5:
        # A landscape in oil: hills behind hills, hazier the farther away they are.
        image[:] = shaded(flat(256, 256, (176, 192, 200)), 0.85, 1.2)
        image *= (0.9 + 0.2 * cloud(rng, 256, 256, 1.2))[..., None]
        columns = np.arange(256)
        for depth, colour in enumerate(((146, 160, 160), (116, 134, 108), (88, 102, 62), (66, 74, 44))):
            crest = 100 + 34 * depth + 40 * (cloud(rng, 256, 256, 2.2)[0] - 0.5)
            hill = np.column_stack([[*columns, 255, 0], [*crest, 255, 255]]).astype(np.int32)
            cv2.fillPoly(image, [hill], colour, cv2.LINE_AA)
        image *= (0.85 + 0.3 * cloud(rng, 256, 256, 1.0))[..., None]
    elif kind == 6:
        # Blocks of houses between streets, a park and a river.
        image[:] = (218, 208, 190)
        cv2.rectangle(image, (150, 60), (214, 120), (166, 184, 140), -1)
        bend = np.column_stack([np.linspace(-10, 266, 40), 190 + 26 * np.sin(np.linspace(0.0, 4.0, 40))])
        cv2.polylines(image, [bend.astype(np.int32)], False, (142, 168, 186), 20, cv2.LINE_AA)
        for at in np.cumsum(rng.integers(18, 40, 9)).tolist():
            cv2.line(image, (at, 0), (at + 20, 255), (244, 240, 232), 4, cv2.LINE_AA)
            cv2.line(image, (0, at), (255, at - 14), (244, 240, 232), 4, cv2.LINE_AA)
        cv2.line(image, (0, 150), (255, 40), (222, 178, 98), 7, cv2.LINE_AA)
        cv2.rectangle(image, (0, 0), (255, 44), front, -1)
        text(image, "CITY MAP", (40, 34), 1.1, _PAPER)
    else:
        image[:] = (124, 88, 56)
        image *= (0.85 + 0.3 * cloud(rng, 256, 256, 0.4))[..., None]
        for _ in range(16):
            x, y = int(rng.integers(6, 190)), int(rng.integers(6, 190))
            w, h = int(rng.integers(34, 66)), int(rng.integers(30, 62))
            colour = hue_of(float(rng.uniform(0, 180)), float(rng.choice([8.0, 24.0, 60.0])), 232)
            cv2.rectangle(image, (x + 2, y + 3), (x + w + 2, y + h + 3), (60, 42, 28), -1)
            cv2.rectangle(image, (x, y), (x + w, y + h), colour, -1)
            for line in range(3):
                cv2.line(image, (x + 5, y + 10 + line * 8), (x + w - 8, y + 10 + line * 8), (90, 90, 96), 2)
            cv2.circle(image, (x + w // 2, y + 3), 3, (200, 40, 40), -1)
    edge = (70, 66, 60) if kind == 7 else (244, 242, 236)
    cv2.rectangle(image, (0, 0), (255, 255), edge, 7)
    return image


def posters(rng: np.random.Generator) -> Canvas:
    """4 x 4 cells of 256."""
    return grid([poster(rng, index) for index in range(16)], 4)
