"""Props with random or computed shapes. The origin is on the ground in the middle, unless stated otherwise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise, product
from typing import Any

import numpy as np

from pftrack_sim.core.random_streams import pick
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.places.buildings import house, station_front
from pftrack_sim.scene.places.catalogue import built_once, load_prop
from pftrack_sim.scene.places.materials import CARTONS, Texture, texture
from pftrack_sim.scene.places.meshes import (
    ALL_FACES,
    SIDES,
    Prop,
    TexturedMesh,
    box,
    cylinder,
    quad,
    rotated,
    rough_ellipsoid,
    translated,
    tufts,
)

_TUFTS, _TUFT = 9, 0.2  # Tufts on a lobe of a crown, and their size in shares of its half axis
_GOLDEN_RAD = np.pi * (3.0 - np.sqrt(5.0))


def tree(
    rng: np.random.Generator, height: float, leaves: str = "leaves-dark", lobes: int = 11, pit: bool = True
) -> Prop:
    """A tree whose crown is an ellipsoid of leaves with `lobes` smaller ones all around it.

    By default it is a street tree in a `pit` with a stone rim.
    """
    stone, bark = texture("stone"), texture("bark")
    planted = (
        *(box(stone, (0, s * 0.62, 0.06), (1.36, 0.12, 0.12)) for s in (-1, 1)),
        *(box(stone, (s * 0.62, 0, 0.06), (0.12, 1.12, 0.12)) for s in (-1, 1)),
        quad(texture("soil"), (-0.56, -0.56, 0.05), (1.12, 0, 0), (0, 1.12, 0)),
    )
    (own,) = rng.spawn(1)  # What else stands in the place does not depend on the number of leaves
    return (
        *(planted if pit else ()),
        cylinder(bark, (0, 0, 0), 0.024 * height + 0.03, 0.62 * height, 8, 0.012 * height),
        cylinder(bark, (0, 0, 0.36 * height), 0.05, 0.2, 6),
        *_crown(texture(leaves), 0.66 * height, 0.27 * height * np.array([1.0, 1.0, 0.95]), lobes, own),
    )


def _crown(leaves: Texture, z: float, radii: FloatArray, lobes: int, rng: np.random.Generator) -> Prop:
    """Leaves around the height `z` [m] in an ellipsoid of half axes `radii` `(3,)` [m]."""
    meshes = [rough_ellipsoid(leaves, (0.0, 0.0, z), 0.72 * radii, rng, 0.05, 8)]
    # Equally far from each other: a spiral from bottom to top, turned at random.
    up = np.linspace(-0.82, 0.95, lobes)
    turn = rng.uniform(0.0, 2.0 * np.pi) + _GOLDEN_RAD * np.arange(lobes)
    level = np.sqrt(1.0 - up**2)
    outward = np.column_stack([level * np.cos(turn), level * np.sin(turn), up])
    for direction in outward:
        size = rng.uniform(0.36, 0.52)
        centre = np.array([0.0, 0.0, z]) + (1.0 - 0.8 * size) * direction * radii
        meshes.append(rough_ellipsoid(leaves, centre, size * radii, rng, 0.12, 6))
        meshes.append(tufts(leaves, centre, size * radii, rng, _TUFTS, _TUFT * float(radii[0])))
    return tuple(meshes)


def planter(rng: np.random.Generator, plants: str) -> Prop:
    """A trough with three plants, 1.6 m along x."""
    heads = [
        rough_ellipsoid(texture(plants), ((k + 0.5) * 1.6 / 3 - 0.8, 0, 0.58), (0.36, 0.3, 0.24), rng, 0.16, 6)
        for k in range(3)
    ]
    return (*load_prop("trough"), *heads)


@built_once
def hedge(length: float) -> Prop:
    """A clipped hedge along x, in blocks so that its leaves keep their size."""
    count = max(1, round(length / 1.2))
    step = length / count
    return tuple(
        box(texture("hedge"), ((k + 0.5) * step - 0.5 * length, 0, 0.55), (step, 0.7, 1.1)) for k in range(count)
    )


@built_once
def advertising_column(first: int) -> Prop:
    """A round column, 3.2 m tall, with two rows of six posters from index `first` on."""
    angle, green, radius = np.linspace(0.0, 2.0 * np.pi, 7), texture("paint-green"), 0.62
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(7)])
    sheets = [
        quad(
            texture(f"poster-{(first + 3 * row + k) % 16}"),
            radius * ring[k] + (0.0, 0.0, 0.5 + 1.1 * row),
            radius * (ring[k + 1] - ring[k]),
            (0, 0, 1.1),
        )
        for row in range(2)
        for k in range(6)
    ]
    return (
        cylinder(texture("stone"), (0, 0, 0), 0.7, 0.5, 12, 0.62),
        *sheets,
        cylinder(green, (0, 0, 2.7), 0.78, 0.16, 12),
        cylinder(green, (0, 0, 2.86), 0.7, 0.5, 12, 0.1),
    )


def parasol_table(rng: np.random.Generator, cloth: str) -> Prop:
    """A cafe table with four chairs under a parasol."""
    meshes = list(_parasol(cloth))
    for k in range(4):
        yaw = 0.5 * np.pi * k + float(rng.uniform(-0.3, 0.3))
        meshes += translated(rotated(load_prop("chair"), yaw), 0.82 * np.sin(yaw), -0.82 * np.cos(yaw))
    return tuple(meshes)


@built_once
def _parasol(cloth: str) -> Prop:
    """The table and its parasol."""
    iron, parasol, sides, radius = texture("steel-dark"), texture(cloth), 8, 1.5
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1) + 0.2
    rim = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(sides + 1, 2.05)])
    return (
        cylinder(texture("wood-dark"), (0, 0, 0.71), 0.42, 0.04, 10),
        cylinder(iron, (0, 0, 0), 0.04, 2.6, 6),
        cylinder(iron, (0, 0, 0), 0.3, 0.05, 8),
        cylinder(parasol, (0, 0, 2.18), radius, 0.45, sides, 0.05),
        cylinder(parasol, (0, 0, 2.04), radius, 0.14, sides, radius),
        # The underside, visible from below.
        *(
            quad(parasol, rim[k + 1], rim[k] - rim[k + 1], np.array([0, 0, 2.25]) - 0.5 * (rim[k] + rim[k + 1]))
            for k in range(sides)
        ),
    )


@built_once
def lamp_post(reach: float) -> Prop:
    """A street lamp, 4.6 m tall, with an arm along +y; the lamp emits light."""
    iron, height = texture("steel-dark"), 4.6
    return (
        cylinder(iron, (0, 0, 0), 0.13, 0.7, 8, 0.09),
        cylinder(iron, (0, 0, 0.7), 0.06, height - 0.7, 8, 0.045),
        box(iron, (0, 0.5 * reach, height), (0.07, reach, 0.07), ALL_FACES),
        box(iron, (0, reach, height), (0.3, 0.62, 0.1)),
        box(texture("lamp-warm"), (0, reach, height - 0.08), (0.24, 0.52, 0.08), ALL_FACES),
    )


@built_once
def bicycle(paint: str) -> Prop:
    """A bicycle. Its tyres are rings: the background is visible through the wheels."""
    frame, chrome = texture(paint), texture("chrome")
    meshes: list[TexturedMesh] = []
    for x in (-0.52, 0.52):
        meshes += _tyre(np.array([x, 0.0, 0.34]))
        meshes.append(box(chrome, (x, 0, 0.34), (0.012, 0.012, 0.6), ALL_FACES))
        meshes.append(box(chrome, (x, 0, 0.34), (0.6, 0.012, 0.012), ALL_FACES))
    for (x0, z0), (x1, z1) in (
        ((-0.52, 0.34), (0.0, 0.36)), ((0.0, 0.36), (0.42, 0.82)), ((-0.2, 0.84), (0.42, 0.82)),
        ((0.0, 0.36), (-0.22, 0.92)), ((-0.52, 0.34), (-0.2, 0.84)), ((0.52, 0.34), (0.40, 0.98)),
    ):  # fmt: skip
        along = np.array([x1 - x0, 0.0, z1 - z0])
        across = 0.035 * np.array([-along[2], 0.0, along[0]]) / np.linalg.norm(along)
        meshes += [quad(frame, (x0, -0.018, z0), along, across), quad(frame, (x1, 0.018, z1), -along, across)]
    meshes.append(box(texture("rubber"), (-0.23, 0, 0.95), (0.26, 0.12, 0.05), ALL_FACES))
    meshes.append(box(chrome, (0.36, 0, 1.0), (0.05, 0.56, 0.03), ALL_FACES))
    return tuple(meshes)


def _tyre(hub: FloatArray) -> Prop:
    """A flat ring in the plane of x and z, visible from both sides."""
    meshes: list[TexturedMesh] = []
    angles = np.linspace(0.0, 2.0 * np.pi, 13)
    for angle, next_angle in pairwise(angles):
        for side in (-1, 1):
            ends = (angle, next_angle) if side < 0 else (next_angle, angle)
            (inner, other), (outer, _) = (
                [np.array([np.cos(t), 0.0, np.sin(t)]) * radius for t in ends] for radius in (0.29, 0.34)
            )
            corner = hub + np.array([0.0, 0.015 * side, 0.0]) + inner
            mesh = quad(texture("rubber"), corner, other - inner, outer - inner)
            # The quad faces the plane of the hub; reversed, it faces outwards.
            outwards = np.tile([0.0, float(side), 0.0], (4, 1))
            meshes.append(replace(mesh, normals=outwards, faces=np.ascontiguousarray(mesh.faces[:, ::-1])))
    return tuple(meshes)


def bicycle_stand(rng: np.random.Generator, count: int) -> Prop:
    """Bicycles side by side along y, each leaning on a hoop."""
    paints = ("paint-red", "paint-blue", "paint-green", "paint-silver", "paint-black", "paint-yellow")
    steel = texture("steel")
    meshes: list[TexturedMesh] = []
    for k in range(count):
        y = 0.75 * (k - 0.5 * (count - 1))
        meshes += translated(bicycle(pick(rng, paints)), float(rng.uniform(-0.1, 0.1)), y)
        meshes += [box(steel, (x, y + 0.2, 0.4), (0.05, 0.05, 0.8)) for x in (-0.3, 0.3)]
        meshes.append(box(steel, (0, y + 0.2, 0.8), (0.65, 0.05, 0.05), ALL_FACES))
    return tuple(meshes)


@built_once
def signboard(index: int) -> Prop:
    """An A-board with posters `index` and `index + 3`."""
    return load_prop("signboard", front=f"poster-{index}", back=f"poster-{(index + 3) % 16}")


@built_once
def framed_poster(index: int, width: float, height: float, bottom: float) -> Prop:
    """A poster or notice board on a wall at y = 0, facing -y, with its lower edge at the height `bottom`."""
    frame = texture("wood-dark" if index % 8 == 7 else "steel-dark")
    return (
        quad(texture(f"poster-{index}"), (-0.5 * width, -0.012, bottom), (width, 0, 0), (0, 0, height)),
        *(box(frame, (0, -0.02, bottom + h), (width + 0.08, 0.04, 0.04), ALL_FACES) for h in (0.0, height)),
        *(box(frame, (s * 0.5 * width, -0.02, bottom + 0.5 * height), (0.04, 0.04, height), SIDES) for s in (-1, 1)),
    )


def wall_picture(rng: np.random.Generator) -> Prop:
    """A poster of random size or a notice board on a wall at y = 0, facing -y, somewhat beside its place."""
    picture = pick(rng, (7, 15)) if rng.random() < 0.3 else int(rng.integers(16))
    width = 1.5 if picture % 8 == 7 else pick(rng, (0.7, 0.8, 0.95))
    poster = framed_poster(index=picture, width=width, height=1.0 if width > 1.0 else 1.3 * width, bottom=1.2)
    return translated(poster, float(rng.uniform(-0.35, 0.35)), 0.0)


def potted_plant(rng: np.random.Generator, height: float) -> Prop:
    """A plant in a pot."""
    leaves = [
        rough_ellipsoid(
            texture("leaves-light" if k % 2 else "leaves-dark"),
            (float(rng.uniform(-0.12, 0.12)), float(rng.uniform(-0.12, 0.12)), height * (0.55 + 0.18 * k)),
            (0.3 - 0.05 * k, 0.3 - 0.05 * k, 0.24 * height),
            rng,
            0.25,
            8,
        )
        for k in range(3)
    ]
    pot = cylinder(texture("terracotta"), (0, 0, 0), 0.18, 0.36, 10, 0.25)
    return (pot, cylinder(texture("bark"), (0, 0, 0.3), 0.03, 0.5 * height, 6), *leaves)


def rack(rng: np.random.Generator) -> Prop:
    """A pallet rack along x with two bays of three shelves; the goods on the shelves are drawn."""
    bay, depth = 2.7, 1.0
    meshes = list(load_prop("rack-posts"))
    for x in (-0.5 * bay, 0.5 * bay):
        for z in [0.12 + 1.45 * k for k in range(3)]:
            meshes += translated(load_prop("rack-shelf"), x, 0.0, z)
            meshes += translated(_goods(rng, bay - 0.3, depth), x, 0.0, z + 0.07)
    return tuple(meshes)


def _goods(rng: np.random.Generator, length: float, depth: float) -> Prop:
    """Cartons and sacks on one shelf, or nothing."""
    meshes: list[TexturedMesh] = []
    style = rng.random()
    if style < 0.12:
        return ()
    x = -0.5 * length
    while True:
        wide = float(rng.uniform(0.42, 0.9))
        if x + wide > 0.5 * length:
            return tuple(meshes)
        middle = x + 0.5 * wide
        if rng.random() < 0.86:
            carton = texture(pick(rng, CARTONS))
            tall = float(rng.uniform(0.32, 0.6))
            deep = depth * float(rng.uniform(0.7, 0.92))
            meshes.append(box(carton, (middle, 0, 0.5 * tall), (wide - 0.03, deep, tall)))
            if style > 0.45 and rng.random() < 0.75:
                upper = float(rng.uniform(0.25, 0.5))
                carton = texture(pick(rng, CARTONS))
                meshes.append(box(carton, (middle, 0, tall + 0.5 * upper), (0.85 * wide, 0.9 * deep, upper)))
        x += wide + float(rng.uniform(0.0, 0.12))


def carton_stack(rng: np.random.Generator, layers: int) -> Prop:
    """A pallet with cartons of several kinds and an incomplete top layer."""
    meshes = list(load_prop("pallet"))
    common = pick(rng, CARTONS)
    for layer in range(layers):
        for x, y in product((-0.29, 0.29), (-0.195, 0.195)):
            if layer == layers - 1 and rng.random() < 0.35:
                continue
            carton = common if rng.random() < 0.6 else pick(rng, CARTONS)
            meshes.append(box(texture(carton), (x, y, 0.14 + 0.4 * (layer + 0.5)), (0.57, 0.38, 0.39)))
    return tuple(meshes)


@built_once
def pallet_pile(count: int) -> Prop:
    """Empty pallets on top of each other."""
    return tuple(mesh for k in range(count) for mesh in translated(load_prop("pallet"), 0.0, 0.0, 0.145 * k))


def drums(rng: np.random.Generator) -> Prop:
    """Four oil drums."""
    paints = ("paint-blue", "paint-red", "paint-green", "steel-blue", "paint-yellow")
    meshes: list[TexturedMesh] = []
    for x, y in product((-0.32, 0.32), repeat=2):
        meshes.append(cylinder(texture(pick(rng, paints)), (x, y, 0), 0.29, 0.88, 12))
        meshes.append(cylinder(texture("steel-dark"), (x, y, 0.42), 0.297, 0.04, 12))
    return tuple(meshes)


def trolley(rng: np.random.Generator) -> Prop:
    """A hand cart with three boxes."""
    blue, rubber = texture("steel-blue"), texture("rubber")
    return (
        box(blue, (0, 0, 0.22), (1.2, 0.62, 0.08), ALL_FACES),
        *(
            box(texture(pick(rng, CARTONS)), (-0.35 + 0.36 * k, 0, 0.28 + 0.5 * h), (0.34, 0.5, h))
            for k, h in enumerate(rng.uniform(0.25, 0.6, 3).tolist())
        ),
        *(cylinder(rubber, (x, y, 0.0), 0.07, 0.14, 8) for x in (-0.45, 0.45) for y in (-0.24, 0.24)),
        *(box(blue, (-0.58, y, 0.6), (0.04, 0.04, 0.9), SIDES) for y in (-0.26, 0.26)),
        box(blue, (-0.58, 0, 1.05), (0.04, 0.56, 0.04), ALL_FACES),
    )


def gravel_walk(points: Sequence[Sequence[float]]) -> Prop:
    """A walk of gravel, 3.2 m wide, with stone edges along a smooth curve through points x, y [m]."""
    curve = _smooth(np.array(points, dtype=np.float64))
    along = np.asarray(np.gradient(curve, axis=0), dtype=np.float64)
    left = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(along[:, 0], along[:, 1])[:, None]
    meshes: list[TexturedMesh] = []
    for name, low, high in (("stone", -1.7, -1.6), ("gravel", -1.6, 1.6), ("stone", 1.6, 1.7)):
        vertices = np.stack([curve + low * left, curve + high * left], axis=1).reshape(-1, 2)
        vertices = np.column_stack([vertices, np.zeros(len(vertices))])
        first = 2 * np.arange(len(curve) - 1)[:, None]
        faces = np.concatenate([first + np.array(corners) for corners in ((0, 3, 1), (0, 2, 3))]).astype(np.int32)
        normals = np.tile([0.0, 0.0, 1.0], (len(vertices), 1))
        surface = texture(name)
        # Gravel repeats with the ground; the stone of an edge has one shade.
        unit = vertices[:, :2] if name == "gravel" else np.full((len(vertices), 2), 0.5)
        meshes.append(TexturedMesh(surface.material, vertices, normals, surface.coordinates(unit, 1.0), faces))
    return tuple(meshes)


def _smooth(points: FloatArray) -> FloatArray:
    """`(N, 2)` points on a Catmull-Rom spline through `(K, 2)` points, eight per piece."""
    padded = np.vstack([2 * points[0] - points[1], points, 2 * points[-1] - points[-2]])
    share = np.linspace(0.0, 1.0, 8, endpoint=False)[:, None]
    pieces = [
        0.5 * (2 * b + (c - a) * share + (2 * a - 5 * b + 4 * c - d) * share**2 + (3 * b - a - 3 * c + d) * share**3)
        for a, b, c, d in zip(padded, padded[1:], padded[2:], padded[3:], strict=False)
    ]
    return np.vstack([*pieces, points[-1:]])


def _by_name(*builds: Any) -> dict[str, Callable[..., Prop]]:
    """Functions by the names of their props in files of places: "bicycle-stand"."""
    return {build.__name__.replace("_", "-"): build for build in builds}


RANDOM = _by_name(
    bicycle_stand, carton_stack, drums, house, parasol_table, planter, potted_plant, rack, tree, trolley, wall_picture
)
"""Props that take a random generator before their arguments."""

BUILT = _by_name(
    advertising_column, framed_poster, gravel_walk, hedge, lamp_post, pallet_pile, signboard, station_front
)
"""Props of one shape for the same arguments."""
