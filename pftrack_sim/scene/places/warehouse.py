"""A warehouse: racks full of cartons, steel pillars, pallets, a forklift, lamps high up."""

from __future__ import annotations

import numpy as np

from pftrack_sim.scenario.model import Lights
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.places import indoors, vehicles
from pftrack_sim.scene.places.shapes import ALL_FACES, Piece, Shape, box, quad
from pftrack_sim.scene.places.stage import Stage, standing
from pftrack_sim.scene.places.surfaces import Cell, part, tiles

BOUNDS = (-5.0, -12.0, 33.0, 12.0)
ROOF = 6.4
PILLARS_X = (-1.0, 5.0, 11.0, 17.0, 23.0, 29.0)
RACKS_X = (1.6, 9.6, 17.6, 25.6)
GOALS = (
    (-3.6, 2.2),
    (-3.6, -2.2),
    (-3.8, 7.2),
    (-3.8, -7.2),
    (5.6, 7.2),
    (13.6, 7.7),
    (21.6, -7.2),
    (13.6, -7.2),
    (31.2, 7.2),
    (31.2, -7.2),
    (31.4, 1.6),
    (15.0, -2.4),
    (21.6, 2.6),
)
_LAMPS = ((0.5, 0.0), (8.0, 0.0), (15.5, 0.0), (23.0, 0.0), (30.5, 0.0))


def build_warehouse(stage: Stage, lights: Lights) -> WalkableArea:
    """Build the warehouse; the sun does not reach it."""
    _shell(stage)
    _pillars(stage)
    _racks(stage)
    _loose(stage)
    stage.enclose(BOUNDS)
    stage.beam("lamp-above", (0.22, 0.42, -1.0), (0.27, 0.27, 0.26), (14.0, 0.0, 0.0, 21.0))
    # Light thrown back by floor and walls: it shapes what faces north.
    stage.fill("lamp-fill", (-0.5, -0.8, -0.25), (0.14, 0.14, 0.15))
    for index, (x, y) in enumerate(_LAMPS):
        stage.lamp(f"lamp-{index + 1}", (x, y, ROOF - 1.2), (0.70, 0.69, 0.62), 74.0, (1.0, 0.03, 0.025), exponent=1.2)
    stage.sky_light((0.36, 0.36, 0.37))
    return stage.finish(BOUNDS, GOALS)


def _shell(stage: Stage) -> None:
    left, low, right, high = (BOUNDS[0] - 0.4, BOUNDS[1] - 0.4, BOUNDS[2] + 0.4, BOUNDS[3] + 0.4)
    long, wide = right - left, high - low
    floor = quad(tiles("concrete"), (left, low, 0), (long, 0, 0), (0, wide, 0), (44, 28))
    yellow, white = part("paint-yellow"), part("white")
    lines = [_stripe(yellow, -3.5, y, 35.0, 0.12) for y in (-3.5, 3.5)]
    lines += [_stripe(white, x + 1.2, 0.0, 0.7, 0.16) for x in PILLARS_X]
    lines += [_stripe(part("hazard"), RACKS_X[k] + 3.1, s * 5.0, 1.8, 0.3) for k in range(3) for s in (-1, 1)]
    lines += [quad(yellow, (x, -6.5, 0.003), (0.12, 0, 0), (0, 13.0, 0)) for x in (-3.1, 31.0)]
    stage.put("floor", (floor, *lines), casts_shadow=False)
    roof = quad(tiles("roof"), (left, high, ROOF), (long, 0, 0), (0, -wide, 0), (19, 12))
    steel = part("steel-dark")
    beams: list[Shape] = [box(steel, (x, 0, ROOF - 0.3), (0.16, wide, 0.4), ALL_FACES) for x in PILLARS_X]
    beams += [box(steel, (14.0, y, ROOF - 0.14), (long, 0.1, 0.2), ALL_FACES) for y in (-9.0, -4.5, 0.0, 4.5, 9.0)]
    beams += [box(part("chrome"), (14.0, y, ROOF - 0.75), (long, 0.35, 0.35), ALL_FACES) for y in (-2.6,)]
    stage.put("roof", (roof, *beams), casts_shadow=False)
    for index, (x, y) in enumerate(
        [*_LAMPS, (12.0, 7.0), (12.0, -7.0), (21.5, 7.0), (21.5, -7.0), (2.0, 7.0), (2.0, -7.0)]
    ):
        stage.put(f"high-bay-{index + 1}", indoors.high_bay_lamp(), (x, y, ROOF - 1.3), casts_shadow=False)
    walls = (
        ("wall-north", (0.5 * (left + right), high), 0.0, long),
        ("wall-south", (0.5 * (left + right), low), np.pi, long),
        ("wall-east", (right, 0.5 * (low + high)), -0.5 * np.pi, wide),
        ("wall-west", (left, 0.5 * (low + high)), 0.5 * np.pi, wide),
    )
    for name, at, yaw, length in walls:
        stage.put(name, _wall(length), at, yaw, casts_shadow=False)
    _wall_things(stage, left, right)


def _stripe(skin: Cell, x: float, y: float, length: float, width: float) -> Shape:
    return quad(skin, (x, y - 0.5 * width, 0.003), (length, 0, 0), (0, width, 0))


def _wall(length: float) -> Piece:
    """Brick to 2.6 m, sheet metal above; faces -y at y = 0."""
    cells = round(length / 1.2)
    split = 2.6
    lower = quad(tiles("brick"), (-0.5 * length, 0, 0), (length, 0, 0), (0, 0, split), (cells, 3))
    upper = quad(tiles("cladding"), (-0.5 * length, 0, split), (length, 0, 0), (0, 0, ROOF - split), (cells // 2, 3))
    ledge = box(part("concrete"), (0, -0.05, split), (length, 0.14, 0.16), ALL_FACES)
    return (lower, upper, ledge)


def _wall_things(stage: Stage, left: float, right: float) -> None:
    """Gates, doors and signs at both ends."""
    gate = (
        box(part("radiator"), (0, -0.03, 1.7), (3.6, 0.08, 3.4), ("-y", "+x", "-x", "+z")),
        *(box(part("hazard"), (s * 1.95, -0.08, 1.7), (0.25, 0.2, 3.4)) for s in (-1, 1)),
        box(part("paint-yellow"), (0, -0.08, 3.55), (4.15, 0.2, 0.3), ALL_FACES),
    )
    for index, y in enumerate((3.2, -4.2)):
        stage.put(f"gate-{index + 1}", gate, (right, y), -0.5 * np.pi, casts_shadow=False)
    stage.put("gate-3", gate, (left, 3.0), 0.5 * np.pi, casts_shadow=False)
    stage.put("door-east", indoors.door("door-red"), (right, -0.4), -0.5 * np.pi, casts_shadow=False)
    stage.put("door-west", indoors.door("door-window"), (left, -1.2), 0.5 * np.pi, casts_shadow=False)
    for index, y in enumerate((-1.9, 8.0, -8.6)):
        picture = int(stage.rng.integers(16))
        stage.put(
            f"poster-{index + 1}", indoors.framed(picture, 1.1, 1.4, 1.0), (right, y), -0.5 * np.pi, casts_shadow=False
        )
    stage.put("extinguisher", indoors.extinguisher(), (right, 0.8), -0.5 * np.pi, casts_shadow=False)


def _pillars(stage: Stage) -> None:
    for index, x in enumerate(PILLARS_X):
        stage.put(f"pillar-{index + 1}", indoors.steel_pillar(ROOF), (x, 0.0), solid=(0.23, 0.23, ROOF))


def _racks(stage: Stage) -> None:
    rows = ((4.7, 0.0), (9.6, 0.0), (-4.7, np.pi), (-9.6, np.pi))
    for row, (y, yaw) in enumerate(rows):
        for column, x in enumerate(RACKS_X):
            name = f"rack-{'ABCD'[row]}{column + 1}"
            # The rear rows' shadows fall where no camera drives, and racks are half of all triangles.
            near = abs(y) < 6.0
            stage.put(name, indoors.rack(stage.rng), (x, y), yaw, solid=(2.78, 0.55, 4.6), casts_shadow=near)
            sign = box(part("sign-aisle"), (0, 0, 2.4), (0.04, 0.6, 0.6), ("+x", "-x"))
            stage.put(f"{name}-sign", (sign,), (x + 2.85 * (1 if yaw else -1), y), casts_shadow=False)


def _loose(stage: Stage) -> None:
    rng = stage.rng
    things = [
        ("forklift", (13.6, 5.0, 0.5 * np.pi), vehicles.forklift()),
        ("stack", (5.6, -5.0, 0.5 * np.pi), indoors.carton_stack(rng, 3)),
        ("stack", (29.6, -10.6, 0.0), indoors.carton_stack(rng, 4)),
        ("stack", (29.8, 5.2, 0.5 * np.pi), indoors.carton_stack(rng, 3)),
        ("stack", (29.8, 10.4, 0.2), indoors.carton_stack(rng, 4)),
        ("stack", (-3.9, 10.4, 0.1), indoors.carton_stack(rng, 4)),
        ("stack", (-4.0, -4.6, 0.5 * np.pi), indoors.carton_stack(rng, 2)),
        ("stack", (21.6, -5.2, 0.1), indoors.carton_stack(rng, 3)),
        ("pile", (21.6, 10.0, 0.1), indoors.pallet_pile(8)),
        ("pile", (-3.9, -10.6, 0.2), indoors.pallet_pile(6)),
        ("pile", (5.6, 10.2, 0.5 * np.pi), indoors.pallet_pile(10)),
        ("drums", (13.6, -10.4, 0.0), indoors.drums(rng)),
        ("drums", (31.7, -10.6, 0.2), indoors.drums(rng)),
        ("drums", (-4.0, 4.9, 0.3), indoors.drums(rng)),
        ("trolley", (5.6, 5.4, 1.3), indoors.trolley(rng)),
        ("trolley", (21.6, 5.6, 1.8), indoors.trolley(rng)),
        ("trolley", (13.6, -5.2, 1.5), indoors.trolley(rng)),
    ]
    shifts = rng.uniform(-1.0, 1.0, (len(things), 3)) * (0.12, 0.18, 0.1)
    for index in stage.kept(len(things)):
        kind, (x, y, yaw), piece = things[index]
        dx, dy, turn = shifts[index]
        stage.put(f"{kind}-{index + 1}", piece, (x + dx, y + dy), yaw + turn, solid=standing(piece))
