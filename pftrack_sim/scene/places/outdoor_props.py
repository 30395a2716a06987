"""Street furniture of pavements and squares. The origin of each prop is on the ground in its middle."""

from __future__ import annotations

import numpy as np

from pftrack_sim.scene.places.materials import emissive, poster, texture
from pftrack_sim.scene.places.meshes import (
    ALL_FACES,
    SIDES,
    Prop,
    box,
    cylinder,
    quad,
    rotated,
    rough_ellipsoid,
    translated,
)


def bench(wood: str) -> Prop:
    """A park bench, 1.8 m along x, with its back at +y."""
    slat, iron = texture(wood), texture("steel-dark")
    return (
        *(box(slat, (0, -0.18 + 0.14 * k, 0.44), (1.8, 0.12, 0.04), ALL_FACES) for k in range(3)),
        *(box(slat, (0, 0.24 + 0.02 * k, 0.60 + 0.15 * k), (1.8, 0.03, 0.11), ALL_FACES) for k in range(2)),
        *(box(iron, (x, 0.02, 0.21), (0.06, 0.48, 0.42)) for x in (-0.75, 0.75)),
        *(box(iron, (x, 0.28, 0.60), (0.06, 0.04, 0.44)) for x in (-0.75, 0.75)),
    )


def tree(rng: np.random.Generator, height: float, leaves: str = "leaves-dark", lobes: int = 3) -> Prop:
    """A street tree in a pit with a stone rim; its crown is a large ellipsoid with `lobes` smaller ones around it."""
    stone, bark, spread = texture("stone"), texture("bark"), 0.27 * height
    crown = [(0.0, 0.0, 0.68 * height, 1.0)]
    start = rng.uniform(0.0, 2.0 * np.pi)
    for k in range(lobes):
        angle = start + 2.0 * np.pi * k / lobes
        crown.append((0.55 * spread * np.cos(angle), 0.55 * spread * np.sin(angle), 0.56 * height, 0.72))
    return (
        *(box(stone, (0, s * 0.62, 0.06), (1.36, 0.12, 0.12)) for s in (-1, 1)),
        *(box(stone, (s * 0.62, 0, 0.06), (0.12, 1.12, 0.12)) for s in (-1, 1)),
        quad(texture("soil"), (-0.56, -0.56, 0.05), (1.12, 0, 0), (0, 1.12, 0)),
        cylinder(bark, (0, 0, 0), 0.024 * height + 0.03, 0.62 * height, 8, 0.012 * height),
        cylinder(bark, (0, 0, 0.36 * height), 0.05, 0.2, 6),
        *(
            rough_ellipsoid(texture(leaves), (x, y, z), (size * spread, size * spread, 0.85 * size * spread), rng, 0.13)
            for x, y, z, size in crown
        ),
    )


def planter(rng: np.random.Generator, plants: str) -> Prop:
    """A concrete trough with three plants, 1.6 m along x."""
    heads = [
        rough_ellipsoid(texture(plants), ((k + 0.5) * 1.6 / 3 - 0.8, 0, 0.58), (0.36, 0.3, 0.24), rng, 0.16, 6)
        for k in range(3)
    ]
    soil = quad(texture("soil"), (-0.8, -0.3, 0.521), (1.6, 0, 0), (0, 0.6, 0))
    return (box(texture("concrete"), (0, 0, 0.26), (1.6, 0.62, 0.52), SIDES), soil, *heads)


def hedge(length: float) -> Prop:
    """A clipped hedge along x, in blocks so that its leaves keep their size."""
    count = max(1, round(length / 1.2))
    step = length / count
    return tuple(
        box(texture("hedge"), ((k + 0.5) * step - 0.5 * length, 0, 0.55), (step, 0.7, 1.1)) for k in range(count)
    )


def litter_bin() -> Prop:
    """A round litter bin."""
    return (
        cylinder(texture("paint-green"), (0, 0, 0.08), 0.23, 0.75, 10, 0.26),
        cylinder(texture("steel-dark"), (0, 0, 0.83), 0.28, 0.07, 10),
        cylinder(texture("steel-dark"), (0, 0, 0), 0.16, 0.08, 8),
    )


def bollard() -> Prop:
    """An iron bollard."""
    return (
        cylinder(texture("steel-dark"), (0, 0, 0), 0.09, 0.85, 8, 0.07),
        cylinder(texture("chrome"), (0, 0, 0.68), 0.082, 0.06, 8),
    )


def advertising_column(first: int) -> Prop:
    """A round column, 3.2 m tall, with two rows of six posters from index `first` on."""
    angle, green, radius = np.linspace(0.0, 2.0 * np.pi, 7), texture("paint-green"), 0.62
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(7)])
    sheets = [
        quad(
            poster(first + 3 * row + k),
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


def kiosk() -> Prop:
    """A newspaper stand, 3.2 x 2.2 m, that opens towards -y under an awning."""
    awning, magazines, half_x, half_y = texture("awning-red"), texture("magazines"), 1.6, 1.1
    return (
        box(texture("paint-green"), (0, 0, 1.3), (2 * half_x, 2 * half_y, 2.6)),
        box(texture("steel-dark"), (0, 0, 2.7), (3.5, 2.5, 0.2), ALL_FACES),
        box(texture("paint-black"), (0, 0, 0.05), (3.3, 2.3, 0.1)),
        box(texture("wood-dark"), (0, -half_y - 0.2, 0.95), (2.8, 0.4, 0.08), ALL_FACES),
        quad(magazines, (-1.4, -half_y - 0.02, 1.05), (2.8, 0, 0), (0, 0, 1.1)),
        quad(texture("fruit"), (-1.4, -half_y - 0.62, 0.55), (2.8, 0, 0), (0, 0.5, 0.32)),
        box(texture("slats"), (0, -half_y - 0.34, 0.28), (2.8, 0.5, 0.5)),
        quad(awning, (-1.7, -half_y - 1.1, 2.25), (3.4, 0, 0), (0, 1.1, 0.4)),
        quad(awning, (1.7, -half_y - 1.1, 2.24), (-3.4, 0, 0), (0, 1.1, 0.4)),
        *(
            quad(poster(4 + k), (s * (half_x + 0.02), s * -0.75, 0.8), (0, s * 1.5, 0), (0, 0, 1.5))
            for k, s in enumerate((1, -1))
        ),
        quad(magazines, (half_x - 0.2, half_y + 0.02, 0.5), (-2.8, 0, 0), (0, 0, 1.6)),
        box(texture("paint-yellow"), (0, -half_y - 0.05, 2.95), (2.6, 0.08, 0.36)),
    )


def parasol_table(rng: np.random.Generator, cloth: str) -> Prop:
    """A cafe table with four chairs under a parasol."""
    iron, parasol, sides, radius = texture("steel-dark"), texture(cloth), 8, 1.5
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1) + 0.2
    rim = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(sides + 1, 2.05)])
    meshes = [
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
    ]
    for k in range(4):
        yaw = 0.5 * np.pi * k + float(rng.uniform(-0.3, 0.3))
        meshes += translated(rotated(_chair(), yaw), 0.82 * np.sin(yaw), -0.82 * np.cos(yaw))
    return tuple(meshes)


def _chair() -> Prop:
    """A chair with its back at -y."""
    fabric, iron = texture("fabric-red"), texture("steel-dark")
    return (
        box(fabric, (0, 0, 0.45), (0.42, 0.42, 0.05), ALL_FACES),
        box(fabric, (0, -0.2, 0.74), (0.42, 0.03, 0.34), ALL_FACES),
        *(box(iron, (x, y, 0.22), (0.03, 0.03, 0.44)) for x in (-0.19, 0.19) for y in (-0.19, 0.19)),
        *(box(iron, (x, -0.2, 0.6), (0.03, 0.03, 0.5)) for x in (-0.19, 0.19)),
    )


def lamp_post(reach: float) -> Prop:
    """A street lamp, 4.6 m tall, with an arm along +y; the lamp emits light."""
    iron, height = texture("steel-dark"), 4.6
    return (
        cylinder(iron, (0, 0, 0), 0.13, 0.7, 8, 0.09),
        cylinder(iron, (0, 0, 0.7), 0.06, height - 0.7, 8, 0.045),
        box(iron, (0, 0.5 * reach, height), (0.07, reach, 0.07), ALL_FACES),
        box(iron, (0, reach, height), (0.3, 0.62, 0.1)),
        box(emissive("warm"), (0, reach, height - 0.08), (0.24, 0.52, 0.08), ALL_FACES),
    )


def parking_sign() -> Prop:
    """A road sign that faces -x."""
    return (
        cylinder(texture("steel"), (0, 0, 0), 0.035, 2.6, 6),
        quad(texture("sign-parking"), (-0.045, 0.3, 2.0), (0, -0.6, 0), (0, 0, 0.6)),
        quad(texture("steel"), (0.045, -0.3, 2.0), (0, 0.6, 0), (0, 0, 0.6)),
    )


def fountain() -> Prop:
    """A round basin with water and a column."""
    stone, water = texture("stone"), texture("paint-blue")
    return (
        cylinder(stone, (0, 0, 0), 1.7, 0.55, 16, 1.65),
        cylinder(water, (0, 0, 0.551), 1.45, 0.004, 16),
        cylinder(stone, (0, 0, 0.5), 0.3, 1.1, 10, 0.18),
        cylinder(stone, (0, 0, 1.6), 0.35, 0.14, 12, 0.75),
        cylinder(water, (0, 0, 1.741), 0.62, 0.004, 12),
        rough_ellipsoid(stone, (0, 0, 2.0), (0.2, 0.2, 0.3), np.random.default_rng(0), 0.05, 8),
    )


def signboard(index: int) -> Prop:
    """An A-board, 0.8 x 1.2 m, with posters that face -y and +y."""
    return (
        quad(poster(index), (-0.4, -0.24, 0.08), (0.8, 0, 0), (0, 0.2, 1.12)),
        quad(poster(index + 3), (0.4, 0.24, 0.08), (-0.8, 0, 0), (0, -0.2, 1.12)),
        *(box(texture("wood-dark"), (s * 0.42, 0, 0.62), (0.04, 0.3, 1.24)) for s in (-1, 1)),
    )


def bus_shelter() -> Prop:
    """A roof on three posts over a bench, with a lit advertisement."""
    iron = texture("steel-dark")
    return (
        box(iron, (0, 0, 2.3), (3.0, 1.3, 0.1), ALL_FACES),
        *(box(iron, (x, 0.55, 1.15), (0.08, 0.08, 2.3)) for x in (-1.4, 0.0, 1.4)),
        *bench("wood-dark"),
        quad(emissive("display", 3), (-0.045, -0.6, 0.6), (0, 1.1, 0), (0, 0, 1.5)),
    )
