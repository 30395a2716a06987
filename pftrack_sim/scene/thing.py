"""A thing that is tracked in the place of a person: a prop on a body of its own."""

from __future__ import annotations

from functools import lru_cache

import mujoco
import numpy as np

from pftrack_sim.core.data_files import asset_table
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.people import Thing
from pftrack_sim.scene.layout import HIDDEN_GROUP, PEOPLE_GROUP
from pftrack_sim.scene.people.person import PEOPLE_CONAFFINITY, PEOPLE_CONTYPE, UNPOSED_Z_M
from pftrack_sim.scene.places.catalogue import load_prop
from pftrack_sim.scene.places.materials import add_material
from pftrack_sim.scene.places.meshes import Prop, TexturedMesh, translated
from pftrack_sim.scene.scene_spec import SceneSpec

BODY = "body"  # Name of its only part: "target/body"
BEARER, WALKER = "bearer", "walker"
"""Names of who carries it, and of a person who is not drawn, whose way a thing takes that moves by itself."""


@lru_cache(maxsize=16)
def _meshes(name: str, surface: str, height_m: float) -> Prop:
    """Its meshes [m], the middle of their bounding box at the origin, x forward, z up; read-only."""
    open_surfaces = {
        value[1:]
        for primitive in asset_table("props")[name]
        for value in primitive.values()
        if isinstance(value, str) and value.startswith("$")
    }
    prop = load_prop(name, **dict.fromkeys(sorted(open_surfaces), surface))
    corners = _extent(prop)
    scale = height_m / float(corners[1, 2] - corners[0, 2])
    middle = translated(prop, *(-corners.mean(axis=0)).tolist())
    return tuple(TexturedMesh(one.material, scale * one.vertices, one.normals, one.uv, one.faces) for one in middle)


def _meshes_of(thing: Thing) -> Prop:
    return _meshes(thing.prop, thing.surface, thing.height_m)


def half_sizes_m(thing: Thing) -> FloatArray:
    """`(3,)` half lengths of its bounding box along its own axes."""
    return _extent(_meshes_of(thing))[1]


def add_thing(spec: SceneSpec, name: str, thing: Thing) -> None:
    """Add it as a mocap body `"name/body"`, which robots collide with as with its bounding box.

    Its visible geoms are in the group of people: whatever is tracked is one of them to the truth.
    """
    body = spec.worldbody.add_body(name=f"{name}/{BODY}", mocap=True, pos=[0.0, 0.0, UNPOSED_Z_M])
    for index, mesh in enumerate(_meshes_of(thing)):
        part = f"{name}/{BODY}-{index}"
        add_material(spec, mesh.material)
        spec.add_mesh_file(part, mesh.file)
        geom = body.add_geom(name=part, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=part, material=mesh.material)
        geom.group, geom.contype, geom.conaffinity, geom.mass = PEOPLE_GROUP, 0, 0, 0.0
    body.add_geom(
        name=f"{name}/{BODY}/bumper",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=half_sizes_m(thing),
        group=HIDDEN_GROUP,
        contype=PEOPLE_CONTYPE,
        conaffinity=PEOPLE_CONAFFINITY,
        mass=0.0,
        castshadow=False,
    )


def _extent(prop: Prop) -> FloatArray:
    vertices = np.concatenate([mesh.vertices for mesh in prop])
    return np.stack([vertices.min(axis=0), vertices.max(axis=0)])
