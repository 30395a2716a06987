"""A long corridor with a lobby half way: doors, notice boards, radiators, lamp panels."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pftrack_sim.scenario.model import Lights
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.places import indoors
from pftrack_sim.scene.places.outdoors import bin_
from pftrack_sim.scene.places.shapes import Piece, Shape, box, quad
from pftrack_sim.scene.places.stage import Stage, standing
from pftrack_sim.scene.places.surfaces import part, tiles

WEST, EAST, HALF, CEILING = -6.0, 38.0, 1.75, 2.8
LOBBY_WEST, LOBBY_EAST, LOBBY_HALF = 14.0, 21.0, 4.25
BOUNDS = (WEST, -LOBBY_HALF, EAST, LOBBY_HALF)
GOALS = (
    (-4.5, 0.6),
    (-4.5, -0.6),
    (5.0, -0.7),
    (9.0, 0.7),
    (15.5, 2.2),
    (15.5, -2.2),
    (19.5, 2.2),
    (19.5, -2.2),
    (26.0, 0.7),
    (30.0, -0.7),
    (36.5, 0.6),
    (36.5, -0.6),
)
_LAMPS = (-3.0, 4.0, 11.0, 17.5, 25.0, 33.0)
_LOCKERS = ((4.3, -1.0, "steel-blue"), (26.0, 1.0, "paint-green"), (-1.0, 1.0, "fabric-red"))
_DOORS = (-3.6, 1.6, 6.8, 12.0, 23.4, 28.6, 33.8)


def build_corridor(stage: Stage, lights: Lights) -> WalkableArea:
    """Build the corridor; the sun does not reach it."""
    _shell(stage)
    _doors(stage)
    _walls(stage)
    _lobby(stage)
    _loose(stage)
    stage.enclose(BOUNDS)
    # All the panels together, as seen from far: soft shadows right under people.
    stage.beam("lamp-above", (0.06, 0.10, -1.0), (0.20, 0.20, 0.19), (16.0, 0.0, 0.0, 23.0))
    for index, x in enumerate(_LAMPS):
        stage.lamp(
            f"lamp-{index + 1}", (x, 0.0, CEILING - 0.15), (0.66, 0.64, 0.58), 80.0, (1.0, 0.06, 0.06), exponent=0.7
        )
    stage.sky_light((0.43, 0.43, 0.42))
    return stage.finish(BOUNDS, GOALS)


def _shell(stage: Stage) -> None:
    """Floor, ceiling and walls, cut small enough to show the lamps."""
    length = EAST - WEST
    floor = quad(tiles("linoleum"), (WEST, -LOBBY_HALF, 0), (length, 0, 0), (0, 2 * LOBBY_HALF, 0), (58, 12))
    stage.put("floor", (floor,), casts_shadow=False)
    above = quad(tiles("ceiling"), (WEST, LOBBY_HALF, CEILING), (length, 0, 0), (0, -2 * LOBBY_HALF, 0), (29, 6))
    panels: list[Shape] = [above]
    for x in np.arange(WEST + 1.5, EAST, 2.333):
        panels += [_at(shape, float(x), 0.0) for shape in indoors.ceiling_panel()]
    for x in (LOBBY_WEST + 1.2, LOBBY_EAST - 1.2):
        for y in (-2.9, 2.9):
            panels += [_at(shape, x, y) for shape in indoors.ceiling_panel()]
    stage.put("ceiling", tuple(panels), casts_shadow=False)
    half_gap = 0.5 * (LOBBY_HALF - HALF)
    middle_y = HALF + half_gap
    for side, row in ((1.0, "north"), (-1.0, "south")):
        for start, end, column in ((WEST, LOBBY_WEST, "west"), (LOBBY_EAST, EAST, "east")):
            half = 0.5 * (end - start)
            piece = _wall_block(half, half_gap, side, 1.0 if column == "west" else -1.0)
            stage.put(f"wall-{row}-{column}", piece, (start + half, side * middle_y), solid=(half, half_gap, CEILING))
        stage.put(
            f"wall-lobby-{row}",
            _facing_wall(LOBBY_EAST - LOBBY_WEST, side),
            (0.5 * (LOBBY_WEST + LOBBY_EAST), side * LOBBY_HALF),
        )
    skin = tiles("corridor-wall")
    for name, x, along in (("wall-east", EAST, -1.0), ("wall-west", WEST, 1.0)):
        wall = quad(skin, (0, -along * HALF, 0), (0, along * 2 * HALF, 0), (0, 0, CEILING), (6, 4))
        stage.put(name, (wall,), (x, 0.0))


def _at(shape: Shape, x: float, y: float) -> Shape:
    return Shape(shape.material, shape.points + np.array([x, y, CEILING]), shape.normals, shape.uv, shape.faces)


def _wall_block(half: float, depth: float, side: float, end: float) -> Piece:
    """The two visible walls of a block beside the corridor: along it, and into the lobby."""
    skin = tiles("corridor-wall")
    cells = (max(2, round(2 * half / 0.75)), 4)
    long = quad(skin, (-side * half, -side * depth, 0), (side * 2 * half, 0, 0), (0, 0, CEILING), cells)
    short = quad(skin, (end * half, -end * depth, 0), (0, end * 2 * depth, 0), (0, 0, CEILING), (4, 4))
    skirting = box(part("wood-dark"), (0, -side * (depth + 0.01), 0.05), (2 * half, 0.03, 0.1))
    return (long, short, skirting)


def _facing_wall(length: float, side: float) -> Piece:
    """A wall that faces the middle, at y = 0."""
    skin = tiles("corridor-wall")
    wall = quad(skin, (-side * 0.5 * length, 0, 0), (side * length, 0, 0), (0, 0, CEILING), (10, 4))
    return (wall, box(part("wood-dark"), (0, -side * 0.01, 0.05), (length, 0.03, 0.1)))


def _doors(stage: Stage) -> None:
    leaves = ("door-wood", "door-window", "door-wood", "door-red")
    for index, x in enumerate(_DOORS):
        for side, row in ((1.0, "north"), (-1.0, "south")):
            shift = 0.0 if side > 0 else 1.1
            piece = indoors.door(leaves[(index + int(side < 0)) % 4], index)
            stage.put(
                f"door-{row}-{index + 1}",
                piece,
                (x + shift, side * HALF),
                0.0 if side > 0 else np.pi,
                casts_shadow=False,
            )
    for name, x, yaw in (("east", EAST, -0.5 * np.pi), ("west", WEST, 0.5 * np.pi)):
        for half, y in (("left", 0.5), ("right", -0.5)):
            stage.put(f"door-{name}-{half}", indoors.door("door-window"), (x, y), yaw, casts_shadow=False)
    for index, x in enumerate((LOBBY_WEST - 1.0, LOBBY_EAST + 1.0, 35.0)):
        stage.put(f"exit-sign-{index + 1}", indoors.hanging_sign(), (x, 0.0, CEILING - 0.55), casts_shadow=False)


def _walls(stage: Stage) -> None:
    """Posters, boards, radiators and extinguishers between the doors; which posters is drawn per seed."""
    rng = stage.rng
    between = [0.5 * (a + b) for a, b in pairwise(_DOORS) if b - a < 6.0] + [36.2]
    for index, x in enumerate(between):
        for side, row in ((1.0, "north"), (-1.0, "south")):
            yaw = 0.0 if side > 0 else np.pi
            shift = 0.0 if side > 0 else 1.1
            if x + shift > EAST - 1.4:
                continue
            picture = int(rng.choice([7, 15])) if rng.random() < 0.3 else int(rng.integers(16))
            wide = 1.5 if picture % 8 == 7 else float(rng.choice([0.7, 0.8, 0.95]))
            piece = indoors.framed(picture, wide, 1.0 if wide > 1.0 else 1.3 * wide, 1.2)
            offset = float(rng.uniform(-0.35, 0.35))
            stage.put(f"poster-{row}-{index + 1}", piece, (x + shift + offset, side * HALF), yaw, casts_shadow=False)
            if (index + (side > 0)) % 2:
                stage.put(f"radiator-{row}-{index + 1}", indoors.radiator(), (x + shift, side * HALF), yaw)
            else:
                at = (x + shift + 1.15, side * HALF)
                stage.put(f"extinguisher-{row}-{index + 1}", indoors.extinguisher(), at, yaw, casts_shadow=False)


def _lobby(stage: Stage) -> None:
    """What stands there for good."""
    for index, (x, side, paint) in enumerate(_LOCKERS):
        piece = indoors.lockers(6, paint)
        yaw = 0.0 if side > 0 else np.pi
        stage.put(f"lockers-{index + 1}", piece, (x, side * (HALF - 0.19)), yaw, solid=standing(piece))
    middle = 0.5 * (LOBBY_WEST + LOBBY_EAST)
    north, south = LOBBY_HALF, -LOBBY_HALF
    machine = indoors.vending_machine()
    stage.put("vending-machine", machine, (LOBBY_EAST - 0.8, north - 0.42), solid=standing(machine))
    case = indoors.bookcase(1.5)
    stage.put("bookcase", case, (LOBBY_WEST + 1.0, south + 0.2), np.pi, solid=standing(case))
    for index, (x, y, yaw) in enumerate(((middle, north, 0.0), (middle + 0.9, south, np.pi))):
        picture = int(stage.rng.choice([7, 15]))
        stage.put(f"notice-board-{index + 1}", indoors.framed(picture, 2.4, 1.2, 1.15), (x, y), yaw, casts_shadow=False)
    for index, (x, y, yaw) in enumerate(((middle + 2.6, south, np.pi), (middle - 2.4, north, 0.0))):
        picture = int(stage.rng.integers(16))
        stage.put(f"lobby-poster-{index + 1}", indoors.framed(picture, 0.9, 1.25, 1.1), (x, y), yaw, casts_shadow=False)


def _loose(stage: Stage) -> None:
    rng = stage.rng
    cloths = ("fabric-blue", "fabric-red", "fabric-green")
    middle = 0.5 * (LOBBY_WEST + LOBBY_EAST)
    things = [
        ("couch", (middle - 0.3, LOBBY_HALF - 0.45, 0.0), indoors.couch(str(rng.choice(cloths)))),
        ("couch", (middle + 0.9, -LOBBY_HALF + 0.45, np.pi), indoors.couch(str(rng.choice(cloths)))),
        ("table", (middle - 0.3, LOBBY_HALF - 1.25, 0.0), indoors.low_table()),
        ("plant", (LOBBY_WEST + 0.45, LOBBY_HALF - 0.5, 0.0), indoors.potted_plant(rng, 1.6)),
        ("plant", (LOBBY_EAST - 0.5, -LOBBY_HALF + 0.5, 0.0), indoors.potted_plant(rng, 1.4)),
        ("plant", (LOBBY_WEST + 0.4, -2.55, 0.0), indoors.potted_plant(rng, 1.2)),
        ("plant", (-5.5, 1.3, 0.0), indoors.potted_plant(rng, 1.5)),
        ("plant", (37.5, -1.3, 0.0), indoors.potted_plant(rng, 1.6)),
        ("bin", (LOBBY_EAST - 1.8, LOBBY_HALF - 0.4, 0.0), bin_()),
        ("bin", (13.2, -1.45, 0.0), bin_()),
        ("bench", (9.4, 1.5, 0.0), indoors.narrow_bench()),
        ("bench", (31.2, 1.5, 0.0), indoors.narrow_bench()),
    ]
    shifts = rng.uniform(-1.0, 1.0, (len(things), 2)) * (0.12, 0.03)
    for index in stage.kept(len(things)):
        kind, (x, y, yaw), piece = things[index]
        dx, dy = shifts[index]
        half_x, half_y, height = standing(piece)
        solid = (min(half_x, 0.3), min(half_y, 0.3), height) if kind == "plant" else (half_x, half_y, height)
        stage.put(f"{kind}-{index + 1}", piece, (x + dx, y + dy), yaw, solid=solid)
