"""A person in a model: 13 mocap bodies with one textured mesh each, and a few hidden capsules that a robot can hit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco

from pftrack_sim.scene.layout import HIDDEN_GROUP, PEOPLE_GROUP
from pftrack_sim.scene.people import atlas, limbs, trunk
from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.people.clothes import Outfit
from pftrack_sim.scene.people.head import head_shell
from pftrack_sim.scene.people.mesh import TriangleMesh, mirrored

PARTS: tuple[str, ...] = (
    "pelvis",
    "torso",
    "head",
    "left-upper-arm",
    "right-upper-arm",
    "left-forearm",
    "right-forearm",
    "left-thigh",
    "right-thigh",
    "left-shank",
    "right-shank",
    "left-foot",
    "right-foot",
)
"""Parts of a person, in the order of `Gait.poses`.

Each part's frame sits in its upper joint (pelvis: midway between the hip joints; head: base of the neck; foot: ankle),
x forward, y left, z up when standing.
"""

PEOPLE_CONTYPE = 4
PEOPLE_CONAFFINITY = 2
"""Collision bits: people collide with robots and nothing else."""

_SHADOWLESS = frozenset({"left-foot", "right-foot", "left-forearm", "right-forearm"})

UNPOSED_Z_M = -5.0
"""Height of the parts of people who have no pose yet."""


@dataclass(frozen=True)
class Person:
    """Someone in the scene: the name is the root of the names of all parts, as in `"target/pelvis"`."""

    name: str
    anatomy: Anatomy
    outfit: Outfit


def part_shells(person: Person) -> dict[str, TriangleMesh]:
    """The mesh of every part, in its part's frame."""
    body, worn = person.anatomy, person.outfit
    shells = {"pelvis": trunk.pelvis(body, worn), "torso": trunk.torso(body, worn), "head": head_shell(body)}
    paired: dict[str, Callable[[Anatomy, Outfit], TriangleMesh]] = {
        "upper-arm": limbs.upper_arm,
        "forearm": limbs.forearm,
        "thigh": limbs.thigh,
        "shank": limbs.shank,
        "foot": limbs.foot,
    }
    for part, build in paired.items():
        left = build(body, worn)
        shells[f"left-{part}"] = left
        shells[f"right-{part}"] = mirrored(left)
    return {part: shells[part] for part in PARTS}


def add_person(spec: mujoco.MjSpec, person: Person) -> None:
    """Add 13 mocap bodies named `"name/part"` to the world body.

    Drawn geoms are in `PEOPLE_GROUP` and never collide; capsules in `HIDDEN_GROUP` collide with robots.
    """
    name = person.name
    picture = spec.add_texture(
        name=f"{name}/skin-and-cloth",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        nchannel=3,
        width=atlas.SIZE,
        height=atlas.SIZE,
    )
    picture.data = atlas.painted(person.anatomy, person.outfit).tobytes()
    material = spec.add_material(name=f"{name}/surface", specular=0.06, shininess=0.1, reflectance=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = f"{name}/skin-and-cloth"
    colliders = _colliders(person.anatomy)
    for part, shell in part_shells(person).items():
        full = f"{name}/{part}"
        mesh = spec.add_mesh(name=full, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        mesh.uservert = shell.vertices.ravel()
        mesh.usernormal = shell.normals.ravel()
        mesh.usertexcoord = (shell.pixels / atlas.SIZE).ravel()
        mesh.userface = shell.faces.ravel()
        # Below ground until a pose is written, so that nobody stands in the way of a rehearsal.
        body = spec.worldbody.add_body(name=full, mocap=True, pos=[0.0, 0.0, UNPOSED_Z_M])
        body.add_geom(
            name=full,
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=full,
            material=material.name,
            group=PEOPLE_GROUP,
            contype=0,
            conaffinity=0,
            mass=0.0,
            castshadow=part not in _SHADOWLESS,
        )
        if part in colliders:
            radius, ends = colliders[part]
            body.add_geom(
                name=f"{full}/bumper",
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                fromto=ends,
                size=[radius, 0.0, 0.0],
                group=HIDDEN_GROUP,
                contype=PEOPLE_CONTYPE,
                conaffinity=PEOPLE_CONAFFINITY,
                mass=0.0,
                castshadow=False,
            )


def _colliders(anatomy: Anatomy) -> dict[str, tuple[float, list[float]]]:
    """Radius and both ends [m] of the capsule inside a part."""
    h = anatomy.height_m
    hip, chest, limb = 0.068 * h * anatomy.girth, 0.072 * h * anatomy.girth, 0.040 * h
    side, breast = anatomy.hip_half_m * 0.6, anatomy.shoulder_half_m * 0.6
    found = {
        "pelvis": (hip, [0.0, -side, 0.0, 0.0, side, 0.0]),
        "torso": (chest, [0.0, -breast, 0.62 * anatomy.torso_m, 0.0, breast, 0.62 * anatomy.torso_m]),
    }
    for left_or_right in ("left", "right"):
        found[f"{left_or_right}-thigh"] = (limb, [0.0, 0.0, -0.03 * h, 0.0, 0.0, -anatomy.thigh_m])
        found[f"{left_or_right}-shank"] = (0.8 * limb, [0.0, 0.0, 0.0, 0.0, 0.0, -anatomy.shank_m])
    return found
