"""The bodies of standing occluders: added once, sized and placed at every reset.

A body's place and size depend on the episode, a compiled model does not: each is a mocap body whose geoms' sizes
are written when it is placed.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from pftrack_sim.scenario import model as scenario
from pftrack_sim.scene.layout import HIDDEN_GROUP, SCENERY_GROUP
from pftrack_sim.scene.occluders import materials as surfaces
from pftrack_sim.scene.occluders.placement import Placement

HIDDEN_Z_M = -5.0
"""Height of occluders that have no place."""

CRATES = 16
"""Most crates in one stack."""

_CRATE_M = 0.62
_SMALL_M = 0.01
_SKIN_M = 0.002
_FACING_Y = ("slab", "shaft")
_FACING_X = ("shaft-sides",)
"""Boxes turned so that their local z, on whose faces MuJoCo maps flat textures, is the body's y or x."""

_TURN = {
    **dict.fromkeys(_FACING_Y, (float(np.sqrt(0.5)), -float(np.sqrt(0.5)), 0.0, 0.0)),
    **dict.fromkeys(_FACING_X, (0.5, 0.5, 0.5, 0.5)),
}

_PARTS = {
    "pillar": ("shaft", "shaft-sides", "plinth", "capital"),
    "wall": ("slab", "coping"),
    "boxes": ("stack", *(f"crate-{i + 1}" for i in range(CRATES))),
}
_MATERIAL = {
    "shaft": "occluder/concrete",
    "shaft-sides": "occluder/concrete",
    "plinth": "occluder/stone",
    "capital": "occluder/stone",
    "slab": "occluder/brick",
    "coping": "occluder/stone",
    "stack": "",
}


def occluder_names(occluders: Sequence[scenario.Occluder]) -> tuple[str | None, ...]:
    """The body of each occluder, "occluder-pillar-1" for the first of all; None for walkers, who are people."""
    return tuple(
        None if occluder.kind == "walker" else f"occluder-{occluder.kind}-{index + 1}"
        for index, occluder in enumerate(occluders)
    )


def add_occluders(spec: mujoco.MjSpec, occluders: Sequence[scenario.Occluder]) -> tuple[str, ...]:
    """Add a body for every standing occluder, out of sight until it is placed.

    Args:
        spec: The world to add to.
        occluders: As in the scenario; walkers are left out.

    Returns:
        The names of the bodies added.
    """
    names = occluder_names(occluders)
    kinds = {occluder.kind for occluder in occluders}
    _add_materials(spec, kinds)
    for name, occluder in zip(names, occluders, strict=True):
        if name is None:
            continue
        body = spec.worldbody.add_body(name=name, mocap=True, pos=[0.0, 0.0, HIDDEN_Z_M])
        parts = _PARTS[occluder.kind]
        for order, part in enumerate(parts):
            geom = body.add_geom(
                name=f"{name}/{part}",
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=[_SMALL_M] * 3,
                pos=[0.0, 0.0, 0.1],
                group=SCENERY_GROUP if part != "stack" else HIDDEN_GROUP,
                density=0.0,
                contype=1 if order == 0 else 0,
                conaffinity=2 if order == 0 else 0,
            )
            material = _MATERIAL.get(part, "occluder/crate")
            if material:
                geom.material = material
            if part in _TURN:
                geom.quat = list(_TURN[part])
            if part.startswith("crate"):
                shade = 0.82 + 0.18 * ((order * 7) % 5) / 4.0
                geom.rgba = [shade, shade, shade * 0.97, 1.0]
    return tuple(name for name in names if name is not None)


def place(model: mujoco.MjModel, data: mujoco.MjData, index: int, placement: Placement) -> None:
    """Put an occluder where it was planned; after `mj_resetData`, before `mj_forward`.

    Args:
        model: Compiled with `add_occluders`; its geoms' sizes are written.
        data: Its mocap pose is written.
        index: Which one, in the scenario's list of occluders.
        placement: Where it stands and how large it is.
    """
    name = f"occluder-{placement.kind}-{index + 1}"
    body = model.body(name).id
    (width, thickness), height = placement.half_m, placement.height_m
    mocap = model.body_mocapid[body]
    data.mocap_pos[mocap] = (*placement.centre_m, 0.0)
    data.mocap_quat[mocap] = (np.cos(0.5 * placement.yaw_rad), 0.0, 0.0, np.sin(0.5 * placement.yaw_rad))
    whole = (np.array([0.0, 0.0, 0.5 * height]), np.array([width, thickness, 0.5 * height]))
    _fit(model, f"{name}/{_PARTS[placement.kind][0]}", *whole)
    if placement.kind == "pillar":
        # Each face is drawn by the one of two boxes whose texture lies flat on it.
        _fit(model, f"{name}/shaft-sides", whole[0], whole[1] + np.array([_SKIN_M, -_SKIN_M, 0.0]))
        brim = 0.02
        _fit(model, f"{name}/plinth", np.array([0, 0, 0.07]), np.array([width + brim, thickness + brim, 0.07]))
        top = np.array([0, 0, height - 0.06])
        _fit(model, f"{name}/capital", top, np.array([width + brim, thickness + brim, 0.06]))
    elif placement.kind == "wall":
        # The coping lies within the wall's height and width: the outline is the one that was planned.
        cap = min(0.05, 0.25 * height)
        _fit(
            model,
            f"{name}/slab",
            np.array([0, 0, 0.5 * (height - cap)]),
            np.array([width, thickness, (height - cap) / 2]),
        )
        _fit(
            model,
            f"{name}/coping",
            np.array([0, 0, height - 0.5 * cap]),
            np.array([width, thickness + 0.03, 0.5 * cap]),
        )
    else:
        _stack(model, name, width, thickness, height)
    # Nodes of the body's bounding volumes: each is given the whole, which is correct if not tight.
    first, count = model.body_bvhadr[body], model.body_bvhnum[body]
    model.bvh_aabb[first : first + count] = np.concatenate(whole)


def _add_materials(spec: mujoco.MjSpec, kinds: set[str]) -> None:
    flat, cube = mujoco.mjtTexture.mjTEXTURE_2D, mujoco.mjtTexture.mjTEXTURE_CUBE
    wanted = []
    if "pillar" in kinds:
        wanted.append(("occluder/concrete", flat, surfaces.concrete(), [2.0, 2.0]))
    if "wall" in kinds:
        wanted.append(("occluder/brick", flat, surfaces.brick(), [2.0, 2.0]))
    if "boxes" in kinds:
        wanted.append(("occluder/crate", cube, surfaces.crate(), [1.0, 1.0]))
    for name, kind, image, repeat in wanted:
        faces = 6 if kind == cube else 1
        texture = spec.add_texture(
            name=name,
            type=kind,
            colorspace=mujoco.mjtColorSpace.mjCOLORSPACE_LINEAR,
            width=image.shape[1],
            height=image.shape[0] * faces,
            nchannel=3,
        )
        texture.data = np.concatenate([image] * faces).tobytes()
        textures = [""] * int(mujoco.mjtTextureRole.mjNTEXROLE)
        textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
        spec.add_material(name=name, textures=textures, texuniform=True, texrepeat=repeat, specular=0.1, shininess=0.1)
    if kinds & {"pillar", "wall"}:
        spec.add_material(name="occluder/stone", rgba=[0.62, 0.61, 0.58, 1.0], specular=0.1, shininess=0.1)


def _stack(model: mujoco.MjModel, name: str, width: float, thickness: float, height: float) -> None:
    """Crates that fill a box from edge to edge, in whole columns and rows."""
    columns = int(np.clip(round(2.0 * width / _CRATE_M), 1, 8))
    rows = int(np.clip(round(height / _CRATE_M), 1, CRATES // columns))
    half_x, half_z = width / columns, 0.5 * height / rows
    for number in range(CRATES):
        row, column = divmod(number, columns)
        geom = f"{name}/crate-{number + 1}"
        if row >= rows:
            _fit(model, geom, np.array([0.0, 0.0, HIDDEN_Z_M]), np.full(3, _SMALL_M))
            continue
        # A crate is a little narrower from front to back than its neighbour, so that each is seen as one.
        half_y = thickness * (1.0 - 0.06 * ((row * 5 + column * 3) % 4) / 3.0)
        centre = np.array([(2 * column + 1) * half_x - width, 0.0, (2 * row + 1) * half_z])
        _fit(model, geom, centre, np.array([half_x, half_y, half_z]))


def _fit(model: mujoco.MjModel, name: str, centre: np.ndarray, half: np.ndarray) -> None:
    """Give a box geom a place in its body and a size along the body's axes [m]."""
    geom = model.geom(name).id
    part = name.rsplit("/", 1)[1]
    size = half[[0, 2, 1]] if part in _FACING_Y else half[[1, 2, 0]] if part in _FACING_X else half
    model.geom_pos[geom] = centre
    model.geom_size[geom] = size
    model.geom_rbound[geom] = np.linalg.norm(size)
    model.geom_aabb[geom] = (0.0, 0.0, 0.0, *size)
    # Compiled where it was, a geom may be known to share its body's frame: it no longer does.
    model.geom_sameframe[geom] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
