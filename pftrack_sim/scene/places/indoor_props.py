"""Furniture and goods of corridors and warehouses. Unless said otherwise the origin is on the floor in the middle."""

from __future__ import annotations

import numpy as np

from pftrack_sim.scene.places.materials import CARTONS, emissive, poster, texture
from pftrack_sim.scene.places.meshes import (
    ALL_FACES,
    NO_BOTTOM,
    SIDES,
    Prop,
    TexturedMesh,
    box,
    cylinder,
    quad,
    rough_ellipsoid,
    translated,
)


def door(leaf: str, number: int | None = None) -> Prop:
    """A closed door in a wall at y = 0, facing -y, optionally with a number plate beside it."""
    frame, chrome, width, height = texture("wood-plain"), texture("chrome"), 0.95, 2.08
    half = 0.5 * width
    meshes = [
        quad(texture(leaf), (-half, -0.03, 0.0), (width, 0, 0), (0, 0, height)),
        *(box(frame, (s * (half + 0.06), -0.045, 0.5 * height), (0.12, 0.13, height)) for s in (-1, 1)),
        box(frame, (0, -0.045, height + 0.06), (width + 0.24, 0.13, 0.12), ALL_FACES),
        box(chrome, (half - 0.13, -0.085, 1.02), (0.13, 0.025, 0.025), ALL_FACES),
        box(chrome, (half - 0.07, -0.06, 1.02), (0.03, 0.06, 0.03), ALL_FACES),
    ]
    if number is not None:
        plate = texture("sign-aisle" if number % 2 else "white")
        meshes.append(box(plate, (half + 0.32, -0.015, 1.6), (0.2, 0.03, 0.16), ("-y", "+x", "-x", "+z")))
    return tuple(meshes)


def framed_poster(index: int, width: float, height: float, z: float) -> Prop:
    """A poster or notice board on a wall at y = 0, facing -y, with its lower edge at `z`."""
    frame = texture("wood-dark" if index % 8 == 7 else "steel-dark")
    return (
        quad(poster(index), (-0.5 * width, -0.012, z), (width, 0, 0), (0, 0, height)),
        *(box(frame, (0, -0.02, z + h), (width + 0.08, 0.04, 0.04), ALL_FACES) for h in (0.0, height)),
        *(box(frame, (s * 0.5 * width, -0.02, z + 0.5 * height), (0.04, 0.04, height), SIDES) for s in (-1, 1)),
    )


def radiator() -> Prop:
    """A radiator on a wall at y = 0, facing -y."""
    return (
        box(texture("radiator"), (0, -0.1, 0.42), (1.3, 0.1, 0.56), ALL_FACES),
        box(texture("white"), (-0.5 * 1.3 - 0.05, -0.06, 0.08), (0.03, 0.03, 0.3), SIDES),
        box(texture("steel"), (0.5 * 1.3 + 0.05, -0.08, 0.62), (0.08, 0.05, 0.05), ALL_FACES),
    )


def ceiling_panel() -> Prop:
    """A lamp panel that shines downwards; the origin is in its middle."""
    return (
        quad(emissive("panel"), (-0.6, 0.3, -0.02), (1.2, 0, 0), (0, -0.6, 0)),
        *(box(texture("white"), (0, s * 0.3, -0.015), (1.2, 0.05, 0.05), ALL_FACES) for s in (-1, 1)),
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


def couch(cloth: str) -> Prop:
    """A padded bench, 1.9 m along x, with its back at +y."""
    fabric, length = texture(cloth), 1.9
    return (
        box(fabric, (0, 0, 0.3), (length, 0.6, 0.28), ALL_FACES),
        box(fabric, (0, 0.26, 0.62), (length, 0.16, 0.4), ALL_FACES),
        *(box(texture("wood-dark"), (s * 0.5 * length, 0, 0.36), (0.08, 0.62, 0.5)) for s in (-1, 1)),
        *_legs("steel", 0.4 * length, 0.2, 0.16, 0.05),
    )


def low_table() -> Prop:
    """A table with magazines on it."""
    return (
        box(texture("wood-plain"), (0, 0, 0.42), (1.0, 0.55, 0.04), ALL_FACES),
        *_legs("steel-dark", 0.45, 0.22, 0.4, 0.04),
        quad(texture("magazines"), (-0.2, -0.2, 0.445), (0.5, 0, 0), (0, 0.36, 0)),
    )


def _legs(material: str, half_x: float, half_y: float, height: float, width: float) -> Prop:
    """Four square legs at the corners of a rectangle."""
    size = (width, width, height)
    return tuple(
        box(texture(material), (x, y, 0.5 * height), size) for x in (-half_x, half_x) for y in (-half_y, half_y)
    )


def bookcase() -> Prop:
    """A bookcase, 1.5 m along x, with its back to +y."""
    width = 1.5
    return (
        box(texture("wood-dark"), (0, 0, 1.0), (width, 0.34, 2.0)),
        quad(texture("books"), (-0.46 * width, -0.175, 0.12), (0.92 * width, 0, 0), (0, 0, 1.8)),
    )


def vending_machine() -> Prop:
    """A vending machine with its back to +y and a display that emits light."""
    return (
        box(texture("paint-red"), (0, 0, 0.92), (0.95, 0.75, 1.84)),
        quad(emissive("display", 2), (-0.4, -0.38, 0.55), (0.58, 0, 0), (0, 0, 1.15)),
        quad(texture("grille"), (-0.4, -0.38, 0.1), (0.8, 0, 0), (0, 0, 0.3)),
        quad(texture("steel"), (0.24, -0.38, 0.9), (0.16, 0, 0), (0, 0, 0.5)),
    )


def extinguisher() -> Prop:
    """A fire extinguisher with its sign on a wall at y = 0, facing -y."""
    return (
        cylinder(texture("paint-red"), (0, -0.12, 0.55), 0.09, 0.5, 8),
        cylinder(texture("paint-black"), (0, -0.12, 1.05), 0.04, 0.1, 6),
        quad(texture("paint-red"), (-0.12, -0.012, 1.45), (0.24, 0, 0), (0, 0, 0.24)),
    )


def exit_sign() -> Prop:
    """A sign across x that hangs from the ceiling; the origin is at its lower edge."""
    return (
        box(texture("sign-exit"), (0, 0, 0.15), (0.05, 0.62, 0.3), ALL_FACES),
        *(box(texture("steel"), (0, y, 0.42), (0.015, 0.015, 0.26), SIDES) for y in (-0.22, 0.22)),
    )


def narrow_bench() -> Prop:
    """A bench without a back, 1.6 m along x."""
    return (
        *(box(texture("wood-light"), (0, y, 0.44), (1.6, 0.15, 0.04), ALL_FACES) for y in (-0.09, 0.09)),
        *(box(texture("steel-dark"), (s * 0.4 * 1.6, 0, 0.21), (0.05, 0.3, 0.42)) for s in (-1, 1)),
    )


def lockers(paint: str) -> Prop:
    """A row of six lockers along x with their backs to +y."""
    meshes = [box(texture("steel-dark"), (0, 0.02, 0.95), (0.36 * 6 + 0.04, 0.32, 1.9))]
    for k in range(6):
        x = 0.36 * (k - 0.5 * 5)
        meshes.append(quad(texture(paint), (x - 0.17, -0.145, 0.06), (0.34, 0, 0), (0, 0, 1.8)))
        meshes.append(quad(texture("grille"), (x - 0.1, -0.15, 1.55), (0.2, 0, 0), (0, 0, 0.18)))
        meshes.append(box(texture("chrome"), (x + 0.12, -0.155, 1.0), (0.03, 0.03, 0.12), ALL_FACES))
    return tuple(meshes)


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


_ON_PALLET = [(x, y) for x in (-0.29, 0.29) for y in (-0.195, 0.195)]
"""Centres of the cartons of one layer."""


def _pallet(z: float = 0.0) -> Prop:
    """A Euro pallet, 1.2 x 0.8 m."""
    runner = texture("wood-plain")
    return (
        box(texture("wood-light"), (0, 0, z + 0.12), (1.2, 0.8, 0.04), ALL_FACES),
        *(box(runner, (0, y, z + 0.05), (1.2, 0.1, 0.1), SIDES) for y in (-0.35, 0, 0.35)),
    )


def loaded_pallet(carton: str, layers: int) -> Prop:
    """A pallet with four equal cartons per layer."""
    cartons = [
        box(texture(carton), (x, y, 0.14 + 0.38 * (layer + 0.5)), (0.57, 0.38, 0.37))
        for layer in range(layers)
        for x, y in _ON_PALLET
    ]
    return (*_pallet(), *cartons)


def carton_stack(rng: np.random.Generator, layers: int) -> Prop:
    """A pallet with cartons of several kinds and an incomplete top layer."""
    meshes = list(_pallet())
    common = str(rng.choice(CARTONS))
    for layer in range(layers):
        for x, y in _ON_PALLET:
            if layer == layers - 1 and rng.random() < 0.35:
                continue
            carton = common if rng.random() < 0.6 else str(rng.choice(CARTONS))
            meshes.append(box(texture(carton), (x, y, 0.14 + 0.4 * (layer + 0.5)), (0.57, 0.38, 0.39)))
    return tuple(meshes)


def pallet_pile(count: int) -> Prop:
    """Empty pallets on top of each other."""
    return tuple(mesh for k in range(count) for mesh in _pallet(0.145 * k))


def drums(rng: np.random.Generator) -> Prop:
    """Four oil drums."""
    paints = ("paint-blue", "paint-red", "paint-green", "steel-blue", "paint-yellow")
    meshes: list[TexturedMesh] = []
    for x in (-0.32, 0.32):
        for y in (-0.32, 0.32):
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


def high_bay_lamp() -> Prop:
    """A factory lamp that hangs; the origin is at the rim of its shade."""
    return (
        cylinder(texture("steel"), (0, 0, 0), 0.42, 0.32, 12, 0.12),
        cylinder(texture("steel-dark"), (0, 0, 0.32), 0.1, 0.2, 8),
        box(texture("steel-dark"), (0, 0, 0.9), (0.03, 0.03, 1.0), SIDES),
        quad(emissive("cold"), (-0.28, 0.28, 0.02), (0.56, 0, 0), (0, -0.56, 0)),
    )


def steel_pillar(height: float) -> Prop:
    """A steel pillar with flanges and a guard in warning colours."""
    steel, width = texture("steel"), 0.34
    return (
        box(steel, (0, 0, 0.5 * height), (0.08, width, height), SIDES),
        *(box(steel, (s * 0.5 * width, 0, 0.5 * height), (0.05, width, height), SIDES) for s in (-1, 1)),
        box(texture("hazard"), (0, 0, 0.55), (width + 0.12, width + 0.12, 1.1), NO_BOTTOM),
    )
