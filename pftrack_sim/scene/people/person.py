"""People of an episode: sampling by appearance similarity to the target, and their bodies in the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType

import mujoco
import numpy as np

from pftrack_sim.core.random_streams import stream
from pftrack_sim.core.types import IntArray
from pftrack_sim.scenario.clothes import Clothes
from pftrack_sim.scenario.mobility import Mobility
from pftrack_sim.scene.layout import PEOPLE_GROUP
from pftrack_sim.scene.people import body_meshes
from pftrack_sim.scene.people.anatomy import Anatomy, sample_anatomy
from pftrack_sim.scene.people.head_mesh import head_mesh
from pftrack_sim.scene.people.mesh import TriangleMesh, mirrored
from pftrack_sim.scene.people.mobility import add_mobility, body_name, parts
from pftrack_sim.scene.people.outfit import Outfit, dressed, groomed, sample_outfit, similar_outfit
from pftrack_sim.scene.people.texture_atlas import ATLAS_SIZE, paint_atlas
from pftrack_sim.scene.scene_spec import BLANK, SceneSpec, add_bumper, add_mesh_geom

_PAIRED_PARTS = {
    "upper-arm": body_meshes.upper_arm_mesh,
    "forearm": body_meshes.forearm_mesh,
    "thigh": body_meshes.thigh_mesh,
    "shank": body_meshes.shank_mesh,
    "foot": body_meshes.foot_mesh,
}

PARTS: tuple[str, ...] = (
    *("pelvis", "torso", "head"),
    *(f"{side}-{part}" for part in _PAIRED_PARTS for side in ("left", "right")),
)
"""Names of the 13 parts, in the order of `Gait.poses`.

The frame of a part is at its upper joint (pelvis: midway between the hip joints; head: base of the neck; foot: ankle),
x forward, y left, z up when standing.
"""

TRUNK: tuple[str, ...] = ("pelvis", "torso")
"""The parts of the trunk: from the hips to the base of the neck, without arms."""

UNPOSED_Z_M = -5.0  # height of parts before the first pose is written: below the ground, out of the robot's way


@dataclass(frozen=True)
class Person:
    """A person in the scene. The bodies are named `"name/part"`, as in `"target/pelvis"`."""

    name: str
    anatomy: Anatomy
    outfit: Outfit
    uses: Mobility | None = None


def sample_others(seed: int, target: Person, similarities: Mapping[str, Sequence[float]]) -> tuple[Person, ...]:
    """Sample the others by their roles: `crosser-1`, `crosser-2`, ...; adding a person changes no other.

    A similarity is that of the appearance to the target, in clothes, height and girth, from 0 to 1 (the same clothes
    and body). Who crosses the line of sight, to cover the target, is no smaller and no slimmer.
    """
    return tuple(
        _similar_person(seed, f"{role}-{number}", target, similarity)
        for role, own in similarities.items()
        for number, similarity in enumerate(own, start=1)
    )


def sample_target(seed: int, name: str, height_m: float, clothes: Clothes, uses: Mobility | None = None) -> Person:
    """Sample a target; what `clothes` says is not drawn."""
    return Person(
        name,
        groomed(sample_anatomy(stream(seed, "anatomy", name), height_m), clothes),
        dressed(sample_outfit(stream(seed, "clothes", name)), clothes),
        uses,
    )


def _similar_person(seed: int, name: str, target: Person, similarity: float) -> Person:
    outfit = similar_outfit(stream(seed, "clothes", name), target.outfit, similarity)
    if similarity == 1.0:
        return Person(name, target.anatomy, outfit)
    independent = sample_anatomy(stream(seed, "anatomy", name))
    height = independent.height_m + similarity * (target.anatomy.height_m - independent.height_m)
    girth = independent.girth + similarity * (target.anatomy.girth - independent.girth)
    if name.startswith("crosser"):
        height, girth = max(height, target.anatomy.height_m), max(girth, target.anatomy.girth)
    return Person(name, replace(sample_anatomy(stream(seed, "anatomy", name), height), girth=girth), outfit)


@lru_cache(maxsize=16)
def part_meshes(person: Person) -> Mapping[str, TriangleMesh]:
    """The mesh of every part in its own frame, in the order of `PARTS`; read-only."""
    anatomy, outfit = person.anatomy, person.outfit
    meshes = {
        "pelvis": body_meshes.pelvis_mesh(anatomy, outfit),
        "torso": body_meshes.torso_mesh(anatomy, outfit),
        "head": head_mesh(anatomy),
    }
    for part, build in _PAIRED_PARTS.items():
        left = build(anatomy, outfit)
        meshes |= {f"left-{part}": left, f"right-{part}": mirrored(left)}
    return MappingProxyType(meshes)


def add_person(spec: SceneSpec, person: Person) -> None:
    """Add the 13 mocap bodies of a person to the world body, each with one textured mesh.

    Visual geoms are in `PEOPLE_GROUP` and never collide; capsules in `HIDDEN_GROUP` collide with robots.
    """
    name = person.name
    texture = f"{name}/skin-and-cloth"
    spec.add_image(texture, paint_atlas(person.anatomy, person.outfit) if spec.draws else BLANK)
    material = spec.add_material(name=f"{name}/surface", specular=0.06, shininess=0.1, reflectance=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = texture
    capsules = _collision_capsules(person.anatomy)
    if person.uses is not None:
        add_mobility(spec, name, person.uses, person.anatomy.height_m)
    for part, triangles in part_meshes(person).items():
        full_name = f"{name}/{part}"
        coordinates = triangles.pixels / ATLAS_SIZE
        points = triangles.vertices, triangles.normals, coordinates
        spec.add_detailed_mesh(full_name, *points, (triangles.faces, *triangles.coarse))
        body = spec.worldbody.add_body(name=full_name, mocap=True, pos=[0.0, 0.0, UNPOSED_Z_M])
        shadow = not part.endswith(("foot", "forearm"))
        add_mesh_geom(body, full_name, group=PEOPLE_GROUP, material=material.name, castshadow=shadow)
        if part in capsules:
            radius, ends = capsules[part]
            add_bumper(body, full_name, type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=ends, size=[radius, 0.0, 0.0])


def part_mocap_ids(model: mujoco.MjModel, names: Sequence[str]) -> IntArray:
    """`(P, 13)` ids of the mocap bodies of people with these names, in the order of `PARTS`."""
    ids = [[int(model.body(f"{name}/{part}").mocapid[0]) for part in PARTS] for name in names]
    return np.array(ids, dtype=np.intp).reshape(-1, len(PARTS))


def mobility_names(person: Person) -> list[str]:
    """Names of the bodies of what a person moves with, in the order of its parts."""
    if person.uses is None:
        return []
    return [body_name(person.name, person.uses, part.name) for part in parts(person.uses, person.anatomy.height_m)]


def _collision_capsules(anatomy: Anatomy) -> dict[str, tuple[float, list[float]]]:
    """Radius and both end points [m] of the capsule inside each part that has one."""
    h = anatomy.height_m
    hip, chest, limb = 0.068 * h * anatomy.girth, 0.072 * h * anatomy.girth, 0.040 * h
    hip_half, chest_half, chest_z = anatomy.hip_half_m * 0.6, anatomy.shoulder_half_m * 0.6, 0.62 * anatomy.torso_m
    capsules = {
        "pelvis": (hip, [0.0, -hip_half, 0.0, 0.0, hip_half, 0.0]),
        "torso": (chest, [0.0, -chest_half, chest_z, 0.0, chest_half, chest_z]),
    }
    for side in ("left", "right"):
        capsules[f"{side}-thigh"] = (limb, [0.0, 0.0, -0.03 * h, 0.0, 0.0, -anatomy.thigh_m])
        capsules[f"{side}-shank"] = (0.8 * limb, [0.0, 0.0, 0.0, 0.0, 0.0, -anatomy.shank_m])
    return capsules
