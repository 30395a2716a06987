"""A thing that is tracked in the place of a person: a prop, or the meshes of a file, on a body of its own."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import mujoco
import numpy as np

from pftrack_sim.core.data_files import asset_table
from pftrack_sim.core.errors import ParameterError, ScenarioError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.section import UpAxis
from pftrack_sim.scenario.thing import Thing
from pftrack_sim.scene.layout import PEOPLE_GROUP
from pftrack_sim.scene.people.person import UNPOSED_Z_M
from pftrack_sim.scene.places.catalogue import load_prop
from pftrack_sim.scene.places.materials import add_material
from pftrack_sim.scene.places.mesh_file import drawn, read_meshes
from pftrack_sim.scene.places.meshes import Prop, TexturedMesh, translated
from pftrack_sim.scene.places.room import Surface, add_surface
from pftrack_sim.scene.scene_spec import SceneSpec, add_bumper, add_mesh_geom

BODY = "body"  # Name of its only part: "target/body"
BEARER, WALKER = "bearer", "walker"
"""Names of who carries it, and of a person who is not drawn, whose way a thing takes that moves by itself."""
_ROUND = 1.06  # A ball of triangles, or one whose height is scaled, is not round to the last digit


@lru_cache(maxsize=16)
def _of_file(model: str, up: UpAxis, digest: str) -> tuple[Prop, Mapping[str, Surface]]:
    """The meshes of a file, read once as long as its digest stays the same, and their materials."""
    try:
        found = read_meshes(Path(model), up)
    except ParameterError as error:
        raise ScenarioError(model, [f"target.thing.model: {error}"]) from None
    materials = [f"thing/{number}" for number in range(len(found))]
    shown = [drawn(mesh, name, mesh.triangles) for name, mesh in zip(materials, found, strict=True)]
    prop = tuple(mesh for mesh in shown if mesh is not None)
    if not prop or not np.ptp(_extent(prop)[:, 2]):
        raise ScenarioError(model, ["target.thing.model: has no height; check target.thing.up"])
    return prop, {name: mesh.surface for name, mesh in zip(materials, found, strict=True)}


@lru_cache(maxsize=16)
def _of_catalogue(name: str, surface: str) -> Prop:
    open_surfaces = {
        value[1:]
        for primitive in asset_table("props")[name]
        for value in primitive.values()
        if isinstance(value, str) and value.startswith("$")
    }
    return load_prop(name, **dict.fromkeys(sorted(open_surfaces), surface))


@lru_cache(maxsize=16)
def _scaled(prop: Prop, height_m: float) -> Prop:
    """Its meshes [m], the middle of their bounding box at the origin, x forward, z up; read-only."""
    corners = _extent(prop)
    scale = height_m / float(corners[1, 2] - corners[0, 2])
    middle = translated(prop, *(-corners.mean(axis=0)).tolist())
    return tuple(TexturedMesh(one.material, scale * one.vertices, one.normals, one.uv, one.faces) for one in middle)


def _meshes_of(thing: Thing) -> Prop:
    if thing.model is None:
        return _scaled(_of_catalogue(str(thing.prop), thing.surface), thing.height_m)
    return _scaled(_of_file(thing.model, thing.up, thing.model_digest)[0], thing.height_m)


def half_sizes_m(thing: Thing) -> FloatArray:
    """`(3,)` half lengths of its bounding box along its own axes."""
    return _extent(_meshes_of(thing))[1]


def solid(thing: Thing) -> tuple[mujoco.mjtGeom, list[float]]:
    """The shape that collides, with its size as MuJoCo has it, about the middle of the bounding box.

    Of what is pushed a ball, or an upright cylinder, where it is about as round as that; else the bounding box.
    """
    half_x, half_y, half_z = half_sizes_m(thing).tolist()
    if thing.moves == "pushed":
        vertices = np.concatenate([mesh.vertices for mesh in _meshes_of(thing)])
        if np.hypot(*vertices.T[:2]).max() <= _ROUND * min(half_x, half_y):
            if np.linalg.norm(vertices, axis=1).max() <= _ROUND * half_z <= _ROUND**2 * half_x:
                return mujoco.mjtGeom.mjGEOM_SPHERE, [half_z, 0.0, 0.0]
            return mujoco.mjtGeom.mjGEOM_CYLINDER, [0.5 * (half_x + half_y), half_z, 0.0]
    return mujoco.mjtGeom.mjGEOM_BOX, [half_x, half_y, half_z]


def add_thing(spec: SceneSpec, name: str, thing: Thing) -> None:
    """Add it as a mocap body `"name/body"`, which robots collide with as with its `solid`.

    Its visible geoms are in the group of people: whatever is tracked is one of them to the truth.
    """
    body = spec.worldbody.add_body(name=f"{name}/{BODY}", mocap=True, pos=[0.0, 0.0, UNPOSED_Z_M])
    surfaces: Mapping[str, Surface] = (
        {} if thing.model is None else _of_file(thing.model, thing.up, thing.model_digest)[1]
    )
    for material, surface in surfaces.items():
        add_surface(spec, material, surface)
    for index, mesh in enumerate(_meshes_of(thing)):
        part = f"{name}/{BODY}-{index}"
        if mesh.material not in surfaces:
            add_material(spec, mesh.material)
        spec.add_mesh_file(part, mesh.file)
        add_mesh_geom(body, part, group=PEOPLE_GROUP, material=mesh.material)
    kind, size = solid(thing)
    add_bumper(body, body.name, type=kind, size=size)


def _extent(prop: Prop) -> FloatArray:
    vertices = np.concatenate([mesh.vertices for mesh in prop])
    return np.stack([vertices.min(axis=0), vertices.max(axis=0)])
