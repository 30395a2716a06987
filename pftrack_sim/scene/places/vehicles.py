"""Cars, bicycles and a forklift. They point along +x, with the origin on the ground in their middle."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np

from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.places.indoor_props import loaded_pallet
from pftrack_sim.scene.places.materials import emissive, texture
from pftrack_sim.scene.places.meshes import (
    ALL_FACES,
    Prop,
    TexturedMesh,
    box,
    cylinder,
    laid_on_side,
    loft,
    quad,
    rotated,
    translated,
)

CAR_PAINTS = ("paint-silver", "paint-blue", "paint-red", "paint-green", "paint-maroon", "paint-black", "paint-cream",
              "white")  # fmt: skip


def car(paint: str, rear_lights: bool = False) -> Prop:
    """A hatchback, 4.2 x 1.75 x 1.5 m; at night its rear lights are on."""
    body = texture(paint)
    hull = loft(
        body,
        [(-2.1, 0.36, 0.72, 0.76, 0.72), (-2.0, 0.28, 0.98, 0.86, 0.80), (-1.0, 0.22, 1.0, 0.88, 0.82),
         (0.75, 0.22, 0.96, 0.88, 0.82), (1.75, 0.24, 0.84, 0.87, 0.76), (2.05, 0.30, 0.66, 0.80, 0.70),
         (2.1, 0.36, 0.55, 0.74, 0.68)],
    )  # fmt: skip
    cabin = loft(
        texture("side-glass"),
        [(-1.9, 0.96, 1.0, 0.79, 0.76), (-1.35, 0.96, 1.43, 0.80, 0.64), (0.1, 0.94, 1.45, 0.80, 0.64),
         (0.95, 0.92, 0.97, 0.79, 0.76)],
    )  # fmt: skip
    roof = loft(
        body,
        [(-1.5, 1.40, 1.43, 0.655, 0.60), (-0.6, 1.43, 1.50, 0.66, 0.60), (0.12, 1.43, 1.47, 0.66, 0.60)],
    )
    meshes = [hull, cabin, roof]
    for side in (-1, 1):
        for x_low, x_high in ((0.92, 0.12), (-0.62, -0.62), (-1.88, -1.4)):
            low, high = np.array([x_low, side * 0.80, 0.96]), np.array([x_high, side * 0.655, 1.44])
            # The sign of the first edge makes the pillars face outwards on both sides.
            meshes.append(quad(body, low + np.array([0, 0.012 * side, 0]), (-0.09 * side, 0, 0), high - low))
    meshes += _wheels([(-1.3, 0.31), (1.32, 0.31)], 0.80, 0.2)
    meshes.append(quad(texture("nose"), (2.125, -0.7, 0.32), (0, 1.4, 0), (-0.03, 0, 0.36)))
    meshes.append(quad(texture("tail"), (-2.125, 0.72, 0.4), (0, -1.44, 0), (0.05, 0, 0.46)))
    meshes.append(box(texture("rubber"), (0, 0, 0.26), (3.9, 1.74, 0.14)))
    if rear_lights:
        meshes += [box(emissive("red"), (-2.12, s * 0.6, 0.72), (0.04, 0.22, 0.1), ALL_FACES) for s in (-1, 1)]
    return tuple(meshes)


def van() -> Prop:
    """A white delivery van, 4.8 x 1.9 x 2.1 m."""
    glass, logo = texture("front-glass"), texture("carton-logo")
    body = loft(
        texture("white"),
        [(-2.4, 0.3, 2.05, 0.93, 0.88), (0.9, 0.3, 2.1, 0.95, 0.88), (1.6, 0.3, 1.15, 0.95, 0.84),
         (2.35, 0.34, 0.9, 0.9, 0.8)],
    )  # fmt: skip
    return (
        body,
        quad(glass, (1.59, -0.76, 1.2), (0, 1.52, 0), (-0.62, 0.0, 0.80)),
        quad(logo, (-1.7, -0.955, 0.9), (1.5, 0, 0), (0, 0.03, 0.8)),
        quad(logo, (-0.2, 0.955, 0.9), (-1.5, 0, 0), (0, -0.03, 0.8)),
        quad(glass, (0.2, -0.96, 1.15), (0.85, 0, 0), (0, 0.045, 0.6)),
        quad(glass, (1.05, 0.96, 1.15), (-0.85, 0, 0), (0, -0.045, 0.6)),
        *_wheels([(-1.5, 0.34), (1.5, 0.34)], 0.86, 0.22),
        quad(texture("nose"), (2.37, -0.8, 0.35), (0, 1.6, 0), (0, 0, 0.5)),
        quad(texture("tail"), (-2.42, 0.85, 0.35), (0, -1.7, 0), (0, 0, 0.6)),
    )


def forklift() -> Prop:
    """A forklift with an overhead guard that carries a loaded pallet."""
    paint, steel, rubber = texture("paint-yellow"), texture("steel-dark"), texture("rubber")
    meshes = (
        box(paint, (-0.65, 0, 0.72), (0.85, 1.05, 0.75)),
        box(paint, (0.35, 0, 0.5), (1.1, 1.0, 0.45)),
        box(texture("hazard"), (-1.09, 0, 0.45), (0.06, 1.05, 0.3)),
        box(rubber, (-0.3, 0, 1.15), (0.5, 0.5, 0.12)),
        box(rubber, (-0.52, 0, 1.4), (0.1, 0.5, 0.5)),
        *(box(steel, (x, y, 1.55), (0.07, 0.07, 1.1)) for x in (-0.6, 0.35) for y in (-0.45, 0.45)),
        *(box(steel, (-0.12, -0.4 + 0.2 * k, 2.12), (1.1, 0.05, 0.05), ALL_FACES) for k in range(5)),
        *(box(steel, (0.95, y, 1.15), (0.12, 0.1, 2.3)) for y in (-0.36, 0.36)),
        *(box(steel, (0.95, 0, z), (0.1, 0.7, 0.1), ALL_FACES) for z in (0.4, 1.3, 2.25)),
        *(box(texture("steel"), (1.55, y, 0.1), (1.1, 0.12, 0.05), ALL_FACES) for y in (-0.28, 0.28)),
        *_wheels([(-0.6, 0.24), (0.6, 0.3)], 0.5, 0.22),
        *translated(loaded_pallet("carton-label", layers=2), 1.6, 0.0, 0.13),
    )
    return translated(meshes, -0.54, 0.0)


def _wheels(axles: Iterable[tuple[float, float]], half_track: float, width: float) -> Prop:
    """Wheels at both ends of axles, each given by x and the radius of its wheels [m]."""
    meshes: list[TexturedMesh] = []
    for x, radius in axles:
        tread = cylinder(texture("rubber"), (0, 0, -0.5 * width), radius, width, 12)
        disc = cylinder(texture("wheel"), (0, 0, 0.5 * width), radius, 0.005, 12)
        wheel = laid_on_side((tread, disc))
        meshes += translated(wheel, x, -half_track, radius)
        meshes += translated(rotated(wheel, np.pi), x, half_track, radius)
    return tuple(meshes)


@cache
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
        meshes += translated(bicycle(str(rng.choice(paints))), float(rng.uniform(-0.1, 0.1)), y)
        meshes += [box(steel, (x, y + 0.2, 0.4), (0.05, 0.05, 0.8)) for x in (-0.3, 0.3)]
        meshes.append(box(steel, (0, y + 0.2, 0.8), (0.65, 0.05, 0.05), ALL_FACES))
    return tuple(meshes)
