"""Wheelchairs, bicycles, scooters and prams: their parts as bodies of the scene, from `assets/mobility.toml`.

Like what is carried, they are no part of the person: a person's box ends at the body, and they occlude it.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import mujoco
import numpy as np

from pftrack_sim.core.data_files import asset_table
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.mobility import Mobility
from pftrack_sim.scene.layout import SCENERY_GROUP
from pftrack_sim.scene.scene_spec import NO_CONTACT, SceneSpec, add_bumper, add_mesh_geom, mesh_file

_STATURE_M = 1.75  # For which the table is
_UNPOSED_Z_M = -9.0
_AROUND, _ACROSS = 32, 8  # Points of a tyre
_CAPSULE, _ELLIPSOID, _BOX = mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_ELLIPSOID, mujoco.mjtGeom.mjGEOM_BOX


class Part(NamedTuple):
    """A rigid part at `(3,)` in the frame of the whole, with the radius of a wheel, and its row of the table.

    What `turns` is "" where it is fixed, "wheel", "steer", "steered-wheel" or "crank".
    """

    name: str
    at_m: FloatArray
    turns: str
    radius_m: float
    shapes: dict[str, Any]


def scale(height_m: float) -> float:
    """Factor on the lengths of the table for a stature."""
    return height_m / _STATURE_M


@lru_cache(maxsize=16)
def parts(kind: Mobility, height_m: float) -> tuple[Part, ...]:
    """Its parts for a person of this stature."""
    found, factor = list[Part](), scale(height_m)
    for row in asset_table("mobility")[kind]["parts"]:
        sides = {"left-": 1.0, "right-": -1.0} if row.get("pair") else {"": 1.0}
        radius_m = factor * row["tyre"][0] if "tyre" in row else 0.0
        for side, sign in sides.items():
            at_m = factor * np.array(row["at"]) * (1.0, sign, 1.0)
            found.append(Part(side + row["name"], at_m, row.get("turns", ""), radius_m, row))
    return tuple(found)


def footprint_m(kind: Mobility, height_m: float) -> tuple[float, float, float]:
    """Rear and front end ahead of the person, and half width, of the ground that it takes."""
    (x, _, _), (half_x, half_y, _) = asset_table("mobility")[kind]["bumper"]
    factor = scale(height_m)
    return factor * (x - half_x), factor * (x + half_x), factor * half_y


def body_name(person: str, kind: Mobility, part: str) -> str:
    """Name of the body of a part: "target-bicycle/crank"."""
    return f"{person}-{kind}/{part}"


def add_mobility(spec: SceneSpec, person: str, kind: Mobility, height_m: float) -> None:
    """Add a mocap body for each part, and a hidden box on the first that robots collide with."""
    factor, (middle, half) = scale(height_m), np.array(asset_table("mobility")[kind]["bumper"])
    for index, part in enumerate(parts(kind, height_m)):
        name = body_name(person, kind, part.name)
        body = spec.worldbody.add_body(name=name, mocap=True, pos=[0.0, 0.0, _UNPOSED_Z_M])
        _add_shapes(body, part.shapes, factor)
        for other in part.shapes.get("both", ()):
            for sign in (1.0, -1.0):
                _add_shapes(body, other, factor * np.array([1.0, sign, 1.0]))
        if part.radius_m:
            _add_wheel(spec, body, part, factor)
        if index == 0:
            add_bumper(body, name, type=_BOX, size=factor * half, pos=factor * middle)


def _drawn(colour: str) -> dict[str, Any]:
    return {"group": SCENERY_GROUP, "rgba": (*asset_table("mobility")["colours"][colour], 1.0), **NO_CONTACT}


def _add_shapes(body: mujoco.MjsBody, shapes: dict[str, Any], factor: float | FloatArray) -> None:
    """Add tubes, boxes and balls; a factor with y < 0 mirrors them."""
    for *ends, radius, colour in shapes.get("tubes", ()):
        size = [radius * float(np.max(factor)), 0.0, 0.0]
        body.add_geom(type=_CAPSULE, size=size, fromto=(factor * np.array(ends)).ravel(), **_drawn(colour))
    for kind, shape in (("boxes", _BOX), ("balls", _ELLIPSOID)):
        for middle, half, colour in shapes.get(kind, ()):
            size = np.abs(factor * np.array(half))
            body.add_geom(type=shape, size=size, pos=factor * np.array(middle), **_drawn(colour))


def _add_wheel(spec: SceneSpec, body: mujoco.MjsBody, part: Part, factor: float) -> None:
    """Add tyre, spokes, and the rim that hands push, outside of the tyre."""
    _, thick, spokes = part.shapes["tyre"]
    outer, thick = part.radius_m, factor * thick
    _add_ring(spec, body, outer - thick, thick, 0.0, "black")
    if "rim" in part.shapes:
        radius, thin, aside = factor * np.array(part.shapes["rim"])
        _add_ring(spec, body, radius, thin, float(np.sign(part.at_m[1]) * aside), "steel")
    for index in range(spokes):
        angle = np.pi * index / spokes
        end = (outer - thick) * np.array([np.cos(angle), 0.0, np.sin(angle)])
        size = [max(0.0022, 0.08 * thick), 0.0, 0.0]
        body.add_geom(type=_CAPSULE, size=size, fromto=[*-end, *end], **_drawn("steel"))
    hub = 1.6 * thick
    body.add_geom(type=_CAPSULE, size=[thick, 0.0, 0.0], fromto=[0.0, -hub, 0.0, 0.0, hub, 0.0], **_drawn("steel"))


def _add_ring(
    spec: SceneSpec, body: mujoco.MjsBody, radius_m: float, thick_m: float, aside_m: float, colour: str
) -> None:
    """Add a torus about the y axis."""
    angles = [2.0 * np.pi * np.arange(count) / count for count in (_AROUND, _ACROSS)]
    along, across = np.meshgrid(*angles, indexing="ij")
    out = np.stack([np.cos(along), np.zeros_like(along), np.sin(along)], axis=-1)
    normals = np.cos(across)[..., None] * out + np.sin(across)[..., None] * (0.0, 1.0, 0.0)
    vertices = radius_m * out + thick_m * normals + (0.0, aside_m, 0.0)
    grid = np.arange(_AROUND * _ACROSS).reshape(_AROUND, _ACROSS)
    a, b = grid, np.roll(grid, -1, axis=0)
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    faces = np.concatenate([np.stack([a, c, b], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)])
    name = f"{body.name}/{colour}"
    points = vertices.reshape(-1, 3), normals.reshape(-1, 3)
    spec.add_mesh_file(name, mesh_file(*points, np.zeros((len(points[0]), 2)), faces))
    add_mesh_geom(body, name, rgba=_drawn(colour)["rgba"])
