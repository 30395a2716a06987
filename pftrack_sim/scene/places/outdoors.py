"""What stands on pavements and squares. Every piece has its origin on the ground, in its middle."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np

from pftrack_sim.scene.places.shapes import ALL_FACES, Piece, Shape, blob, box, cylinder, moved, quad, tipped, turned
from pftrack_sim.scene.places.surfaces import lit, part, poster


def bench(wood: str = "wood-light") -> Piece:
    """A park bench, 1.8 m along x, that one sits on facing -y."""
    slat, iron = part(wood), part("steel-dark")
    seat = [box(slat, (0, -0.18 + 0.14 * k, 0.44), (1.8, 0.12, 0.04), ALL_FACES) for k in range(3)]
    back = [box(slat, (0, 0.24 + 0.02 * k, 0.60 + 0.15 * k), (1.8, 0.03, 0.11), ALL_FACES) for k in range(2)]
    legs = [box(iron, (x, 0.02, 0.21), (0.06, 0.48, 0.42)) for x in (-0.75, 0.75)]
    posts = [box(iron, (x, 0.28, 0.60), (0.06, 0.04, 0.44)) for x in (-0.75, 0.75)]
    return (*seat, *back, *legs, *posts)


def tree(rng: np.random.Generator, height: float = 6.0, leaves: str = "leaves-dark", tufts: int = 3) -> Piece:
    """A street tree in a pit with a stone rim; its crown is one big ball of leaves and `tufts` smaller ones."""
    fork = 0.36 * height
    spread = 0.27 * height
    stone, crown = part("stone"), [(0.0, 0.0, 0.68 * height, 1.0)]
    turn = rng.uniform(0.0, 2.0 * np.pi)
    for k in range(tufts):
        angle = turn + 2.0 * np.pi * k / tufts
        crown.append((0.55 * spread * np.cos(angle), 0.55 * spread * np.sin(angle), 0.56 * height, 0.72))
    rim = [box(stone, (0, s * 0.62, 0.06), (1.36, 0.12, 0.12)) for s in (-1, 1)]
    rim += [box(stone, (s * 0.62, 0, 0.06), (0.12, 1.12, 0.12)) for s in (-1, 1)]
    pit = quad(part("soil"), (-0.56, -0.56, 0.05), (1.12, 0, 0), (0, 1.12, 0))
    trunk = cylinder(part("bark"), (0, 0, 0), 0.024 * height + 0.03, 0.62 * height, 8, 0.012 * height)
    limbs = [
        blob(part(leaves), (x, y, z), (size * spread, size * spread, 0.85 * size * spread), rng, 0.13)
        for x, y, z, size in crown
    ]
    return (*rim, pit, trunk, cylinder(part("bark"), (0, 0, fork), 0.05, 0.2, 6), *limbs)


def planter(rng: np.random.Generator, plants: str = "flowers-red", length: float = 1.6) -> Piece:
    """A concrete trough full of flowers."""
    trough, count = part("concrete"), max(2, round(length / 0.55))
    heads = [
        blob(part(plants), ((k + 0.5) * length / count - 0.5 * length, 0, 0.58), (0.36, 0.3, 0.24), rng, 0.16, 6)
        for k in range(count)
    ]
    soil = quad(part("soil"), (-0.5 * length, -0.3, 0.521), (length, 0, 0), (0, 0.6, 0))
    return (box(trough, (0, 0, 0.26), (length, 0.62, 0.52), ALL_FACES[:4]), soil, *heads)


def hedge(length: float, height: float = 1.1, depth: float = 0.7) -> Piece:
    """A clipped hedge along x, in blocks so that its leaves keep their size."""
    count = max(1, round(length / 1.2))
    step = length / count
    return tuple(
        box(part("hedge"), ((k + 0.5) * step - 0.5 * length, 0, 0.5 * height), (step, depth, height))
        for k in range(count)
    )


def bin_() -> Piece:
    """A litter bin."""
    return (
        cylinder(part("paint-green"), (0, 0, 0.08), 0.23, 0.75, 10, 0.26),
        cylinder(part("steel-dark"), (0, 0, 0.83), 0.28, 0.07, 10),
        cylinder(part("steel-dark"), (0, 0, 0), 0.16, 0.08, 8),
    )


def bollard() -> Piece:
    """An iron bollard."""
    iron = part("steel-dark")
    return (cylinder(iron, (0, 0, 0), 0.09, 0.85, 8, 0.07), cylinder(part("chrome"), (0, 0, 0.68), 0.082, 0.06, 8))


def advertising_column(first: int) -> Piece:
    """A round column, 3.2 m tall, pasted with posters from `first` on."""
    sides, radius = 12, 0.62
    turn = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    sheets: list[Shape] = []
    for level in range(2):
        for k in range(sides // 2):
            skin = poster(first + 3 * level + k)
            a, b = turn[2 * k], turn[2 * k + 2]
            corner = np.array([radius * np.cos(a), radius * np.sin(a), 0.5 + 1.1 * level])
            along = np.array([radius * (np.cos(b) - np.cos(a)), radius * (np.sin(b) - np.sin(a)), 0.0])
            sheets.append(quad(skin, corner, along, (0, 0, 1.1)))
    core = cylinder(part("stone"), (0, 0, 0), 0.7, 0.5, 12, 0.62)
    cap = cylinder(part("paint-green"), (0, 0, 2.7), 0.78, 0.16, 12)
    return (core, *sheets, cap, cylinder(part("paint-green"), (0, 0, 2.86), 0.7, 0.5, 12, 0.1))


def kiosk(awning: str = "awning-red") -> Piece:
    """A newspaper stand, 3.2 x 2.2 m, open towards -y."""
    wall, roof, dark = part("paint-green"), part("steel-dark"), part("paint-black")
    half_x, half_y = 1.6, 1.1
    counter = box(part("wood-dark"), (0, -half_y - 0.2, 0.95), (2.8, 0.4, 0.08), ALL_FACES)
    front = quad(part("magazines"), (-1.4, -half_y - 0.02, 1.05), (2.8, 0, 0), (0, 0, 1.1))
    fruit = quad(part("fruit"), (-1.4, -half_y - 0.62, 0.55), (2.8, 0, 0), (0, 0.5, 0.32))
    stall = box(part("slats"), (0, -half_y - 0.34, 0.28), (2.8, 0.5, 0.5))
    shade = quad(part(awning), (-1.7, -half_y - 1.1, 2.25), (3.4, 0, 0), (0, 1.1, 0.4))
    under = quad(part(awning), (1.7, -half_y - 1.1, 2.24), (-3.4, 0, 0), (0, 1.1, 0.4))
    sides = [
        quad(poster(4 + k), (s * (half_x + 0.02), s * -0.75, 0.8), (0, s * 1.5, 0), (0, 0, 1.5))
        for k, s in enumerate((1, -1))
    ]
    books = quad(part("magazines"), (half_x - 0.2, half_y + 0.02, 0.5), (-2.8, 0, 0), (0, 0, 1.6))
    sign = box(part("paint-yellow"), (0, -half_y - 0.05, 2.95), (2.6, 0.08, 0.36))
    return (
        box(wall, (0, 0, 1.3), (2 * half_x, 2 * half_y, 2.6)),
        box(roof, (0, 0, 2.7), (3.5, 2.5, 0.2), ALL_FACES),
        box(dark, (0, 0, 0.05), (3.3, 2.3, 0.1)),
        counter, front, fruit, stall, shade, under, *sides, books, sign,
    )  # fmt: skip


def parasol_table(rng: np.random.Generator, cloth: str = "awning-sand") -> Piece:
    """A cafe table with four chairs under a parasol."""
    top, iron = part("wood-dark"), part("steel-dark")
    sides, reach = 8, 1.5
    turn = np.linspace(0.0, 2.0 * np.pi, sides + 1) + 0.2
    pieces: list[Shape] = [
        cylinder(top, (0, 0, 0.71), 0.42, 0.04, 10),
        cylinder(iron, (0, 0, 0), 0.04, 2.6, 6),
        cylinder(iron, (0, 0, 0), 0.3, 0.05, 8),
        cylinder(part(cloth), (0, 0, 2.18), reach, 0.45, sides, 0.05),
        cylinder(part(cloth), (0, 0, 2.04), reach, 0.14, sides, reach),
    ]
    # The underside: a fan that looks down.
    rim = np.column_stack([reach * np.cos(turn), reach * np.sin(turn), np.full(sides + 1, 2.05)])
    pieces += [
        quad(part(cloth), rim[k + 1], rim[k] - rim[k + 1], np.array([0, 0, 2.25]) - 0.5 * (rim[k] + rim[k + 1]))
        for k in range(sides)
    ]
    for k in range(4):
        angle = 0.5 * np.pi * k + float(rng.uniform(-0.3, 0.3))
        pieces += moved(turned(chair(), angle), 0.82 * np.sin(angle), -0.82 * np.cos(angle))
    return tuple(pieces)


def chair(seat: str = "fabric-red") -> Piece:
    """A chair that one sits on facing +y."""
    iron = part("steel-dark")
    legs = [box(iron, (x, y, 0.22), (0.03, 0.03, 0.44)) for x in (-0.19, 0.19) for y in (-0.19, 0.19)]
    back = box(part(seat), (0, -0.2, 0.74), (0.42, 0.03, 0.34), ALL_FACES)
    posts = [box(iron, (x, -0.2, 0.6), (0.03, 0.03, 0.5)) for x in (-0.19, 0.19)]
    return (box(part(seat), (0, 0, 0.45), (0.42, 0.42, 0.05), ALL_FACES), back, *legs, *posts)


@cache
def bicycle(paint: str = "paint-red") -> Piece:
    """A bicycle along x: tyres as rings, so that one sees through the wheels."""
    # Kept, as it has many parts, and places have many of it.
    frame, tyre = part(paint), part("rubber")
    pieces: list[Shape] = []
    for x in (-0.52, 0.52):
        turn = np.linspace(0.0, 2.0 * np.pi, 13)
        for a, b in pairwise(turn):
            inner, outer = (np.array([[np.cos(t), 0.0, np.sin(t)] for t in (a, b)]) * r for r in (0.29, 0.34))
            hub = np.array([x, 0.0, 0.34])
            for side in (-1, 1):
                first, second = (0, 1) if side < 0 else (1, 0)
                shift = hub + np.array([0.0, 0.015 * side, 0.0])
                pieces.append(
                    quad(tyre, shift + inner[first], inner[second] - inner[first], outer[first] - inner[first])
                )
                pieces[-1] = _facing(pieces[-1], side)
        pieces.append(box(part("chrome"), (x, 0, 0.34), (0.012, 0.012, 0.6), ALL_FACES))
        pieces.append(box(part("chrome"), (x, 0, 0.34), (0.6, 0.012, 0.012), ALL_FACES))
    bars = [((-0.52, 0.34), (0.0, 0.36)), ((0.0, 0.36), (0.42, 0.82)), ((-0.2, 0.84), (0.42, 0.82))]
    bars += [((0.0, 0.36), (-0.22, 0.92)), ((-0.52, 0.34), (-0.2, 0.84)), ((0.52, 0.34), (0.40, 0.98))]
    for (x0, z0), (x1, z1) in bars:
        along = np.array([x1 - x0, 0.0, z1 - z0])
        thick = 0.035 * np.array([-along[2], 0.0, along[0]]) / np.linalg.norm(along)
        pieces.append(quad(frame, (x0, -0.018, z0), along, thick))
        pieces.append(quad(frame, (x1, 0.018, z1), -along, thick))
    pieces.append(box(part("rubber"), (-0.23, 0, 0.95), (0.26, 0.12, 0.05), ALL_FACES))
    pieces.append(box(part("chrome"), (0.36, 0, 1.0), (0.05, 0.56, 0.03), ALL_FACES))
    return tuple(pieces)


def _facing(shape: Shape, side: int) -> Shape:
    normal = np.tile([0.0, float(side), 0.0], (len(shape.points), 1))
    wound = np.cross(shape.points[1] - shape.points[0], shape.points[2] - shape.points[0])[1]
    faces = shape.faces if wound * side > 0 else shape.faces[:, ::-1]
    return Shape(shape.material, shape.points, normal, shape.uv, np.ascontiguousarray(faces))


def bicycle_stand(rng: np.random.Generator, count: int = 4) -> Piece:
    """Bicycles side by side along y, leaning on hoops."""
    paints = ("paint-red", "paint-blue", "paint-green", "paint-silver", "paint-black", "paint-yellow")
    pieces: list[Shape] = []
    for k in range(count):
        y = 0.75 * (k - 0.5 * (count - 1))
        pieces += moved(bicycle(str(rng.choice(paints))), float(rng.uniform(-0.1, 0.1)), y)
        pieces += [box(part("steel"), (x, y + 0.2, 0.4), (0.05, 0.05, 0.8)) for x in (-0.3, 0.3)]
        pieces.append(box(part("steel"), (0, y + 0.2, 0.8), (0.65, 0.05, 0.05), ALL_FACES))
    return tuple(pieces)


def lamp_post(height: float = 4.6, reach: float = 0.9) -> Piece:
    """A street lamp with an arm along +y; its bulb shines."""
    iron = part("steel-dark")
    return (
        cylinder(iron, (0, 0, 0), 0.13, 0.7, 8, 0.09),
        cylinder(iron, (0, 0, 0.7), 0.06, height - 0.7, 8, 0.045),
        box(iron, (0, 0.5 * reach, height), (0.07, reach, 0.07), ALL_FACES),
        box(iron, (0, reach, height), (0.3, 0.62, 0.1)),
        box(lit("warm"), (0, reach, height - 0.08), (0.24, 0.52, 0.08), ALL_FACES),
    )


def sign_post(face: str = "sign-parking") -> Piece:
    """A road sign that faces -x."""
    plate = quad(part(face), (-0.045, 0.3, 2.0), (0, -0.6, 0), (0, 0, 0.6))
    rear = quad(part("steel"), (0.045, -0.3, 2.0), (0, 0.6, 0), (0, 0, 0.6))
    return (cylinder(part("steel"), (0, 0, 0), 0.035, 2.6, 6), plate, rear)


def fountain() -> Piece:
    """A round basin with water and a column."""
    stone = part("stone")
    return (
        cylinder(stone, (0, 0, 0), 1.7, 0.55, 16, 1.65),
        cylinder(part("paint-blue"), (0, 0, 0.551), 1.45, 0.004, 16),
        cylinder(stone, (0, 0, 0.5), 0.3, 1.1, 10, 0.18),
        cylinder(stone, (0, 0, 1.6), 0.35, 0.14, 12, 0.75),
        cylinder(part("paint-blue"), (0, 0, 1.741), 0.62, 0.004, 12),
        blob(stone, (0, 0, 2.0), (0.2, 0.2, 0.3), np.random.default_rng(0), 0.05, 8),
    )


def wheel_disc(radius: float, width: float) -> Piece:
    """A wheel that rolls along x: its disc faces -y."""
    tread = cylinder(part("rubber"), (0, 0, -0.5 * width), radius, width, 12)
    disc = cylinder(part("wheel"), (0, 0, 0.5 * width), radius, 0.005, 12)
    return tipped((tread, disc))


def signboard(index: int) -> Piece:
    """An A-board with a poster on both sides, 0.8 x 1.2 m, that faces -y and +y."""
    rim = part("wood-dark")
    front = quad(poster(index), (-0.4, -0.24, 0.08), (0.8, 0, 0), (0, 0.2, 1.12))
    back = quad(poster(index + 3), (0.4, 0.24, 0.08), (-0.8, 0, 0), (0, -0.2, 1.12))
    sides = [box(rim, (s * 0.42, 0, 0.62), (0.04, 0.3, 1.24)) for s in (-1, 1)]
    return (front, back, *sides)
