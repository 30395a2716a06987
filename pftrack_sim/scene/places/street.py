"""A street at night: lamps with pools of light, shop windows, parked cars, a few lit windows."""

from __future__ import annotations

import numpy as np

from pftrack_sim.scenario.model import Lights
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.places import outdoors, surfaces
from pftrack_sim.scene.places.buildings import house
from pftrack_sim.scene.places.shapes import ALL_FACES, Shape, box, quad
from pftrack_sim.scene.places.stage import Stage, standing
from pftrack_sim.scene.places.surfaces import CAR_PAINTS, lit, part, tiles
from pftrack_sim.scene.places.vehicles import car, van

WEST, EAST, KERB, FRONT = -10.0, 44.0, 3.0, 7.8
BOUNDS = (-8.0, -7.2, 42.0, 7.2)
GOALS = (
    (-6.5, 5.6),
    (-6.5, -5.6),
    (-6.5, 0.5),
    (7.5, 6.3),
    (16.5, 6.3),
    (12.0, -5.6),
    (26.0, 5.2),
    (22.0, -5.6),
    (33.0, -5.6),
    (40.5, 5.6),
    (40.5, -5.6),
    (40.5, 0.5),
)
_LAMPS = ((0.5, 1.0), (10.5, 1.0), (20.5, 1.0), (30.5, 1.0), (5.5, -1.0), (25.5, -1.0))
"""x, and the side of the street: +1 is north."""
_DARK_LAMPS = ((-7.0, 1.0), (40.5, 1.0), (15.5, -1.0), (36.0, -1.0), (-4.5, -1.0))
"""Lamps too far away to light anyone: OpenGL has eight lights."""


def build_street(stage: Stage, lights: Lights) -> WalkableArea:
    """Build the street; the sun has set."""
    surfaces.add_sky(stage.spec, "sky-night")
    _ground(stage)
    _houses(stage)
    _lamp_posts(stage)
    _parked(stage)
    _loose(stage)
    stage.enclose(BOUNDS)
    for index, (x, side) in enumerate(_LAMPS):
        stage.lamp(
            f"lamp-{index + 1}",
            (x, side * (KERB + 1.45), 4.4),
            (1.75, 1.32, 0.78),
            56.0,
            (1.0, 0.08, 0.04),
            shadow=index == 1,
            exponent=4.0,
        )
    stage.fill("moon", (0.35, 0.5, -0.7), (0.12, 0.13, 0.165))
    stage.sky_light((0.19, 0.19, 0.22))
    return stage.finish(BOUNDS, GOALS)


def _ground(stage: Stage) -> None:
    length = EAST - WEST
    road = quad(tiles("asphalt"), (WEST, -KERB, 0), (length, 0, 0), (0, 2 * KERB, 0), (54, 6))
    ends = [quad(tiles("asphalt"), (x, -KERB, 0), (14, 0, 0), (0, 2 * KERB, 0)) for x in (WEST - 14.0, EAST)]
    dashes = [quad(part("white"), (x, -0.07, 0.003), (2.0, 0, 0), (0, 0.14, 0)) for x in np.arange(-6.0, 42.0, 4.5)]
    zebra = [quad(part("white"), (15.6, y, 0.003), (3.2, 0, 0), (0, 0.5, 0)) for y in np.arange(-2.75, 2.6, 1.0)]
    stage.put("road", (road, *ends, *dashes, *zebra), casts_shadow=False)
    for side, name in ((1.0, "north"), (-1.0, "south")):
        near = side * KERB
        low = near if side > 0 else -FRONT
        walk = quad(tiles("pavement"), (WEST, low, 0.0), (length, 0, 0), (0, FRONT - KERB, 0), (66, 6))
        more = [
            quad(tiles("pavement"), (x, low, 0.0), (14, 0, 0), (0, FRONT - KERB, 0), (4, 2))
            for x in (WEST - 14.0, EAST)
        ]
        kerb = quad(part("stone"), (WEST - 14, near - 0.12, 0.003), (length + 28, 0, 0), (0, 0.24, 0), (82, 1))
        stage.put(f"pavement-{name}", (walk, *more, kerb), casts_shadow=False)


def _houses(stage: Stage) -> None:
    """Fronts on both sides and across both ends. Which windows are lit is fixed: it is part of the street."""
    rng = np.random.default_rng(23)
    north = (("brick", 0, "awning-red"), ("cream", 1, None), ("rose", 2, "awning-green"), ("office", 3, None),
             ("brick", 1, "awning-sand"))  # fmt: skip
    south = (("office", 2, None), ("rose", 3, "awning-blue"), ("brick", 0, None), ("cream", 1, "awning-red"),
             ("rose", 0, None))  # fmt: skip
    for index, (kind, shop, cloth) in enumerate(north):
        stage.put(
            f"house-north-{index + 1}",
            house(kind, shop, cloth, index % 2 == 1, 3, rng, finely=True),
            (-12.0 + 12.0 * index, FRONT),
        )
    for index, (kind, shop, cloth) in enumerate(south):
        piece = house(kind, shop, cloth, index % 2 == 0, 3, rng, finely=True)
        stage.put(f"house-south-{index + 1}", piece, (48.0 - 12.0 * index, -FRONT), np.pi)
    for index, (x, kind) in enumerate(((-24.0, "rose"), (48.0, "cream"))):
        stage.put(f"house-north-{index + 6}", house(kind, index, None, False, 3, rng), (x, FRONT))
        stage.put(f"house-south-{index + 6}", house(kind, index + 2, None, False, 3, rng), (x + 12.0, -FRONT), np.pi)
    for index, y in enumerate((12.0, 0.0)):
        stage.put(f"house-east-{index + 1}", house("cream", 3 - index, None, True, 3, rng), (58.0, y), -0.5 * np.pi)
        stage.put(f"house-west-{index + 1}", house("office", index, None, False, 3, rng), (-24.0, -y), 0.5 * np.pi)


def _lamp_posts(stage: Stage) -> None:
    for index, (x, side) in enumerate((*_LAMPS, *_DARK_LAMPS)):
        yaw = 0.0 if side > 0 else np.pi
        at = (x, side * (KERB + 0.4))
        stage.put(
            f"lamp-post-{index + 1}",
            outdoors.lamp_post(4.6, 1.05),
            at,
            yaw,
            solid=(0.13, 0.13, 4.6),
            casts_shadow=False,
        )


def _parked(stage: Stage) -> None:
    """Cars along the southern kerb for good; their paint is drawn per seed."""
    rng = stage.rng
    for index, x in enumerate((-3.0, 3.2, 9.4, 20.4, 27.0, 33.4, 39.0)):
        piece = van() if index == 4 else car(str(rng.choice(CAR_PAINTS)), lights=index == 2)
        yaw = np.pi if index % 3 == 1 else 0.0
        stage.put(f"car-{index + 1}", piece, (x, -KERB + 1.1), yaw, solid=standing(piece))
    for index, (x, y) in enumerate(((50.0, -1.8), (-18.0, 1.8))):
        stage.put(f"far-car-{index + 1}", car("paint-red", lights=True), (x, y), 0.0, casts_shadow=False)


def _loose(stage: Stage) -> None:
    rng = stage.rng
    shelter: list[Shape] = [
        box(part("steel-dark"), (0, 0, 2.3), (3.0, 1.3, 0.1), ALL_FACES),
        *(box(part("steel-dark"), (x, 0.55, 1.15), (0.08, 0.08, 2.3)) for x in (-1.4, 0.0, 1.4)),
        *outdoors.bench("wood-dark"),
        quad(lit("display", 3), (-0.045, -0.6, 0.6), (0, 1.1, 0), (0, 0, 1.5)),
    ]
    things = [
        ("tree", (17.2, 3.9, 0.0), outdoors.tree(rng, 5.2), (0.68, 0.68, 2.2)),
        ("tree", (27.0, 3.9, 0.0), outdoors.tree(rng, 5.4, "leaves-light"), (0.68, 0.68, 2.2)),
        ("tree", (-1.8, 3.9, 0.0), outdoors.tree(rng, 5.0), (0.68, 0.68, 2.2)),
        ("tree", (13.0, -4.2, 0.0), outdoors.tree(rng, 5.6), (0.68, 0.68, 2.2)),
        ("tree", (31.0, -4.2, 0.0), outdoors.tree(rng, 5.2), (0.68, 0.68, 2.2)),
        ("tree", (0.8, -4.2, 0.0), outdoors.tree(rng, 5.3, "leaves-light"), (0.68, 0.68, 2.2)),
        ("shelter", (20.0, -6.2, np.pi), tuple(shelter), (1.5, 0.65, 2.35)),
        ("bench", (10.0, 7.1, 0.0), outdoors.bench("wood-dark"), None),
        ("bench", (29.5, 7.1, 0.0), outdoors.bench("wood-green"), None),
        ("bench", (5.0, -7.0, np.pi), outdoors.bench("wood-dark"), None),
        ("bin", (8.5, 7.2, 0.0), outdoors.bin_(), None),
        ("bin", (24.0, -7.1, 0.0), outdoors.bin_(), None),
        ("board", (4.2, 7.0, 0.1), outdoors.signboard(int(rng.integers(16))), None),
        ("board", (19.6, 7.0, -0.1), outdoors.signboard(int(rng.integers(16))), None),
        ("bicycles", (35.5, 6.5, 0.5 * np.pi), outdoors.bicycle_stand(rng, 3), None),
        ("column", (37.0, 4.6, 0.0), outdoors.advertising_column(int(rng.integers(16))), (0.7, 0.7, 3.2)),
    ]
    shifts = rng.uniform(-1.0, 1.0, (len(things), 2)) * (0.3, 0.08)
    for index in stage.kept(len(things)):
        kind, (x, y, yaw), piece, solid = things[index]
        dx, dy = shifts[index]
        stage.put(f"{kind}-{index + 1}", piece, (x + dx, y + dy), yaw, solid=solid or standing(piece))
