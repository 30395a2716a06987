"""Things that the target carries: a bag, a box, a backpack, an umbrella.

They are no part of the person: as in COCO (Lin et al. 2014), where bags and umbrellas are objects of their own, a
person's box ends at the body, and what is carried in front of it occludes it.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

import mujoco
import numpy as np

from pftrack_sim.core.types import FloatArray, IntArray
from pftrack_sim.scenario.people import Carried, Item
from pftrack_sim.scene.layout import SCENERY_GROUP
from pftrack_sim.scene.scene_spec import NO_CONTACT

RESTING_HEIGHT_M: dict[Item, float] = {"bag": 0.48, "box": 0.14, "backpack": 0.24, "umbrella": 0.05}
"""Height of the origin above the ground when put down. The origin of bag and umbrella is the grip, else the centre."""

_HIDDEN_Z_M = -7.0
_DARK = (0.12, 0.12, 0.13, 1.0)
_SHAFT_M, _CANOPY_M, _CANOPY_HEIGHT_M = 0.74, 0.50, 0.20
_BOX, _CAPSULE, _ELLIPSOID = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_ELLIPSOID


def add_props(spec: mujoco.MjSpec, carried: Iterable[Carried]) -> None:
    """Add a mocap body for each thing, named like it; x forward, y left, z up when it is carried."""
    for one in carried:
        colour = (*(channel / 255.0 for channel in one.colour), 1.0)
        darker = (*(0.7 * channel for channel in colour[:3]), 1.0)
        body = spec.worldbody.add_body(name=one.item, mocap=True, pos=[0.0, 0.0, _HIDDEN_Z_M])
        add = partial(body.add_geom, group=SCENERY_GROUP, **NO_CONTACT)
        match one.item:
            case "bag":
                add(type=_BOX, size=[0.16, 0.05, 0.165], pos=[0.0, 0.0, -0.315], rgba=colour)
                add(type=_BOX, size=[0.162, 0.052, 0.02], pos=[0.0, 0.0, -0.17], rgba=darker)
                for x in (-0.08, 0.08):
                    add(type=_CAPSULE, size=[0.008, 0.0, 0.0], fromto=[x, 0.0, -0.15, 0.25 * x, 0.0, 0.0], rgba=_DARK)
            case "box":
                add(type=_BOX, size=[0.15, 0.19, 0.14], rgba=colour)
                add(type=_BOX, size=[0.151, 0.03, 0.141], rgba=darker)
            case "backpack":
                add(type=_BOX, size=[0.075, 0.135, 0.19], rgba=colour)
                add(type=_ELLIPSOID, size=[0.075, 0.135, 0.08], pos=[0.0, 0.0, 0.19], rgba=colour)
                add(type=_BOX, size=[0.03, 0.10, 0.09], pos=[-0.10, 0.0, -0.07], rgba=darker)
            case "umbrella":
                add(type=_CAPSULE, size=[0.009, 0.0, 0.0], fromto=[0.0, 0.0, -0.05, 0.0, 0.0, _SHAFT_M], rgba=_DARK)
                vertices, faces = _canopy()
                mesh = spec.add_mesh(name=f"{one.item}/canopy", inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
                mesh.uservert, mesh.userface = vertices.ravel(), faces.ravel()
                add(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh.name, pos=[0.0, 0.0, _SHAFT_M], rgba=colour)


def _canopy(ribs: int = 8) -> tuple[FloatArray, IntArray]:
    """`(V, 3)` vertices [m] and `(F, 3)` faces of a shell between two caps; its top is the origin."""
    angles = 2.0 * np.pi * np.arange(ribs) / ribs
    shares = np.array([0.35, 0.7, 1.0])
    rings = [
        np.column_stack([r * _CANOPY_M * np.cos(angles), r * _CANOPY_M * np.sin(angles), np.full(ribs, z)])
        for inner in (0.0, 0.012)
        for r, z in zip(shares, -_CANOPY_HEIGHT_M * shares**2 - inner, strict=True)
    ]
    # The outer cap from its top to the rim, then the inner one from the rim to its top.
    order = [rings[0], rings[1], rings[2], rings[5], rings[4], rings[3]]
    tops = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -0.012]])
    vertices = np.concatenate([tops, *order])
    start, step = 2, np.arange(ribs)
    faces = [np.stack([np.zeros(ribs), start + step, start + (step + 1) % ribs], 1)]
    for ring in range(len(order) - 1):
        a, b = start + ring * ribs + step, start + ring * ribs + (step + 1) % ribs
        faces += [np.stack([a, a + ribs, b], 1), np.stack([b, a + ribs, b + ribs], 1)]
    last = start + (len(order) - 1) * ribs
    faces.append(np.stack([last + step, np.ones(ribs), last + (step + 1) % ribs], 1))
    return vertices, np.concatenate(faces).astype(np.intp)
