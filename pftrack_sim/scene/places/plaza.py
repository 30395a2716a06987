"""A paved square on a bright day: house fronts, trees, a kiosk, cafe tables, a fountain."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pftrack_sim.core.random_streams import pick
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.places.builder import LooseProp, PlaceBuilder, bounding_box, sun_direction
from pftrack_sim.scene.places.buildings import house
from pftrack_sim.scene.places.catalogue import load_prop
from pftrack_sim.scene.places.fixed import FixedProp
from pftrack_sim.scene.places.materials import add_skybox, tiling
from pftrack_sim.scene.places.meshes import quad
from pftrack_sim.scene.places.props import (
    advertising_column,
    bicycle_stand,
    fountain,
    hedge,
    lamp_post,
    parasol_table,
    planter,
    signboard,
    tree,
)

BOUNDS = (-6.0, -15.0, 30.0, 15.0)
GOALS = ((-4.5, 5.0), (-4.0, -12.5), (-4.0, 13.0), (9.0, 13.4), (28.5, 12.5), (28.5, 1.0), (28.5, -12.5),
         (15.5, -8.2), (12.0, 6.6), (4.0, -6.0), (24.5, 4.5), (20.5, -13.5))  # fmt: skip

# Kind, shop front, awning, balconies, storeys.
_NORTH = (("cream", 0, "awning-red", True, 3), ("brick", 1, None, False, 2), ("rose", 2, "awning-green", False, 3),
          ("office", 3, None, False, 3))  # fmt: skip
_SOUTH = (("office", 2, "awning-blue", False, 2), ("rose", 3, "awning-sand", True, 3), ("brick", 0, None, False, 3),
          ("cream", 1, "awning-green", False, 2))  # fmt: skip
_EAST = (("brick", 3, "awning-blue", True, 2), ("cream", 2, "awning-red", False, 1))
_WEST = (("rose", 1, None, True, 3), ("office", 0, "awning-sand", False, 2), ("cream", 3, "awning-red", False, 3))
_FAR = (("rose", 0, "awning-blue", False, 2), ("brick", 1, "awning-red", False, 3),
        ("cream", 2, "awning-green", False, 2))  # fmt: skip


# x, y and, where there is a third number, yaw.
_TREES = ((0.0, 9.5), (7.5, 9.5), (15.0, 9.5), (27.0, 8.0), (0.0, -9.5), (9.0, -9.5), (26.0, -9.0))
_FAR_TREES = ((41.0, 3.7), (44.0, -3.8), (49.0, 3.8), (56.0, -3.8), (63.0, 3.7))
_LAMP_POSTS = ((-1.0, 13.0, np.pi), (11.5, 11.8, np.pi), (16.0, -6.9, 0.0), (24.8, 1.8, 0.0))
_BENCHES = ((3.7, 9.3, 0.0), (11.2, 9.3, 0.0), (4.5, -9.6, np.pi), (23.6, -9.0, np.pi), (-5.2, 0.4, -0.5 * np.pi))
_PLANTERS = ((-2.6, 4.2, 0.5 * np.pi), (5.6, 4.9, 0.0), (17.6, 7.2, 0.0), (7.2, -4.4, 0.0), (13.0, -6.4, 0.0),
             (26.8, -5.6, 0.5 * np.pi), (-2.8, -4.6, 0.5 * np.pi), (23.3, 12.6, 0.0))  # fmt: skip
_TABLES = ((11.5, -12.6), (14.9, -11.6), (18.0, -10.4), (7.6, -13.0))
_LITTER_BINS = ((13.4, 9.6), (2.0, -8.6), (24.8, 9.6), (20.6, -8.6), (-5.0, 8.4))


def build_plaza(builder: PlaceBuilder) -> WalkableArea:
    """Build the plaza."""
    add_skybox(builder.spec, "sky-day")
    builder.add("paving", (quad(tiling("paving"), (-40, -45, 0), (125, 0, 0), (0, 90, 0)),), casts_shadow=False)
    sun = sun_direction(builder.lights)
    builder.add_fixed(_houses, bool(sun[0] < 0.0), bool(sun[0] > 0.0), bool(sun[1] < 0.0), bool(sun[1] > 0.0))
    builder.add_fixed(_side_street)
    builder.add_fixed(_trees)
    column = advertising_column(int(builder.rng.integers(16)))
    builder.add("advertising-column", column, (11.0, -3.6), collider=(0.7, 0.7, 3.2))
    builder.add_fixed(_fixed_props)
    builder.add_loose(_loose_props(builder.rng), (0.25, 0.25, 0.12))
    builder.add_daylight(BOUNDS, (0.60, 0.57, 0.50), (13.0, 0.0, 26.0), (0.10, 0.11, 0.13), (0.37, 0.39, 0.43))
    return builder.finish(BOUNDS, GOALS)


def _houses(east: bool, west: bool, north: bool, south: bool) -> Iterator[FixedProp]:
    """The rows of houses; those cast a shadow in which direction the sun is."""
    # A row casts a shadow on the square only if the sun is behind it; every triangle costs time in the shadow pass.
    for row, houses, (x, y), (dx, dy), yaw, casts_shadow in (
        ("north", _NORTH, (-12.0, 17.5), (12.0, 0.0), 0.0, north),
        ("south", _SOUTH, (36.0, -17.5), (-12.0, 0.0), np.pi, south),
        ("east", _EAST, (36.0, 17.5), (0.0, -23.0), -0.5 * np.pi, east),
        ("west", _WEST, (-12.0, -17.5), (0.0, 12.0), 0.5 * np.pi, west),
    ):
        for index, style in enumerate(houses):
            position = (x + dx * index, y + dy * index)
            yield FixedProp(f"house-{row}-{index + 1}", house(*style), position, yaw, casts_shadow=casts_shadow)


def _side_street() -> Iterator[FixedProp]:
    """The street that leads away to the east, and the houses at its end."""
    rng = np.random.default_rng(11)
    road = quad(tiling("asphalt"), (37.0, -2.6, 0.004), (40, 0, 0), (0, 4.6, 0))
    yield FixedProp("far-road", (road,), casts_shadow=False)
    for index, style in enumerate(_FAR):
        position = (80.0, 14.0 - 12.0 * index)
        yield FixedProp(f"far-house-{index + 1}", house(*style), position, -0.5 * np.pi, casts_shadow=False)
    for index, x in enumerate((48.0, 60.0)):
        left, right = house("office", 3, storeys=2), house("rose", 1, balconies=True, storeys=2)
        yield FixedProp(f"far-house-{index + 4}", left, (x - 2.0, 6.5), casts_shadow=False)
        yield FixedProp(f"far-house-{index + 6}", right, (x + 10.0, -6.5), np.pi, casts_shadow=False)
    yield FixedProp("car-1", load_prop("car", paint="paint-red"), (34.0, 3.6), 0.5 * np.pi + 0.06)
    yield FixedProp("car-2", load_prop("car", paint="paint-silver"), (43.0, 0.9), np.pi, casts_shadow=False)
    yield FixedProp("car-3", load_prop("car", paint="paint-blue"), (51.0, -1.4), 0.0, casts_shadow=False)
    yield FixedProp("van-1", load_prop("van"), (34.1, -9.5), -0.5 * np.pi)
    for index, position in enumerate(_FAR_TREES):
        prop = tree(rng, 6.5, "leaves-light" if index % 2 else "leaves-dark", lobes=1)
        yield FixedProp(f"far-tree-{index + 1}", prop, position, casts_shadow=False)


def _trees() -> Iterator[FixedProp]:
    """Trees, fountain and kiosk."""
    rng = np.random.default_rng(5)
    for index, position in enumerate(_TREES):
        prop = tree(rng, 5.6 + 0.5 * (index % 3), "leaves-light" if index % 3 == 1 else "leaves-dark")
        yield FixedProp(f"tree-{index + 1}", prop, position, collider=(0.68, 0.68, 2.2))
    yield FixedProp("fountain", fountain(), (20.0, -4.6), collider=(1.65, 1.65, 1.2))
    yield FixedProp("kiosk", load_prop("kiosk"), (20.6, 9.3), collider=(1.75, 1.6, 2.8))


def _fixed_props() -> Iterator[FixedProp]:
    for index, (x, y, yaw) in enumerate(_LAMP_POSTS):
        yield FixedProp(f"lamp-post-{index + 1}", lamp_post(0.9), (x, y), yaw, collider=(0.14, 0.14, 4.6))
    for index in (0, 1, 2, 3, 5, 6, 7):
        yield FixedProp(f"bollard-{index + 1}", load_prop("bollard"), (30.8, -7.0 + 2.0 * index), casts_shadow=False)
    for index, (x, y, length) in enumerate(((18.0, 14.6, 5.0), (25.0, -14.6, 4.0), (1.5, -14.6, 5.0))):
        yield FixedProp(f"hedge-{index + 1}", hedge(length), (x, y), collider=(0.5 * length, 0.35, 1.1))


def _loose_props(rng: np.random.Generator) -> list[LooseProp]:
    def any_of(*names: str) -> str:
        return pick(rng, names)

    items = [
        LooseProp("bench", pose, load_prop("bench", wood=any_of("wood-light", "wood-green", "wood-dark")))
        for pose in _BENCHES
    ]
    for pose in _PLANTERS:
        flowers = any_of("flowers-red", "flowers-yellow", "leaves-light")
        items.append(LooseProp("planter", pose, planter(rng, flowers)))
    for x, y in _TABLES:
        table = parasol_table(rng, any_of("awning-sand", "awning-red", "awning-green", "awning-blue"))
        items.append(LooseProp("table", (x, y, 0.0), table, (1.15, 1.15, bounding_box(table)[2])))
    items += [LooseProp("bin", (x, y, 0.0), load_prop("litter-bin")) for x, y in _LITTER_BINS]
    return [
        *items,
        LooseProp("bicycles", (4.6, 12.9, 0.5 * np.pi), bicycle_stand(rng, 5)),
        LooseProp("bicycles", (24.0, -12.6, 0.0), bicycle_stand(rng, 4)),
        LooseProp("sign", (27.9, 10.4, 0.0), load_prop("parking-sign")),
        LooseProp("board", (8.6, 4.6, 0.3), signboard(int(rng.integers(16)))),
        LooseProp("board", (15.6, -2.9, -0.4), signboard(int(rng.integers(16)))),
    ]
