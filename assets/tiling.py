"""Surfaces that repeat without a seam."""

from __future__ import annotations

import cv2
import numpy as np
from brushes import Canvas, Colour, cloud, flat, speckled, wood


def slabs(
    rng: np.random.Generator, size: int, rows: int, columns: int, joint: int, spread: float, stagger: bool
) -> Canvas:
    """`(size, size)` grey: slabs with joints, each with a brightness of its own, on a torus."""
    image = np.zeros((size, size), np.float32)
    grain = cloud(rng, size, size, 0.6)
    stain = cloud(rng, size, size, 1.7)
    rise, run = size // rows, size // columns
    for row in range(rows):
        for column in range(columns):
            shift = run // 2 if stagger and row % 2 else 0
            tone = 178.0 + spread * rng.standard_normal()
            tile = np.full((rise, run), tone * 0.55, np.float32)
            tile[joint:, joint:] = tone
            tile[joint : joint + 2, joint:] *= 1.08
            tile[joint:, joint : joint + 2] *= 1.05
            columns_at = (column * run + shift + np.arange(run)) % size
            image[row * rise : (row + 1) * rise, columns_at] = tile
    return image * (0.86 + 0.20 * grain) * (0.84 + 0.26 * stain)


def paving(rng: np.random.Generator) -> Canvas:
    """3.2 m of plaza: large slabs in two tones with a darker band."""
    grey = slabs(rng, 512, 8, 8, 3, 9.0, stagger=True)
    colour = grey[..., None] * np.array([1.0, 0.95, 0.86], np.float32)
    warm = np.zeros((512, 512, 1), np.float32)
    warm[0:64] = 1.0
    warm[:, 0:64] = 1.0
    return colour * (1.0 - warm * np.array([0.18, 0.26, 0.32], np.float32))


def pavement(rng: np.random.Generator) -> Canvas:
    """2 m of pavement slabs, grey."""
    return slabs(rng, 512, 4, 4, 4, 8.0, stagger=True) * 1.02


def asphalt(rng: np.random.Generator) -> Canvas:
    """4 m of road, grey: grit, patches and cracks."""
    grit = rng.random((512, 512)).astype(np.float32)
    grit = 0.4 * grit + 0.3 * (np.roll(grit, 1, 0) + np.roll(grit, 1, 1))
    image = 112.0 + 70.0 * (grit - 0.5)
    image *= 0.82 + 0.36 * cloud(rng, 512, 512, 1.5)
    cracks = np.zeros((512, 512), np.float32)
    for _ in range(5):
        point = rng.uniform(60, 450, 2)
        heading = rng.uniform(0, 2 * np.pi)
        for _ in range(26):
            heading += rng.normal(0, 0.5)
            nxt = np.clip(point + 9 * np.array([np.cos(heading), np.sin(heading)]), 4, 507)
            cv2.line(cracks, tuple(point.astype(int).tolist()), tuple(nxt.astype(int).tolist()), 1.0, 1, cv2.LINE_AA)
            point = nxt
    image *= 1.0 - 0.45 * cracks
    image[300:420, 60:230] *= 0.84
    return image


def grass(rng: np.random.Generator) -> Canvas:
    """4 m of a mown lawn: blades, worn and lush patches, clover and a few dry leaves."""
    blades = cloud(rng, 512, 512, 0.25)
    patches = cloud(rng, 512, 512, 1.5)[..., None]
    lush, worn = np.array([74, 104, 42], np.float32), np.array([122, 124, 64], np.float32)
    image = (lush + (worn - lush) * patches) * (0.62 + 0.76 * blades)[..., None]
    for _ in range(90):
        x, y, dry = rng.integers(6, 506), rng.integers(6, 506), rng.random() < 0.35
        colour = (138, 108, 58) if dry else (96, 132, 66)
        cv2.ellipse(image, (int(x), int(y)), (4, 2), float(rng.uniform(0, 180)), 0, 360, colour, -1, cv2.LINE_AA)
    return image


def gravel(rng: np.random.Generator) -> Canvas:
    """2 m of a gravel walk, grey: stones, wheel marks."""
    stones = 0.55 * cloud(rng, 512, 512, 0.35) + 0.45 * cloud(rng, 512, 512, 0.9)
    return 205.0 * (0.62 + 0.5 * stones) * (0.86 + 0.24 * cloud(rng, 512, 512, 1.6))


def concrete(rng: np.random.Generator) -> Canvas:
    """6 m of an industrial floor, grey: blotches, scuffs, joints."""
    image = 150.0 * (0.74 + 0.4 * cloud(rng, 512, 512, 1.5)) * (0.93 + 0.12 * cloud(rng, 512, 512, 0.5))
    scuffs = np.zeros((512, 512), np.float32)
    for _ in range(70):
        start = rng.uniform(0, 512, 2)
        heading, length = rng.normal(0.1, 0.5), rng.uniform(15, 110)
        end = start + length * np.array([np.cos(heading), np.sin(heading)])
        colour = float(rng.uniform(0.2, 0.9))
        cv2.line(scuffs, tuple(start.astype(int).tolist()), tuple(end.astype(int).tolist()), colour, 1, cv2.LINE_AA)
    image *= 1.0 - 0.22 * scuffs
    for at in (0, 256):
        image[at : at + 2] *= 0.6
        image[:, at : at + 2] *= 0.6
    return image


def linoleum(rng: np.random.Generator) -> Canvas:
    """2.4 m of corridor floor: tiles in a pattern of cream, teal and a few dark ones."""
    tones = {"cream": (201, 190, 165), "sand": (182, 166, 136), "teal": (96, 125, 122), "dark": (88, 84, 80)}
    image = np.zeros((512, 512, 3), np.float32)
    for row in range(8):
        for column in range(8):
            name = "cream" if (row + column) % 2 else "sand"
            if row % 4 == 0 and column % 4 == 0:
                name = "dark"
            elif row % 4 == 0 or column % 4 == 0:
                name = "teal"
            tile = flat(64, 64, tones[name]) * float(rng.normal(1.0, 0.03))
            tile[:1] *= 0.7
            tile[:, :1] *= 0.7
            image[row * 64 : row * 64 + 64, column * 64 : column * 64 + 64] = tile
    fleck = cloud(rng, 512, 512, 0.3)
    return image * (0.88 + 0.2 * fleck + 0.12 * (cloud(rng, 512, 512, 1.6) - 0.5))[..., None]


def corridor_wall(rng: np.random.Generator) -> Canvas:
    """3 m wide, 2.8 m tall: pale plaster above, a painted dado below, a rail between."""
    image = speckled(rng, 512, 512, (216, 210, 194), 0.12, 1.4)
    image *= (0.97 + 0.06 * cloud(rng, 512, 512, 0.3))[..., None]
    low = 512 - round(1.05 / 2.8 * 512)
    image[low:] = speckled(rng, 512 - low, 512, (122, 148, 141), 0.16, 1.2)
    image[low - 14 : low] = wood(rng, 14, 512, (128, 88, 54))
    image[low - 16 : low - 14] *= 0.75
    for _ in range(26):
        x, y = rng.integers(0, 512), rng.integers(low + 40, 500)
        cv2.line(
            image, (int(x), int(y)), (int(x + rng.integers(6, 50)), int(y + rng.integers(-3, 4))), (84, 100, 98), 1
        )
    image[500:] *= 0.8
    return image


def ceiling(rng: np.random.Generator) -> Canvas:
    """1.2 m of a suspended ceiling, grey: perforated panels in a grid."""
    image = 205.0 * (0.95 + 0.06 * cloud(rng, 256, 256, 0.8))
    dots = rng.integers(6, 250, (420, 2))
    image[dots[:, 0], dots[:, 1]] *= 0.72
    for at in (0, 128):
        image[at : at + 4] = 228.0
        image[:, at : at + 4] = 228.0
        image[at + 4 : at + 6] *= 0.75
        image[:, at + 4 : at + 6] *= 0.75
    return image


def brick(rng: np.random.Generator, base: Colour = (150, 82, 62)) -> Canvas:
    """1.9 m of brickwork: 24 courses."""
    image = speckled(rng, 512, 512, (168, 158, 146), 0.2, 0.6)
    rise, run = 512 // 24, 512 // 8
    for row in range(25):
        for column in range(8):
            colour = np.array(base, np.float32) * float(rng.normal(1.0, 0.12)) + rng.normal(0, 6, 3)
            left = column * run + (run // 2 if row % 2 else 0)
            block = np.clip(flat(rise - 3, run - 3, tuple(colour)), 0, 255)
            columns = (left + np.arange(run - 3)) % 512
            rows = np.arange(row * rise, min(row * rise + rise - 3, 512))
            image[np.ix_(rows, columns)] = block[: len(rows)]
    return image * (0.8 + 0.3 * cloud(rng, 512, 512, 0.7) + 0.15 * (cloud(rng, 512, 512, 1.7) - 0.5))[..., None]


def cladding(rng: np.random.Generator) -> Canvas:
    """2 m of ribbed sheet metal, grey."""
    x = np.arange(256)
    ribs = 0.82 + 0.25 * np.abs(np.sin(np.pi * x / 32)) ** 0.5 - 0.28 * (x % 32 < 3)
    image = 172.0 * ribs[None, :].astype(np.float32) * (0.85 + 0.24 * cloud(rng, 256, 256, 1.4))
    image[0:2] *= 0.7
    return image
