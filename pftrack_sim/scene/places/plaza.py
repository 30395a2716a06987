"""A paved square on a bright day: house fronts, trees, a kiosk, cafe tables, a fountain."""

from __future__ import annotations

import numpy as np

from pftrack_sim.scenario.model import Lights
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.places import outdoors, surfaces
from pftrack_sim.scene.places.buildings import house
from pftrack_sim.scene.places.shapes import Array, moved, quad
from pftrack_sim.scene.places.stage import Stage, standing, sun_direction
from pftrack_sim.scene.places.surfaces import tiles
from pftrack_sim.scene.places.vehicles import car, van

BOUNDS = (-6.0, -15.0, 30.0, 15.0)
GOALS = (
    (-4.5, 5.0),
    (-4.0, -12.5),
    (-4.0, 13.0),
    (9.0, 13.4),
    (28.5, 12.5),
    (28.5, 1.0),
    (28.5, -12.5),
    (15.5, -8.2),
    (12.0, 6.6),
    (4.0, -6.0),
    (24.5, 4.5),
    (20.5, -13.5),
)
_TREES = ((0.0, 9.5), (7.5, 9.5), (15.0, 9.5), (27.0, 8.0), (0.0, -9.5), (9.0, -9.5), (26.0, -9.0))
_BENCHES = ((3.7, 9.3, 0.0), (11.2, 9.3, 0.0), (4.5, -9.6, np.pi), (23.6, -9.0, np.pi), (-5.2, 0.4, -0.5 * np.pi))
_PLANTERS = ((-2.6, 4.2, 0.5 * np.pi), (5.6, 4.9, 0.0), (17.6, 7.2, 0.0), (7.2, -4.4, 0.0), (13.0, -6.4, 0.0),
             (26.8, -5.6, 0.5 * np.pi), (-2.8, -4.6, 0.5 * np.pi), (23.3, 12.6, 0.0))  # fmt: skip
_TABLES = ((11.5, -12.6), (14.9, -11.6), (18.0, -10.4), (7.6, -13.0))
_BINS = ((13.4, 9.6), (2.0, -8.6), (24.8, 9.6), (20.6, -8.6), (-5.0, 8.4))


def build_plaza(stage: Stage, lights: Lights) -> WalkableArea:
    """Build the plaza."""
    surfaces.add_sky(stage.spec, "sky-day")
    paving = quad(tiles("paving"), (-40, -45, 0), (125, 0, 0), (0, 90, 0))
    stage.put("paving", (paving,), casts_shadow=False)
    sun = sun_direction(lights.sun_azimuth_deg, lights.sun_elevation_deg)
    _houses(stage, sun)
    _beyond(stage)
    _fixtures(stage)
    _loose(stage)
    stage.enclose(BOUNDS)
    stage.beam("sun", sun, (0.60, 0.57, 0.50), (13.0, 0.0, 0.0, 26.0))
    # Sky light has a direction too: without it every shaded front would be flat.
    stage.fill("sky", (-0.75 * sun[0], -0.75 * sun[1], -0.5), (0.10, 0.11, 0.13))
    stage.sky_light((0.37, 0.39, 0.43))
    return stage.finish(BOUNDS, GOALS)


def _houses(stage: Stage, sun: Array) -> None:
    # A row throws its shadow on the square only when the sun is behind it; the shadow pass pays for every triangle.
    from_north, from_south, from_east, from_west = sun[1] < 0.0, sun[1] > 0.0, sun[0] < 0.0, sun[0] > 0.0
    north = [("cream", 0, "awning-red", True, 3), ("brick", 1, None, False, 2), ("rose", 2, "awning-green", False, 3),
             ("office", 3, None, False, 3)]  # fmt: skip
    south = [("office", 2, "awning-blue", False, 2), ("rose", 3, "awning-sand", True, 3), ("brick", 0, None, False, 3),
             ("cream", 1, "awning-green", False, 2)]  # fmt: skip
    for index, (kind, shop, cloth, balconies, storeys) in enumerate(north):
        piece = house(kind, shop, cloth, balconies, storeys)
        stage.put(f"house-north-{index + 1}", piece, (-12.0 + 12.0 * index, 17.5), casts_shadow=from_north)
    for index, (kind, shop, cloth, balconies, storeys) in enumerate(south):
        piece = house(kind, shop, cloth, balconies, storeys)
        stage.put(f"house-south-{index + 1}", piece, (36.0 - 12.0 * index, -17.5), np.pi, casts_shadow=from_south)
    stage.put(
        "house-east-1", house("brick", 3, "awning-blue", True, 2), (36.0, 17.5), -0.5 * np.pi, casts_shadow=from_east
    )
    stage.put(
        "house-east-2", house("cream", 2, "awning-red", False, 1), (36.0, -5.5), -0.5 * np.pi, casts_shadow=from_east
    )
    stage.put("house-west-1", house("rose", 1, None, True, 3), (-12.0, -17.5), 0.5 * np.pi, casts_shadow=from_west)
    stage.put(
        "house-west-2", house("office", 0, "awning-sand", False, 2), (-12.0, -5.5), 0.5 * np.pi, casts_shadow=from_west
    )
    stage.put(
        "house-west-3", house("cream", 3, "awning-red", False, 3), (-12.0, 6.5), 0.5 * np.pi, casts_shadow=from_west
    )


def _beyond(stage: Stage) -> None:
    """The street that leads away to the east, and what closes its view."""
    rng = np.random.default_rng(11)
    stage.put("far-road", (quad(tiles("asphalt"), (37.0, -2.6, 0.004), (40, 0, 0), (0, 4.6, 0)),), casts_shadow=False)
    stage.put("far-house-1", house("rose", 0, "awning-blue", False, 2), (80.0, 14.0), -0.5 * np.pi, casts_shadow=False)
    stage.put("far-house-2", house("brick", 1, "awning-red", False, 3), (80.0, 2.0), -0.5 * np.pi, casts_shadow=False)
    stage.put(
        "far-house-3", house("cream", 2, "awning-green", False, 2), (80.0, -10.0), -0.5 * np.pi, casts_shadow=False
    )
    for index, x in enumerate((48.0, 60.0)):
        stage.put(f"far-house-{index + 4}", house("office", 3, None, False, 2), (x - 2.0, 6.5), casts_shadow=False)
        stage.put(
            f"far-house-{index + 6}", house("rose", 1, None, True, 2), (x + 10.0, -6.5), np.pi, casts_shadow=False
        )
    stage.put("car-1", car("paint-red"), (34.0, 3.6), 0.5 * np.pi + 0.06)
    stage.put("car-2", car("paint-silver"), (43.0, 0.9), np.pi, casts_shadow=False)
    stage.put("car-3", car("paint-blue"), (51.0, -1.4), 0.0, casts_shadow=False)
    stage.put("van-1", van(), (34.1, -9.5), -0.5 * np.pi)
    for index, (x, y) in enumerate(((41.0, 3.7), (44.0, -3.8), (49.0, 3.8), (56.0, -3.8), (63.0, 3.7))):
        piece = outdoors.tree(rng, 6.5, "leaves-light" if index % 2 else "leaves-dark", tufts=1)
        stage.put(f"far-tree-{index + 1}", piece, (x, y), casts_shadow=False)


def _fixtures(stage: Stage) -> None:
    """What never moves: trees, fountain, kiosk, column, street lamps."""
    rng = np.random.default_rng(5)
    for index, (x, y) in enumerate(_TREES):
        piece = outdoors.tree(rng, 5.6 + 0.5 * (index % 3), "leaves-light" if index % 3 == 1 else "leaves-dark")
        stage.put(f"tree-{index + 1}", piece, (x, y), solid=(0.68, 0.68, 2.2))
    stage.put("fountain", outdoors.fountain(), (20.0, -4.6), solid=(1.65, 1.65, 1.2))
    stage.put("kiosk", outdoors.kiosk("awning-red"), (20.6, 9.3), solid=(1.75, 1.6, 2.8))
    column = outdoors.advertising_column(int(stage.rng.integers(16)))
    stage.put("advertising-column", column, (11.0, -3.6), solid=(0.7, 0.7, 3.2))
    for index, (x, y, yaw) in enumerate(
        ((-1.0, 13.0, np.pi), (11.5, 11.8, np.pi), (16.0, -6.9, 0.0), (24.8, 1.8, 0.0))
    ):
        stage.put(f"lamp-post-{index + 1}", outdoors.lamp_post(), (x, y), yaw, solid=(0.14, 0.14, 4.6))
    for index in range(8):
        if index != 4:
            stage.put(f"bollard-{index + 1}", outdoors.bollard(), (30.8, -7.0 + 2.0 * index), casts_shadow=False)
    hedges = ((18.0, 14.6, 5.0), (25.0, -14.6, 4.0), (1.5, -14.6, 5.0))
    for index, (x, y, length) in enumerate(hedges):
        stage.put(f"hedge-{index + 1}", outdoors.hedge(length), (x, y), solid=(0.5 * length, 0.35, 1.1))


def _loose(stage: Stage) -> None:
    """Benches, planters, tables, bicycles, bins: moved a little and thinned out per seed."""
    rng = stage.rng
    woods, flowers = ("wood-light", "wood-green", "wood-dark"), ("flowers-red", "flowers-yellow", "leaves-light")
    cloths = ("awning-sand", "awning-red", "awning-green", "awning-blue")
    things = [
        *(("bench", at, outdoors.bench(str(rng.choice(woods)))) for at in _BENCHES),
        *(("planter", at, outdoors.planter(rng, str(rng.choice(flowers)))) for at in _PLANTERS),
        *(("table", (*at, 0.0), outdoors.parasol_table(rng, str(rng.choice(cloths)))) for at in _TABLES),
        *(("bin", (*at, 0.0), outdoors.bin_()) for at in _BINS),
        ("bicycles", (4.6, 12.9, 0.5 * np.pi), outdoors.bicycle_stand(rng, 5)),
        ("bicycles", (24.0, -12.6, 0.0), outdoors.bicycle_stand(rng, 4)),
        ("sign", (27.9, 10.4, 0.0), moved(outdoors.sign_post(), 0, 0)),
        ("board", (8.6, 4.6, 0.3), outdoors.signboard(int(rng.integers(16)))),
        ("board", (15.6, -2.9, -0.4), outdoors.signboard(int(rng.integers(16)))),
    ]
    shifts = rng.uniform(-1.0, 1.0, (len(things), 3)) * (0.25, 0.25, 0.12)
    kept = stage.kept(len(things))
    for index in kept:
        kind, (x, y, yaw), piece = things[index]
        half_x, half_y, height = standing(piece)
        if kind == "table":
            half_x = half_y = 1.15
        solid = (half_x, half_y, height)
        dx, dy, turn = shifts[index]
        stage.put(f"{kind}-{index + 1}", piece, (x + dx, y + dy), yaw + turn, solid=solid)
