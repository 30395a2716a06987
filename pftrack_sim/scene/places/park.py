"""A park: lawns under trees, a gravel walk in bends, hedges, benches, a fountain, a kiosk, houses behind."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pftrack_sim.core.random_streams import pick
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.places.builder import LooseProp, PlaceBuilder
from pftrack_sim.scene.places.buildings import house
from pftrack_sim.scene.places.catalogue import load_prop
from pftrack_sim.scene.places.fixed import FixedProp
from pftrack_sim.scene.places.materials import add_skybox, texture, tiling
from pftrack_sim.scene.places.meshes import ALL_FACES, Prop, TexturedMesh, box, quad
from pftrack_sim.scene.places.props import bicycle_stand, fountain, hedge, lamp_post, planter, signboard, tree

BOUNDS = (-8.0, -14.0, 38.0, 14.0)
GOALS = ((-5.0, 3.0), (-5.0, -6.0), (3.0, 8.5), (4.0, -8.0), (11.0, 9.5), (15.0, -10.0), (20.0, 8.5), (24.0, -9.5),
         (29.0, 9.0), (30.5, 2.5), (35.0, -8.0), (35.5, 4.0))  # fmt: skip

WALK = ((-14.0, -1.5), (-3.0, -0.5), (3.0, 0.3), (8.0, 2.6), (13.0, 3.6), (17.5, 1.6), (21.5, -2.4), (26.5, -3.6),
        (31.0, -1.6), (36.0, 1.6), (46.0, 3.0))  # fmt: skip
"""Middle of the gravel walk."""
_BRANCH = ((13.6, 3.4), (15.5, 7.0), (20.0, 9.0), (27.0, 8.0), (33.0, 3.6), (36.0, 1.6))
_WALK_M, _EDGE_M = 3.2, 0.1
_STEP_M = 0.004  # From the walk, on which soles stand, down to its branch and to the lawn

_TREES = ((1.6, 3.4), (5.4, -2.2), (9.0, 6.6), (10.6, -0.2), (15.7, -2.2), (19.4, 3.6), (22.6, 1.2), (24.6, -6.6),
          (28.4, -0.4), (33.4, -4.6), (-3.4, 4.6), (0.8, -6.4), (13.0, -8.0), (24.4, 11.4), (30.6, 6.4),
          (8.0, 12.0))  # fmt: skip
_LAMP_POSTS = ((-1.0, 2.2, np.pi), (11.6, 6.0, np.pi), (21.0, 0.0, 0.0), (30.0, -4.4, 0.0))
_HEDGES = ((3.0, 13.2, 11.0), (22.0, 13.2, 12.0), (2.0, -13.2, 12.0), (22.0, -13.2, 14.0))
_BENCHES = ((6.0, 4.7, 0.0), (22.6, -6.0, np.pi), (-5.6, 1.8, 0.0), (17.4, 10.6, 0.0), (28.0, -6.4, np.pi))


def build_park(builder: PlaceBuilder) -> WalkableArea:
    """Build the park."""
    add_skybox(builder.spec, "sky-day")
    builder.add_fixed(_ground)
    builder.add_fixed(_surroundings)
    builder.add_fixed(_fixed_props)
    builder.add_loose(_loose_props(builder.rng), (0.2, 0.2, 0.1))
    builder.add_daylight(BOUNDS, (0.62, 0.58, 0.50), (15.0, 0.0, 26.0), (0.10, 0.11, 0.12), (0.36, 0.39, 0.41))
    return builder.finish(BOUNDS, GOALS)


def _ground() -> Iterator[FixedProp]:
    lawn = quad(tiling("grass"), (-50, -50, -2 * _STEP_M), (140, 0, 0), (0, 100, 0))
    yield FixedProp("lawn", (lawn,), casts_shadow=False)
    for number, points in enumerate((WALK, _BRANCH)):
        yield FixedProp(f"walk-{number + 1}", _strip(points), (0.0, 0.0, -number * _STEP_M), casts_shadow=False)


def _strip(points: tuple[tuple[float, float], ...]) -> Prop:
    """A gravel walk with stone edges along a smooth curve through points."""
    curve = _smooth(np.array(points))
    along = np.gradient(curve, axis=0)
    left = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
    meshes: list[TexturedMesh] = []
    sides = (-0.5 * _WALK_M - _EDGE_M, -0.5 * _WALK_M, 0.5 * _WALK_M, 0.5 * _WALK_M + _EDGE_M)
    for name, low, high in (("stone", 0, 1), ("gravel", 1, 2), ("stone", 2, 3)):
        vertices = np.stack([curve + sides[low] * left, curve + sides[high] * left], axis=1).reshape(-1, 2)
        vertices = np.column_stack([vertices, np.zeros(len(vertices))])
        first = 2 * np.arange(len(curve) - 1)[:, None]
        faces = np.concatenate([first + np.array(corners) for corners in ((0, 3, 1), (0, 2, 3))]).astype(np.int32)
        normals = np.tile([0.0, 0.0, 1.0], (len(vertices), 1))
        surface = tiling(name) if name == "gravel" else texture(name)
        uv = vertices[:, :2] / 2.0 if name == "gravel" else surface.coordinates(np.full((len(vertices), 2), 0.5), 1.0)
        meshes.append(TexturedMesh(surface.material, vertices, normals, uv, faces))
    return tuple(meshes)


def _smooth(points: np.ndarray) -> np.ndarray:
    """`(N, 2)` points on a Catmull-Rom spline through `(K, 2)` points, eight per piece."""
    padded = np.vstack([2 * points[0] - points[1], points, 2 * points[-1] - points[-2]])
    share = np.linspace(0.0, 1.0, 8, endpoint=False)[:, None]
    pieces = [
        0.5 * (2 * b + (c - a) * share + (2 * a - 5 * b + 4 * c - d) * share**2 + (3 * b - a - 3 * c + d) * share**3)
        for a, b, c, d in zip(padded, padded[1:], padded[2:], padded[3:], strict=False)
    ]
    return np.vstack([*pieces, points[-1:]])


def _surroundings() -> Iterator[FixedProp]:
    """What closes the view: a wall around the park, trees along it, and houses behind it."""
    rng = np.random.default_rng(21)
    for name, x, y, length, yaw in (
        ("north", 16.0, 25.0, 92.0, 0.0),
        ("south", 16.0, -25.0, 92.0, np.pi),
        ("east", 58.0, 0.0, 60.0, -0.5 * np.pi),
        ("west", -26.0, 0.0, 60.0, 0.5 * np.pi),
    ):
        brick = quad(tiling("brick"), (-0.5 * length, 0, -0.1), (length, 0, 0), (0, 0, 2.2))
        coping = box(texture("stone"), (0, 0.1, 2.15), (length, 0.5, 0.12), ALL_FACES)
        yield FixedProp(f"wall-{name}", (brick, coping), (x, y), yaw, casts_shadow=False)
    for index, (kind, x, y, yaw) in enumerate(
        (("cream", -12.0, 30.0, 0.0), ("brick", 6.0, 30.0, 0.0), ("rose", 24.0, 30.0, 0.0), ("rose", 8.0, -30.0, np.pi),
         ("cream", 34.0, -30.0, np.pi), ("brick", 62.0, 14.0, -0.5 * np.pi), ("office", 62.0, -2.0, -0.5 * np.pi),
         ("office", -30.0, -6.0, 0.5 * np.pi))
    ):  # fmt: skip
        yield FixedProp(f"house-{index + 1}", house(kind, index % 4), (x, y), yaw, casts_shadow=False)
    around = [(x, side * 19.0) for x in range(-10, 46, 7) for side in (-1, 1)]
    around += [(48.0, y) for y in (-12.0, -4.0, 9.0)] + [(-18.0, y) for y in (-9.0, 6.0)]
    for index, (x, y) in enumerate(around):
        leaves = "leaves-light" if index % 3 == 0 else "leaves-dark"
        crown = tree(rng, float(rng.uniform(6.5, 9.0)), leaves, lobes=1, pit=False)
        position = (x + rng.uniform(-2, 2), y + rng.uniform(-2, 2))
        yield FixedProp(f"far-tree-{index + 1}", crown, position, casts_shadow=False)


def _fixed_props() -> Iterator[FixedProp]:
    rng = np.random.default_rng(23)
    for index, position in enumerate(_TREES):
        leaves = "leaves-light" if index % 3 == 1 else "leaves-dark"
        grown = tree(rng, 5.8 + 0.7 * (index % 4), leaves, lobes=2, pit=False)
        yield FixedProp(f"tree-{index + 1}", grown, position, float(index), (0.26, 0.26, 2.4))
    yield FixedProp("fountain", fountain(), (18.0, -8.0), collider=(1.65, 1.65, 1.2))
    yield FixedProp("kiosk", load_prop("kiosk"), (24.0, 5.6), collider=(1.75, 1.6, 2.8))
    for index, (x, y, yaw) in enumerate(_LAMP_POSTS):
        yield FixedProp(f"lamp-post-{index + 1}", lamp_post(0.5), (x, y), yaw, collider=(0.14, 0.14, 4.6))
    for index, (x, y, length) in enumerate(_HEDGES):
        yield FixedProp(f"hedge-{index + 1}", hedge(length), (x, y), collider=(0.5 * length, 0.35, 1.1))
    # Beds along the walk hide legs.
    for index, (x, y, yaw) in enumerate(((2.6, -2.6, 0.1), (12.4, 6.2, -0.1), (25.4, -1.2, -0.2))):
        bed = (box(texture("hedge"), (0, 0, 0.3), (2.6, 0.7, 0.6)),)
        yield FixedProp(f"bed-{index + 1}", bed, (x, y), yaw, (1.3, 0.35, 0.6))


def _loose_props(rng: np.random.Generator) -> list[LooseProp]:
    woods = ("wood-light", "wood-green", "wood-dark")
    flowers = ("flowers-red", "flowers-yellow", "leaves-light")
    items = [LooseProp("bench", pose, load_prop("bench", wood=pick(rng, woods))) for pose in _BENCHES]
    for pose in ((20.6, 6.4, 0.0), (27.4, 6.8, 0.4), (15.0, -8.0, np.pi / 2), (21.0, -8.2, np.pi / 2)):
        items.append(LooseProp("planter", pose, planter(rng, pick(rng, flowers))))
    items += [
        LooseProp("bin", (x, y, 0.0), load_prop("litter-bin")) for x, y in ((7.6, 4.9), (20.6, -6.2), (-4.2, 1.9))
    ]
    return [
        *items,
        LooseProp("bicycles", (27.4, 11.4, 0.0), bicycle_stand(rng, 4)),
        LooseProp("board", (5.4, -4.6, 0.4), signboard(int(rng.integers(16)))),
        LooseProp("board", (30.6, -6.0, -0.3), signboard(int(rng.integers(16)))),
    ]
