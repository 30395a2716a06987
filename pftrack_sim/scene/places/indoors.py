"""What corridors and warehouses are furnished with. Origin on the floor, in the middle, unless said otherwise."""

from __future__ import annotations

import numpy as np

from pftrack_sim.scene.places.shapes import ALL_FACES, SIDES, Piece, Shape, blob, box, cylinder, moved, quad
from pftrack_sim.scene.places.surfaces import CARTONS, lit, part, poster
from pftrack_sim.scene.places.vehicles import pallet


def door(leaf: str = "door-wood", number: int | None = None, width: float = 0.95) -> Piece:
    """A closed door in its frame, in a wall at y = 0 that faces -y; a number plate beside it."""
    frame, height = part("wood-plain"), 2.08
    half = 0.5 * width
    posts = [box(frame, (s * (half + 0.06), -0.045, 0.5 * height), (0.12, 0.13, height)) for s in (-1, 1)]
    pieces: list[Shape] = [
        quad(part(leaf), (-half, -0.03, 0.0), (width, 0, 0), (0, 0, height)),
        *posts,
        box(frame, (0, -0.045, height + 0.06), (width + 0.24, 0.13, 0.12), ALL_FACES),
        box(part("chrome"), (half - 0.13, -0.085, 1.02), (0.13, 0.025, 0.025), ALL_FACES),
        box(part("chrome"), (half - 0.07, -0.06, 1.02), (0.03, 0.06, 0.03), ALL_FACES),
    ]
    if number is not None:
        skin = part("sign-aisle" if number % 2 else "white")
        pieces.append(box(skin, (half + 0.32, -0.015, 1.6), (0.2, 0.03, 0.16), ("-y", "+x", "-x", "+z")))
    return tuple(pieces)


def framed(index: int, width: float, height: float, z: float) -> Piece:
    """A poster or notice board on a wall at y = 0 that faces -y; its lower edge is at `z`."""
    rim = part("wood-dark" if index % 8 == 7 else "steel-dark")
    edges = [box(rim, (0, -0.02, z + h), (width + 0.08, 0.04, 0.04), ALL_FACES) for h in (0.0, height)]
    edges += [box(rim, (s * 0.5 * width, -0.02, z + 0.5 * height), (0.04, 0.04, height), SIDES) for s in (-1, 1)]
    return (quad(poster(index), (-0.5 * width, -0.012, z), (width, 0, 0), (0, 0, height)), *edges)


def radiator(length: float = 1.3) -> Piece:
    """A radiator on a wall at y = 0."""
    skin = part("radiator")
    return (
        box(skin, (0, -0.1, 0.42), (length, 0.1, 0.56), ALL_FACES),
        box(part("white"), (-0.5 * length - 0.05, -0.06, 0.08), (0.03, 0.03, 0.3), SIDES),
        box(part("steel"), (0.5 * length + 0.05, -0.08, 0.62), (0.08, 0.05, 0.05), ALL_FACES),
    )


def ceiling_panel(length: float = 1.2, width: float = 0.6) -> Piece:
    """A lamp panel that shines downwards; its origin is in its middle."""
    return (
        quad(lit("panel"), (-0.5 * length, 0.5 * width, -0.02), (length, 0, 0), (0, -width, 0)),
        *(box(part("white"), (0, s * 0.5 * width, -0.015), (length, 0.05, 0.05), ALL_FACES) for s in (-1, 1)),
    )


def potted_plant(rng: np.random.Generator, height: float = 1.5) -> Piece:
    """A plant in a pot."""
    heads = [
        blob(
            part("leaves-light" if k % 2 else "leaves-dark"),
            (float(rng.uniform(-0.12, 0.12)), float(rng.uniform(-0.12, 0.12)), height * (0.55 + 0.18 * k)),
            (0.3 - 0.05 * k, 0.3 - 0.05 * k, 0.24 * height),
            rng,
            0.25,
            8,
        )
        for k in range(3)
    ]
    pot = cylinder(part("terracotta"), (0, 0, 0), 0.18, 0.36, 10, 0.25)
    return (pot, cylinder(part("bark"), (0, 0, 0.3), 0.03, 0.5 * height, 6), *heads)


def couch(cloth: str = "fabric-blue", length: float = 1.9) -> Piece:
    """A padded bench with a back at +y."""
    skin = part(cloth)
    legs = [
        box(part("steel"), (x, y, 0.08), (0.05, 0.05, 0.16)) for x in (-0.4 * length, 0.4 * length) for y in (-0.2, 0.2)
    ]
    return (
        box(skin, (0, 0, 0.3), (length, 0.6, 0.28), ALL_FACES),
        box(skin, (0, 0.26, 0.62), (length, 0.16, 0.4), ALL_FACES),
        *(box(part("wood-dark"), (s * 0.5 * length, 0, 0.36), (0.08, 0.62, 0.5)) for s in (-1, 1)),
        *legs,
    )


def low_table() -> Piece:
    """A table with magazines on it."""
    top = box(part("wood-plain"), (0, 0, 0.42), (1.0, 0.55, 0.04), ALL_FACES)
    legs = [box(part("steel-dark"), (x, y, 0.2), (0.04, 0.04, 0.4)) for x in (-0.45, 0.45) for y in (-0.22, 0.22)]
    return (top, *legs, quad(part("magazines"), (-0.2, -0.2, 0.445), (0.5, 0, 0), (0, 0.36, 0)))


def bookcase(width: float = 1.2) -> Piece:
    """A bookcase with its back to +y."""
    return (
        box(part("wood-dark"), (0, 0, 1.0), (width, 0.34, 2.0)),
        quad(part("books"), (-0.46 * width, -0.175, 0.12), (0.92 * width, 0, 0), (0, 0, 1.8)),
    )


def vending_machine() -> Piece:
    """A vending machine with its back to +y; its window shines a little."""
    return (
        box(part("paint-red"), (0, 0, 0.92), (0.95, 0.75, 1.84)),
        quad(lit("display", 2), (-0.4, -0.38, 0.55), (0.58, 0, 0), (0, 0, 1.15)),
        quad(part("grille"), (-0.4, -0.38, 0.1), (0.8, 0, 0), (0, 0, 0.3)),
        quad(part("steel"), (0.24, -0.38, 0.9), (0.16, 0, 0), (0, 0, 0.5)),
    )


def extinguisher() -> Piece:
    """A fire extinguisher on a wall at y = 0, with its sign."""
    return (
        cylinder(part("paint-red"), (0, -0.12, 0.55), 0.09, 0.5, 8),
        cylinder(part("paint-black"), (0, -0.12, 1.05), 0.04, 0.1, 6),
        quad(part("paint-red"), (-0.12, -0.012, 1.45), (0.24, 0, 0), (0, 0, 0.24)),
    )


def hanging_sign(skin: str = "sign-exit") -> Piece:
    """A sign that hangs from the ceiling across x; its origin is at its lower edge."""
    return (
        box(part(skin), (0, 0, 0.15), (0.05, 0.62, 0.3), ALL_FACES),
        *(box(part("steel"), (0, y, 0.42), (0.015, 0.015, 0.26), SIDES) for y in (-0.22, 0.22)),
    )


def rack(rng: np.random.Generator, bays: int = 2, height: float = 4.6, depth: float = 1.0) -> Piece:
    """A pallet rack along x; one sees through it where nothing is stored.

    What stands on the shelves is drawn per seed; the steel is not.
    """
    bay, steel, beam = 2.7, part("steel-blue"), part("paint-orange")
    levels = [0.12 + 1.45 * k for k in range(int(height / 1.45))]
    left = -0.5 * bays * bay
    pieces: list[Shape] = []
    for post in range(bays + 1):
        x = left + post * bay
        pieces += [box(steel, (x, s * 0.5 * depth, 0.5 * height), (0.1, 0.09, height)) for s in (-1, 1)]
        pieces += [box(steel, (x, 0, 0.6 + 1.3 * k), (0.05, depth, 0.06), ALL_FACES) for k in range(int(height / 1.3))]
    for index in range(bays):
        middle = left + (index + 0.5) * bay
        for level in levels:
            pieces += [box(beam, (middle, s * 0.5 * depth, level), (bay - 0.1, 0.06, 0.13), ALL_FACES) for s in (-1, 1)]
            pieces.append(
                box(part("wood-plain"), (middle, 0, level + 0.05), (bay - 0.1, depth - 0.06, 0.03), ALL_FACES)
            )
            pieces += moved(_stored(rng, bay - 0.3, depth), middle, 0.0, level + 0.07)
    return tuple(pieces)


def _stored(rng: np.random.Generator, length: float, depth: float) -> Piece:
    """Cartons, sacks or nothing on one shelf of one bay."""
    pieces: list[Shape] = []
    style = rng.random()
    if style < 0.12:
        return ()
    x = -0.5 * length
    while True:
        wide = float(rng.uniform(0.42, 0.9))
        if x + wide > 0.5 * length:
            return tuple(pieces)
        if rng.random() < 0.86:
            skin = part(str(rng.choice(CARTONS)))
            tall = float(rng.uniform(0.32, 0.6))
            deep = depth * float(rng.uniform(0.7, 0.92))
            pieces.append(box(skin, (x + 0.5 * wide, 0, 0.5 * tall), (wide - 0.03, deep, tall)))
            if style > 0.45 and rng.random() < 0.75:
                upper = float(rng.uniform(0.25, 0.5))
                skin = part(str(rng.choice(CARTONS)))
                pieces.append(box(skin, (x + 0.5 * wide, 0, tall + 0.5 * upper), (0.85 * wide, 0.9 * deep, upper)))
        x += wide + float(rng.uniform(0.0, 0.12))


def carton_stack(rng: np.random.Generator, layers: int = 3) -> Piece:
    """A pallet with cartons of several kinds."""
    pieces: list[Shape] = list(pallet())
    first = str(rng.choice(CARTONS))
    for layer in range(layers):
        for x in (-0.29, 0.29):
            for y in (-0.195, 0.195):
                if layer == layers - 1 and rng.random() < 0.35:
                    continue
                name = first if rng.random() < 0.6 else str(rng.choice(CARTONS))
                pieces.append(box(part(name), (x, y, 0.14 + 0.4 * (layer + 0.5)), (0.57, 0.38, 0.39)))
    return tuple(pieces)


def pallet_pile(count: int = 6) -> Piece:
    """Empty pallets on top of each other."""
    return tuple(shape for k in range(count) for shape in pallet(0.145 * k))


def drums(rng: np.random.Generator) -> Piece:
    """Four oil drums."""
    paints = ("paint-blue", "paint-red", "paint-green", "steel-blue", "paint-yellow")
    pieces: list[Shape] = []
    for x in (-0.32, 0.32):
        for y in (-0.32, 0.32):
            skin = part(str(rng.choice(paints)))
            pieces.append(cylinder(skin, (x, y, 0), 0.29, 0.88, 12))
            pieces.append(cylinder(part("steel-dark"), (x, y, 0.42), 0.297, 0.04, 12))
    return tuple(pieces)


def trolley(rng: np.random.Generator) -> Piece:
    """A hand cart with a few boxes."""
    boxes = [
        box(part(str(rng.choice(CARTONS))), (-0.35 + 0.36 * k, 0, 0.28 + 0.5 * h), (0.34, 0.5, h))
        for k, h in enumerate(rng.uniform(0.25, 0.6, 3).tolist())
    ]
    wheels = [cylinder(part("rubber"), (x, y, 0.0), 0.07, 0.14, 8) for x in (-0.45, 0.45) for y in (-0.24, 0.24)]
    rail = [box(part("steel-blue"), (-0.58, y, 0.6), (0.04, 0.04, 0.9), SIDES) for y in (-0.26, 0.26)]
    bar = box(part("steel-blue"), (-0.58, 0, 1.05), (0.04, 0.56, 0.04), ALL_FACES)
    return (box(part("steel-blue"), (0, 0, 0.22), (1.2, 0.62, 0.08), ALL_FACES), *boxes, *wheels, *rail, bar)


def high_bay_lamp() -> Piece:
    """A factory lamp that hangs; its origin is at the rim of its shade."""
    return (
        cylinder(part("steel"), (0, 0, 0), 0.42, 0.32, 12, 0.12),
        cylinder(part("steel-dark"), (0, 0, 0.32), 0.1, 0.2, 8),
        box(part("steel-dark"), (0, 0, 0.9), (0.03, 0.03, 1.0), SIDES),
        quad(lit("cold"), (-0.28, 0.28, 0.02), (0.56, 0, 0), (0, -0.56, 0)),
    )


def steel_pillar(height: float, width: float = 0.34) -> Piece:
    """A steel pillar with flanges and a guard in warning colours."""
    steel = part("steel")
    return (
        box(steel, (0, 0, 0.5 * height), (0.08, width, height), SIDES),
        *(box(steel, (s * 0.5 * width, 0, 0.5 * height), (0.05, width, height), SIDES) for s in (-1, 1)),
        box(part("hazard"), (0, 0, 0.55), (width + 0.12, width + 0.12, 1.1)),
    )


def narrow_bench(length: float = 1.6) -> Piece:
    """A bench without a back for narrow corridors."""
    legs = [box(part("steel-dark"), (s * 0.4 * length, 0, 0.21), (0.05, 0.3, 0.42)) for s in (-1, 1)]
    slats = [box(part("wood-light"), (0, y, 0.44), (length, 0.15, 0.04), ALL_FACES) for y in (-0.09, 0.09)]
    return (*slats, *legs)


def lockers(count: int = 5, paint: str = "steel-blue") -> Piece:
    """A row of metal lockers along x with their backs to +y."""
    pieces: list[Shape] = [box(part("steel-dark"), (0, 0.02, 0.95), (0.36 * count + 0.04, 0.32, 1.9))]
    for k in range(count):
        x = 0.36 * (k - 0.5 * (count - 1))
        pieces.append(quad(part(paint), (x - 0.17, -0.145, 0.06), (0.34, 0, 0), (0, 0, 1.8)))
        pieces.append(quad(part("grille"), (x - 0.1, -0.15, 1.55), (0.2, 0, 0), (0, 0, 0.18)))
        pieces.append(box(part("chrome"), (x + 0.12, -0.155, 1.0), (0.03, 0.03, 0.12), ALL_FACES))
    return tuple(pieces)
