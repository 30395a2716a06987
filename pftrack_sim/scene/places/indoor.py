"""Props of corridors and warehouses that are not fixed in the catalogue."""

from __future__ import annotations

from itertools import product

import numpy as np

from pftrack_sim.scene.places.catalogue import load_prop
from pftrack_sim.scene.places.materials import CARTONS, texture
from pftrack_sim.scene.places.meshes import (
    ALL_FACES,
    SIDES,
    Prop,
    TexturedMesh,
    box,
    cylinder,
    quad,
    rough_ellipsoid,
    translated,
)


def numbered_door(leaf: str, number: int) -> Prop:
    """A door with a number plate in a wall at y = 0, facing -y."""
    return (*load_prop("door", leaf=leaf), *load_prop("number-plate", plate="sign-aisle" if number % 2 else "white"))


def lockers(paint: str) -> Prop:
    """A row of six lockers along x with their backs to +y."""
    carcass = box(texture("steel-dark"), (0, 0.02, 0.95), (0.36 * 6 + 0.04, 0.32, 1.9))
    fronts = (translated(load_prop("locker", paint=paint), 0.36 * (k - 2.5), 0.0) for k in range(6))
    return (carcass, *(mesh for front in fronts for mesh in front))


def framed_poster(index: int, width: float, height: float, z: float) -> Prop:
    """A poster or notice board on a wall at y = 0, facing -y, with its lower edge at `z`."""
    frame = texture("wood-dark" if index % 8 == 7 else "steel-dark")
    return (
        quad(texture(f"poster-{index}"), (-0.5 * width, -0.012, z), (width, 0, 0), (0, 0, height)),
        *(box(frame, (0, -0.02, z + h), (width + 0.08, 0.04, 0.04), ALL_FACES) for h in (0.0, height)),
        *(box(frame, (s * 0.5 * width, -0.02, z + 0.5 * height), (0.04, 0.04, height), SIDES) for s in (-1, 1)),
    )


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
    bay, depth, height = 2.7, 1.0, 4.6
    post, beam, shelf = texture("steel-blue"), texture("paint-orange"), texture("wood-plain")
    meshes: list[TexturedMesh] = []
    for x in (-bay, 0.0, bay):
        meshes += [box(post, (x, s * 0.5 * depth, 0.5 * height), (0.1, 0.09, height)) for s in (-1, 1)]
        meshes += [box(post, (x, 0, 0.6 + 1.3 * k), (0.05, depth, 0.06), ALL_FACES) for k in range(3)]
    for x in (-0.5 * bay, 0.5 * bay):
        for z in [0.12 + 1.45 * k for k in range(3)]:
            meshes += [box(beam, (x, s * 0.5 * depth, z), (bay - 0.1, 0.06, 0.13), ALL_FACES) for s in (-1, 1)]
            meshes.append(box(shelf, (x, 0, z + 0.05), (bay - 0.1, depth - 0.06, 0.03), ALL_FACES))
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
            carton = texture(str(rng.choice(CARTONS)))
            tall = float(rng.uniform(0.32, 0.6))
            deep = depth * float(rng.uniform(0.7, 0.92))
            meshes.append(box(carton, (middle, 0, 0.5 * tall), (wide - 0.03, deep, tall)))
            if style > 0.45 and rng.random() < 0.75:
                upper = float(rng.uniform(0.25, 0.5))
                carton = texture(str(rng.choice(CARTONS)))
                meshes.append(box(carton, (middle, 0, tall + 0.5 * upper), (0.85 * wide, 0.9 * deep, upper)))
        x += wide + float(rng.uniform(0.0, 0.12))


def carton_stack(rng: np.random.Generator, layers: int) -> Prop:
    """A pallet with cartons of several kinds and an incomplete top layer."""
    meshes = list(load_prop("pallet"))
    common = str(rng.choice(CARTONS))
    for layer in range(layers):
        for x, y in product((-0.29, 0.29), (-0.195, 0.195)):
            if layer == layers - 1 and rng.random() < 0.35:
                continue
            carton = common if rng.random() < 0.6 else str(rng.choice(CARTONS))
            meshes.append(box(texture(carton), (x, y, 0.14 + 0.4 * (layer + 0.5)), (0.57, 0.38, 0.39)))
    return tuple(meshes)


def pallet_pile(count: int) -> Prop:
    """Empty pallets on top of each other."""
    return tuple(mesh for k in range(count) for mesh in translated(load_prop("pallet"), 0.0, 0.0, 0.145 * k))


def drums(rng: np.random.Generator) -> Prop:
    """Four oil drums."""
    paints = ("paint-blue", "paint-red", "paint-green", "steel-blue", "paint-yellow")
    meshes: list[TexturedMesh] = []
    for x, y in product((-0.32, 0.32), repeat=2):
        meshes.append(cylinder(texture(str(rng.choice(paints))), (x, y, 0), 0.29, 0.88, 12))
        meshes.append(cylinder(texture("steel-dark"), (x, y, 0.42), 0.297, 0.04, 12))
    return tuple(meshes)


def trolley(rng: np.random.Generator) -> Prop:
    """A hand cart with three boxes."""
    blue, rubber = texture("steel-blue"), texture("rubber")
    return (
        box(blue, (0, 0, 0.22), (1.2, 0.62, 0.08), ALL_FACES),
        *(
            box(texture(str(rng.choice(CARTONS))), (-0.35 + 0.36 * k, 0, 0.28 + 0.5 * h), (0.34, 0.5, h))
            for k, h in enumerate(rng.uniform(0.25, 0.6, 3).tolist())
        ),
        *(cylinder(rubber, (x, y, 0.0), 0.07, 0.14, 8) for x in (-0.45, 0.45) for y in (-0.24, 0.24)),
        *(box(blue, (-0.58, y, 0.6), (0.04, 0.04, 0.9), SIDES) for y in (-0.26, 0.26)),
        box(blue, (-0.58, 0, 1.05), (0.04, 0.56, 0.04), ALL_FACES),
    )
