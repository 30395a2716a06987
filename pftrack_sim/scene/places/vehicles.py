"""Cars and a forklift: what stands about on wheels."""

from __future__ import annotations

import numpy as np

from pftrack_sim.scene.places.outdoors import wheel_disc
from pftrack_sim.scene.places.shapes import ALL_FACES, Piece, Shape, box, loft, moved, quad, turned
from pftrack_sim.scene.places.surfaces import lit, part


def car(paint: str = "paint-blue", lights: bool = False) -> Piece:
    """A hatchback, 4.2 x 1.75 x 1.5 m, whose nose points along +x."""
    skin = part(paint)
    hull = loft(
        skin,
        [
            (-2.1, 0.36, 0.72, 0.76, 0.72),
            (-2.0, 0.28, 0.98, 0.86, 0.80),
            (-1.0, 0.22, 1.0, 0.88, 0.82),
            (0.75, 0.22, 0.96, 0.88, 0.82),
            (1.75, 0.24, 0.84, 0.87, 0.76),
            (2.05, 0.30, 0.66, 0.80, 0.70),
            (2.1, 0.36, 0.55, 0.74, 0.68),
        ],
    )
    # The glass house: dark all round, with painted pillars and a roof on it.
    cabin = loft(
        part("side-glass"),
        [(-1.9, 0.96, 1.0, 0.79, 0.76), (-1.35, 0.96, 1.43, 0.80, 0.64), (0.1, 0.94, 1.45, 0.80, 0.64),
         (0.95, 0.92, 0.97, 0.79, 0.76)],
    )  # fmt: skip
    roof = loft(
        skin,
        [(-1.5, 1.40, 1.43, 0.655, 0.60), (-0.6, 1.43, 1.50, 0.66, 0.60), (0.12, 1.43, 1.47, 0.66, 0.60)],
    )
    pillars: list[Shape] = []
    for side in (-1, 1):
        for x_low, x_high in ((0.92, 0.12), (-0.62, -0.62), (-1.88, -1.4)):
            low, high = np.array([x_low, side * 0.80, 0.96]), np.array([x_high, side * 0.655, 1.44])
            # Wound so that the pillar faces outwards on either side.
            along = np.array([-0.09 * side, 0.0, 0.0])
            pillars.append(quad(skin, low + np.array([0.0, 0.012 * side, 0.0]), along, high - low))
    wheels: list[Shape] = []
    for x in (-1.3, 1.32):
        wheels += moved(wheel_disc(0.31, 0.2), x, -0.80, 0.31)
        wheels += moved(turned(wheel_disc(0.31, 0.2), np.pi), x, 0.80, 0.31)
    nose = quad(part("nose"), (2.125, -0.7, 0.32), (0, 1.4, 0), (-0.03, 0, 0.36))
    tail = quad(part("tail"), (-2.125, 0.72, 0.4), (0, -1.44, 0), (0.05, 0, 0.46))
    sills = box(part("rubber"), (0, 0, 0.26), (3.9, 1.74, 0.14))
    glowing = [box(lit("red"), (-2.12, s * 0.6, 0.72), (0.04, 0.22, 0.1), ALL_FACES) for s in (-1, 1)] if lights else []
    return (hull, cabin, roof, *pillars, *wheels, nose, tail, sills, *glowing)


def van(paint: str = "white") -> Piece:
    """A delivery van, 4.8 x 1.9 x 2.1 m, whose nose points along +x."""
    skin = part(paint)
    body = loft(
        skin,
        [
            (-2.4, 0.3, 2.05, 0.93, 0.88),
            (0.9, 0.3, 2.1, 0.95, 0.88),
            (1.6, 0.3, 1.15, 0.95, 0.84),
            (2.35, 0.34, 0.9, 0.9, 0.8),
        ],
    )
    screen = quad(part("front-glass"), (1.59, -0.76, 1.2), (0, 1.52, 0), (-0.62, 0.0, 0.80))
    logo = [
        quad(part("carton-logo"), (-1.7, -0.955, 0.9), (1.5, 0, 0), (0, 0.03, 0.8)),
        quad(part("carton-logo"), (-0.2, 0.955, 0.9), (-1.5, 0, 0), (0, -0.03, 0.8)),
    ]
    doors = [
        quad(part("front-glass"), (0.2, -0.96, 1.15), (0.85, 0, 0), (0, 0.045, 0.6)),
        quad(part("front-glass"), (1.05, 0.96, 1.15), (-0.85, 0, 0), (0, -0.045, 0.6)),
    ]
    wheels: list[Shape] = []
    for x in (-1.5, 1.5):
        wheels += moved(wheel_disc(0.34, 0.22), x, -0.86, 0.34)
        wheels += moved(turned(wheel_disc(0.34, 0.22), np.pi), x, 0.86, 0.34)
    nose = quad(part("nose"), (2.37, -0.8, 0.35), (0, 1.6, 0), (0, 0, 0.5))
    tail = quad(part("tail"), (-2.42, 0.85, 0.35), (0, -1.7, 0), (0, 0, 0.6))
    return (body, screen, *logo, *doors, *wheels, nose, tail)


def forklift() -> Piece:
    """A forklift with an overhead guard; its forks point along +x."""
    paint, dark = part("paint-yellow"), part("steel-dark")
    posts = [box(dark, (x, y, 1.55), (0.07, 0.07, 1.1)) for x in (-0.6, 0.35) for y in (-0.45, 0.45)]
    bars = [box(dark, (-0.12, -0.4 + 0.2 * k, 2.12), (1.1, 0.05, 0.05), ALL_FACES) for k in range(5)]
    mast = [box(dark, (0.95, y, 1.15), (0.12, 0.1, 2.3)) for y in (-0.36, 0.36)]
    rungs = [box(dark, (0.95, 0, z), (0.1, 0.7, 0.1), ALL_FACES) for z in (0.4, 1.3, 2.25)]
    forks = [box(part("steel"), (1.55, y, 0.1), (1.1, 0.12, 0.05), ALL_FACES) for y in (-0.28, 0.28)]
    wheels: list[Shape] = []
    for x, radius in ((-0.6, 0.24), (0.6, 0.3)):
        wheels += moved(wheel_disc(radius, 0.22), x, -0.5, radius)
        wheels += moved(turned(wheel_disc(radius, 0.22), np.pi), x, 0.5, radius)
    pieces = (
        box(paint, (-0.65, 0, 0.72), (0.85, 1.05, 0.75)),
        box(paint, (0.35, 0, 0.5), (1.1, 1.0, 0.45)),
        box(part("hazard"), (-1.09, 0, 0.45), (0.06, 1.05, 0.3)),
        box(part("rubber"), (-0.3, 0, 1.15), (0.5, 0.5, 0.12)),
        box(part("rubber"), (-0.52, 0, 1.4), (0.1, 0.5, 0.5)),
        *posts, *bars, *mast, *rungs, *forks, *wheels,
        *moved(pallet_load("carton-label"), 1.6, 0.0, 0.13),
    )  # fmt: skip
    return moved(pieces, -0.54, 0.0)


def pallet(z: float = 0.0) -> Piece:
    """A euro pallet, 1.2 x 0.8 m."""
    wood = part("wood-light")
    runners = [box(part("wood-plain"), (0, y, z + 0.05), (1.2, 0.1, 0.1), ALL_FACES[:4]) for y in (-0.35, 0, 0.35)]
    return (box(wood, (0, 0, z + 0.12), (1.2, 0.8, 0.04), ALL_FACES), *runners)


def pallet_load(carton: str, layers: int = 2) -> Piece:
    """A pallet with four cartons to a layer."""
    skin = part(carton)
    cartons = [
        box(skin, (x, y, 0.14 + 0.38 * (layer + 0.5)), (0.57, 0.38, 0.37))
        for layer in range(layers)
        for x in (-0.29, 0.29)
        for y in (-0.195, 0.195)
    ]
    return (*pallet(), *cartons)
