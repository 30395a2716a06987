"""A large station hall: round columns, shops along the walls, rows of seats, ticket machines, a glazed roof."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pftrack_sim.core.random_streams import pick
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.places.builder import LooseProp, PlaceBuilder
from pftrack_sim.scene.places.catalogue import load_prop
from pftrack_sim.scene.places.fixed import FixedProp
from pftrack_sim.scene.places.materials import texture, tiling
from pftrack_sim.scene.places.meshes import ALL_FACES, SIDES, Prop, box, quad
from pftrack_sim.scene.places.props import advertising_column, framed_poster, planter, potted_plant, signboard

BOUNDS = (-6.0, -12.0, 36.0, 12.0)
GOALS = ((-4.5, 8.5), (-4.5, -8.5), (-4.0, 1.1), (6.0, 9.5), (6.0, -9.5), (14.0, 9.2), (14.0, -9.2), (26.2, 9.5),
         (22.0, -9.5), (29.0, 8.8), (29.0, -9.0), (34.0, 2.0), (34.0, -4.0))  # fmt: skip
_LEFT, _LOW, _RIGHT, _HIGH = BOUNDS[0] - 0.4, BOUNDS[1] - 0.4, BOUNDS[2] + 0.4, BOUNDS[3] + 0.4
_LENGTH, _WIDTH, _ROOF, _SHOPS_M = _RIGHT - _LEFT, _HIGH - _LOW, 7.0, 3.6
_COLUMNS_X, _COLUMNS_Y = (-2.0, 4.0, 10.0, 16.0, 22.0, 28.0, 34.0), (-6.2, 6.2)
_LAMPS = ((0.0, 0.0), (8.0, 0.0), (16.0, 0.0), (24.0, 0.0), (32.0, 0.0))
_COUCHES = ((7.0, 4.2, 0.0), (13.0, 4.2, 0.0), (19.0, 4.4, 0.0), (10.0, -5.0, np.pi), (25.0, -4.8, np.pi))


def build_hall(builder: PlaceBuilder) -> WalkableArea:
    """Build the hall; the sun reaches it through its roof only."""
    builder.add_fixed(_floor_and_roof)
    builder.add_fixed(_walls)
    _add_posters(builder)
    builder.add_fixed(_columns)
    column = advertising_column(int(builder.rng.integers(16)))
    builder.add("advertising-column", column, (17.0, -4.4), collider=(0.7, 0.7, 3.2))
    builder.add_fixed(_machines)
    builder.add_loose(_loose_props(builder.rng), (0.15, 0.12, 0.05))
    area, sun, lamps = (15.0, 0.0, 23.0), (0.66, 0.62, 0.54), (0.24, 0.24, 0.23)
    builder.add_ceiling_light(BOUNDS, _ROOF + 0.1, area, sun, (0.18, 0.30, -1.0), lamps)
    builder.add_fill_light("lamp-fill", (-0.6, -0.7, -0.3), (0.13, 0.13, 0.13))
    positions = [(x, y, _ROOF - 0.6) for x, y in _LAMPS]
    builder.add_lamps(positions, (0.62, 0.58, 0.50), 76.0, (1.0, 0.03, 0.02), exponent=1.0)
    builder.set_ambient_light((0.39, 0.38, 0.37))
    return builder.finish(BOUNDS, GOALS)


def _floor_and_roof() -> Iterator[FixedProp]:
    dark, yellow = texture("steel-dark"), texture("paint-yellow")
    floor = [quad(tiling("terrazzo"), (_LEFT, _LOW, 0), (_LENGTH, 0, 0), (0, _WIDTH, 0), (44, 26))]
    floor += [quad(dark, (_LEFT, y - 0.2, 0.003), (_LENGTH, 0, 0), (0, 0.4, 0), (44, 1)) for y in _COLUMNS_Y]
    floor += [quad(dark, (x - 0.15, _COLUMNS_Y[0], 0.003), (0.3, 0, 0), (0, 12.4, 0), (1, 13)) for x in _COLUMNS_X]
    floor += [quad(yellow, (_LEFT, -0.2, 0.004), (_LENGTH, 0, 0), (0, 0.3, 0), (44, 1))]
    yield FixedProp("floor", floor, casts_shadow=False)
    steel = texture("steel")
    roof = [
        quad(tiling("roof"), (_LEFT, _HIGH, _ROOF), (_LENGTH, 0, 0), (0, -_WIDTH, 0), (22, 12)),
        *(box(steel, (x, 0, _ROOF - 0.3), (0.22, _WIDTH, 0.5), ALL_FACES) for x in _COLUMNS_X),
        *(box(steel, (15.0, y, _ROOF - 0.2), (_LENGTH, 0.16, 0.3), ALL_FACES) for y in (-9.0, *_COLUMNS_Y, 0.0, 9.0)),
        *(
            quad(texture("lamp-panel"), (x - 1.2, y + 0.3, _ROOF - 0.4), (2.4, 0, 0), (0, -0.6, 0))
            for x in (1.0, 7.0, 13.0, 19.0, 25.0, 31.0)
            for y in (-8.0, -3.0, 3.0, 8.0)
        ),
    ]
    yield FixedProp("roof", roof, casts_shadow=False)


def _walls() -> Iterator[FixedProp]:
    """Shops below and windows above on the long walls, and doors at both ends."""
    x, y, east, west = 0.5 * (_LEFT + _RIGHT), 0.5 * (_LOW + _HIGH), -0.5 * np.pi, 0.5 * np.pi
    gate = load_prop("gate")
    for name, prop, position, yaw in (
        ("wall-north", _front(_LENGTH, 0), (x, _HIGH), 0.0),
        ("wall-south", _front(_LENGTH, 2), (x, _LOW), np.pi),
        ("wall-east", _front(_WIDTH, 3), (_RIGHT, y), east),
        ("wall-west", _front(_WIDTH, 1), (_LEFT, y), west),
        ("gate-1", gate, (_RIGHT, 2.6), east),
        ("gate-2", gate, (_LEFT, -2.6), west),
    ):
        yield FixedProp(name, prop, position, yaw, casts_shadow=False)


def _add_posters(builder: PlaceBuilder) -> None:
    """Add random posters at the eastern end."""
    for k, y in enumerate((-1.2, 6.4, -7.0)):
        poster = framed_poster(int(builder.rng.integers(16)), 1.3, 1.7, 1.0)
        builder.add(f"poster-{k + 1}", poster, (_RIGHT - 0.02, y), -0.5 * np.pi, casts_shadow=False)


def _front(length: float, first: int) -> Prop:
    """Shop fronts up to 3.6 m, a ledge with signs, and windows up to the roof, facing -y at y = 0."""
    count = max(2, round(length / 12.0))
    step, start, upper = length / count, -0.5 * length, _ROOF - _SHOPS_M
    windows = max(2, round(length / 3.0))
    pane = length / windows
    return (
        *(
            quad(texture(f"shops-{(first + k) % 4}"), (start + k * step, 0, 0), (step, 0, 0), (0, 0, _SHOPS_M), (10, 3))
            for k in range(count)
        ),
        quad(tiling("cladding"), (start, 0, _SHOPS_M), (length, 0, 0), (0, 0, upper), (windows, 3)),
        box(texture("stone"), (0, -0.15, _SHOPS_M + 0.1), (length, 0.4, 0.3), ALL_FACES),
        *(
            quad(
                texture("lamp-cold"), (start + (k + 0.12) * pane, -0.03, _SHOPS_M + 0.8), (0.76 * pane, 0, 0), (0, 0, 2)
            )
            for k in range(windows)
        ),
    )


def _departures() -> Prop:
    """A board that hangs across the hall, legible from both sides; the origin is at its lower edge."""
    black, white = texture("paint-black"), texture("white")
    rows = [
        box(white, (s * 0.13, y, 0.25 + 0.2 * k), (0.02, width, 0.07), SIDES)
        for s in (-1, 1)
        for k in range(6)
        for y, width in ((-1.4, 0.4), (-0.3, 1.3), (1.3, 0.3))
    ]
    hangers = [box(texture("steel"), (0, y, 2.3), (0.04, 0.04, 1.7), SIDES) for y in (-1.6, 1.6)]
    return (box(black, (0, 0, 0.75), (0.22, 4.0, 1.5), ALL_FACES), *rows, *hangers)


def _columns() -> Iterator[FixedProp]:
    """The columns and the departure boards."""
    column = load_prop("round-column")
    for row, y in enumerate(_COLUMNS_Y):
        for index, x in enumerate(_COLUMNS_X):
            yield FixedProp(f"pillar-{row * len(_COLUMNS_X) + index + 1}", column, (x, y), collider=(0.36, 0.36, _ROOF))
    for index, x in enumerate((9.0, 25.0)):
        yield FixedProp(f"departures-{index + 1}", _departures(), (x, 0.0, 3.6), casts_shadow=False)


def _machines() -> Iterator[FixedProp]:
    """The kiosk and the ticket machines."""
    yield FixedProp("kiosk-1", load_prop("kiosk"), (22.6, 8.6), collider=(1.75, 1.6, 2.8))
    for index, x in enumerate((1.0, 1.9, 2.8)):
        machine = load_prop("ticket-machine", display=f"display-{index}")
        yield FixedProp(f"ticket-machine-{index + 1}", machine, (x, 6.6), collider=(0.35, 0.25, 1.8))


def _loose_props(rng: np.random.Generator) -> list[LooseProp]:
    cloths = ("fabric-blue", "fabric-red", "fabric-green")
    items = [LooseProp("couch", pose, load_prop("couch", cloth=pick(rng, cloths))) for pose in _COUCHES]
    for x, y in ((8.6, 4.4), (28.0, 5.0), (28.0, -5.0), (4.0, -5.0)):
        items.append(potted_plant(rng, x, y, float(rng.uniform(1.3, 1.8))))
    for pose in ((13.0, -6.4, 0.0), (31.0, 6.0, 0.0)):
        items.append(LooseProp("planter", pose, planter(rng, "leaves-light")))
    items += [
        LooseProp("bin", (x, y, 0.0), load_prop("litter-bin")) for x, y in ((5.0, 4.6), (20.6, 4.8), (22.8, -5.0))
    ]
    return [
        *items,
        LooseProp("board", (12.0, 7.6, 0.3), signboard(int(rng.integers(16)))),
        LooseProp("board", (31.0, -6.4, -0.3), signboard(int(rng.integers(16)))),
        LooseProp("machine", (-5.2, 4.6, 0.5 * np.pi), load_prop("vending-machine")),
    ]
