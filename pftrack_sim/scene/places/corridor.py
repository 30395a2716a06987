"""A long corridor with a lobby half way: doors, notice boards, radiators, lamp panels."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from pftrack_sim.core.random_streams import pick
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.places.builder import LooseProp, PlaceBuilder, bounding_box
from pftrack_sim.scene.places.catalogue import load_prop
from pftrack_sim.scene.places.fixed import FixedProp
from pftrack_sim.scene.places.materials import texture, tiling
from pftrack_sim.scene.places.meshes import Prop, box, quad, translated
from pftrack_sim.scene.places.props import framed_poster, lockers, numbered_door, potted_plant

_WEST, _EAST, _HALF_WIDTH, _CEILING = -6.0, 38.0, 1.75, 2.8
_LOBBY_WEST, _LOBBY_EAST, _LOBBY_HALF_WIDTH = 14.0, 21.0, 4.25
_LOBBY_X = 0.5 * (_LOBBY_WEST + _LOBBY_EAST)
BOUNDS = (_WEST, -_LOBBY_HALF_WIDTH, _EAST, _LOBBY_HALF_WIDTH)
GOALS = ((-4.5, 0.6), (-4.5, -0.6), (5.0, -0.7), (9.0, 0.7), (15.5, 2.2), (15.5, -2.2), (19.5, 2.2), (19.5, -2.2),
         (26.0, 0.7), (30.0, -0.7), (36.5, 0.6), (36.5, -0.6))  # fmt: skip
_LAMPS_X = (-3.0, 4.0, 11.0, 17.5, 25.0, 33.0)
_DOORS_X = (-3.6, 1.6, 6.8, 12.0, 23.4, 28.6, 33.8)
_LOCKERS = ((4.3, -1.0, "steel-blue"), (26.0, 1.0, "paint-green"), (-1.0, 1.0, "fabric-red"))

_LONG_WALLS = (("north", 1.0, 0.0, 0.0), ("south", -1.0, np.pi, 1.1))
"""Name, sign of y, yaw of props on the wall, and their shift along x, so that doors do not face each other."""


def build_corridor(builder: PlaceBuilder) -> WalkableArea:
    """Build the corridor; the sun does not reach it."""
    builder.add_fixed(_floor_and_ceiling)
    builder.add_fixed(_walls)
    builder.add_fixed(_doors)
    _add_wall_props(builder)
    _add_fixed_props(builder)
    builder.add_loose(_loose_props(builder.rng), (0.12, 0.03))
    # The sum of all panels, as a distant light: soft shadows right under people.
    area, sun, lamps = (16.0, 0.0, 23.0), (0.62, 0.57, 0.47), (0.20, 0.20, 0.19)
    builder.add_ceiling_light(BOUNDS, _CEILING + 0.1, area, sun, (0.06, 0.10, -1.0), lamps)
    positions = [(x, 0.0, _CEILING - 0.15) for x in _LAMPS_X]
    builder.add_lamps(positions, (0.66, 0.64, 0.58), 80.0, (1.0, 0.06, 0.06), exponent=0.7)
    builder.set_ambient_light((0.43, 0.43, 0.42))
    return builder.finish(BOUNDS, GOALS)


def _floor_and_ceiling() -> Iterator[FixedProp]:
    """Floor and ceiling, subdivided for the light of the lamps."""
    length, width = _EAST - _WEST, 2 * _LOBBY_HALF_WIDTH
    floor = quad(tiling("linoleum"), (_WEST, -_LOBBY_HALF_WIDTH, 0), (length, 0, 0), (0, width, 0), (58, 12))
    yield FixedProp("floor", (floor,), casts_shadow=False)
    ceiling_corner = (_WEST, _LOBBY_HALF_WIDTH, _CEILING)
    meshes = [quad(tiling("ceiling"), ceiling_corner, (length, 0, 0), (0, -width, 0), (29, 6))]
    panels = [(float(x), 0.0) for x in np.arange(_WEST + 1.5, _EAST, 2.333)]
    panels += [(x, y) for x in (_LOBBY_WEST + 1.2, _LOBBY_EAST - 1.2) for y in (-2.9, 2.9)]
    for x, y in panels:
        meshes += translated(load_prop("ceiling-panel"), x, y, _CEILING)
    yield FixedProp("ceiling", meshes, casts_shadow=False)


def _walls() -> Iterator[FixedProp]:
    half_depth = 0.5 * (_LOBBY_HALF_WIDTH - _HALF_WIDTH)
    for row, side, _, _ in _LONG_WALLS:
        for column, start, end, lobby in (("west", _WEST, _LOBBY_WEST, 1.0), ("east", _LOBBY_EAST, _EAST, -1.0)):
            half = 0.5 * (end - start)
            position, collider = (start + half, side * (_HALF_WIDTH + half_depth)), (half, half_depth, _CEILING)
            yield FixedProp(f"wall-{row}-{column}", _wall_block(half, half_depth, side, lobby), position, 0.0, collider)
        lobby_wall = _lobby_wall(_LOBBY_EAST - _LOBBY_WEST, side)
        yield FixedProp(f"wall-lobby-{row}", lobby_wall, (_LOBBY_X, side * _LOBBY_HALF_WIDTH))
    for name, x, side in (("wall-east", _EAST, -1.0), ("wall-west", _WEST, 1.0)):
        corner, edge = (0, -side * _HALF_WIDTH, 0), (0, side * 2 * _HALF_WIDTH, 0)
        yield FixedProp(name, (quad(tiling("corridor-wall"), corner, edge, (0, 0, _CEILING), (6, 4)),), (x, 0.0))


def _wall_block(half: float, depth: float, side: float, lobby: float) -> Prop:
    """The two visible walls of a block beside the corridor: one along it, one towards the lobby."""
    wall, up, cells = tiling("corridor-wall"), (0, 0, _CEILING), (max(2, round(2 * half / 0.75)), 4)
    return (
        quad(wall, (-side * half, -side * depth, 0), (side * 2 * half, 0, 0), up, cells),
        quad(wall, (lobby * half, -lobby * depth, 0), (0, lobby * 2 * depth, 0), up, (4, 4)),
        box(texture("wood-dark"), (0, -side * (depth + 0.01), 0.05), (2 * half, 0.03, 0.1)),
    )


def _lobby_wall(length: float, side: float) -> Prop:
    """A wall at y = 0 that faces the middle of the lobby."""
    wall = quad(tiling("corridor-wall"), (-side * 0.5 * length, 0, 0), (side * length, 0, 0), (0, 0, _CEILING), (10, 4))
    return (wall, box(texture("wood-dark"), (0, -side * 0.01, 0.05), (length, 0.03, 0.1)))


def _doors() -> Iterator[FixedProp]:
    leaves = ("door-wood", "door-window", "door-wood", "door-red")
    for index, x in enumerate(_DOORS_X):
        for row, side, yaw, shift in _LONG_WALLS:
            prop = numbered_door(leaves[(index + int(side < 0)) % 4], index)
            position = (x + shift, side * _HALF_WIDTH)
            yield FixedProp(f"door-{row}-{index + 1}", prop, position, yaw, casts_shadow=False)
    glazed = load_prop("door", leaf="door-window")
    for name, x, yaw in (("east", _EAST, -0.5 * np.pi), ("west", _WEST, 0.5 * np.pi)):
        for half, y in (("left", 0.5), ("right", -0.5)):
            yield FixedProp(f"door-{name}-{half}", glazed, (x, y), yaw, casts_shadow=False)
    for index, x in enumerate((_LOBBY_WEST - 1.0, _LOBBY_EAST + 1.0, 35.0)):
        yield FixedProp(f"exit-sign-{index + 1}", load_prop("exit-sign"), (x, 0.0, _CEILING - 0.55), casts_shadow=False)


def _add_wall_props(builder: PlaceBuilder) -> None:
    """Add random posters and notice boards between the doors, with radiators and extinguishers in turn."""
    rng = builder.rng
    between = [0.5 * (a + b) for a, b in pairwise(_DOORS_X) if b - a < 6.0] + [36.2]
    for index, middle in enumerate(between):
        for row, side, yaw, shift in _LONG_WALLS:
            x, y, number = middle + shift, side * _HALF_WIDTH, f"{row}-{index + 1}"
            if x > _EAST - 1.4:
                continue
            picture = int(rng.choice([7, 15])) if rng.random() < 0.3 else int(rng.integers(16))
            width = 1.5 if picture % 8 == 7 else float(rng.choice([0.7, 0.8, 0.95]))
            prop = framed_poster(picture, width, 1.0 if width > 1.0 else 1.3 * width, 1.2)
            offset = float(rng.uniform(-0.35, 0.35))
            builder.add(f"poster-{number}", prop, (x + offset, y), yaw, casts_shadow=False)
            if (index + (side > 0)) % 2:
                builder.add(f"radiator-{number}", load_prop("radiator"), (x, y), yaw)
            else:
                builder.add(f"extinguisher-{number}", load_prop("extinguisher"), (x + 1.15, y), yaw, casts_shadow=False)


def _add_fixed_props(builder: PlaceBuilder) -> None:
    """Add lockers and the fixed furniture of the lobby; its posters are drawn."""
    for index, (x, side, paint) in enumerate(_LOCKERS):
        prop, yaw = lockers(paint), 0.0 if side > 0 else np.pi
        builder.add(f"lockers-{index + 1}", prop, (x, side * (_HALF_WIDTH - 0.19)), yaw, bounding_box(prop))
    north, south = _LOBBY_HALF_WIDTH, -_LOBBY_HALF_WIDTH
    machine, case = load_prop("vending-machine"), load_prop("bookcase")
    builder.add("vending-machine", machine, (_LOBBY_EAST - 0.8, north - 0.42), collider=bounding_box(machine))
    builder.add("bookcase", case, (_LOBBY_WEST + 1.0, south + 0.2), np.pi, collider=bounding_box(case))
    for index, (x, y, yaw) in enumerate(((_LOBBY_X, north, 0.0), (_LOBBY_X + 0.9, south, np.pi))):
        prop = framed_poster(int(builder.rng.choice([7, 15])), 2.4, 1.2, 1.15)
        builder.add(f"notice-board-{index + 1}", prop, (x, y), yaw, casts_shadow=False)
    for index, (x, y, yaw) in enumerate(((_LOBBY_X + 2.6, south, np.pi), (_LOBBY_X - 2.4, north, 0.0))):
        prop = framed_poster(int(builder.rng.integers(16)), 0.9, 1.25, 1.1)
        builder.add(f"lobby-poster-{index + 1}", prop, (x, y), yaw, casts_shadow=False)


def _loose_props(rng: np.random.Generator) -> list[LooseProp]:
    north, south = _LOBBY_HALF_WIDTH, -_LOBBY_HALF_WIDTH

    def random_couch() -> Prop:
        return load_prop("couch", cloth=pick(rng, ("fabric-blue", "fabric-red", "fabric-green")))

    return [
        LooseProp("couch", (_LOBBY_X - 0.3, north - 0.45, 0.0), random_couch()),
        LooseProp("couch", (_LOBBY_X + 0.9, south + 0.45, np.pi), random_couch()),
        LooseProp("table", (_LOBBY_X - 0.3, north - 1.25, 0.0), load_prop("low-table")),
        potted_plant(rng, _LOBBY_WEST + 0.45, north - 0.5, 1.6),
        potted_plant(rng, _LOBBY_EAST - 0.5, south + 0.5, 1.4),
        potted_plant(rng, _LOBBY_WEST + 0.4, -2.55, 1.2),
        potted_plant(rng, -5.5, 1.3, 1.5),
        potted_plant(rng, 37.5, -1.3, 1.6),
        LooseProp("bin", (_LOBBY_EAST - 1.8, north - 0.4, 0.0), load_prop("litter-bin")),
        LooseProp("bin", (13.2, -1.45, 0.0), load_prop("litter-bin")),
        LooseProp("bench", (9.4, 1.5, 0.0), load_prop("narrow-bench")),
        LooseProp("bench", (31.2, 1.5, 0.0), load_prop("narrow-bench")),
    ]
