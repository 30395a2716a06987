"""Rooms from files: what `room_map`, `room_mjcf` and `room_mesh` read, and how it becomes a place."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.data_files import asset_table
from pftrack_sim.scene.layout import SCENERY_GROUP, WalkableArea
from pftrack_sim.scene.places.builder import Item, PlaceBuilder
from pftrack_sim.scene.places.materials import add_skybox
from pftrack_sim.scene.scene_spec import NO_CONTACT, SceneSpec

MOST_TRIANGLES = 400_000


class Surface(NamedTuple):
    """Material of a room.

    Attributes:
        rgba: Red, green, blue and opacity, 0 to 1, which the image is multiplied by.
        image: `(H, W, 3)` texture, or None; of a cube if it is six times as high as wide.
        repeat: How often the texture repeats in both directions; if `uniform`, in a metre.
    """

    rgba: tuple[float, float, float, float]
    image: NDArray[np.uint8] | None = None
    repeat: tuple[float, float] = (1.0, 1.0)
    uniform: bool = False
    emission: float = 0.0


class Solid(NamedTuple):
    """A geom of MuJoCo that is no mesh, by its arguments in the world frame."""

    owner: str
    geom: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Room:
    """What a file holds, with its floor at height 0; kept from episode to episode.

    Attributes:
        items: What is drawn of meshes.
        surfaces: The materials of items and solids that are not those of the places, by name.
        lights: Arguments of MuJoCo's lights; those of `assets/places/room.toml` if there are none.
        sky: Whether there is a sky above.
    """

    area: WalkableArea
    items: tuple[Item, ...]
    solids: tuple[Solid, ...] = ()
    surfaces: Mapping[str, Surface] = field(default_factory=dict[str, Surface])
    lights: tuple[Mapping[str, Any], ...] = ()
    sky: bool = True


def add_room(builder: PlaceBuilder, room: Room) -> WalkableArea:
    """Add a room to a place under construction. Returns its walkable area.

    What is drawn collides with nothing: the hidden colliders are those of the area's footprints, as everywhere.
    """
    spec, table = builder.spec, asset_table("places/room")
    if room.sky:
        add_skybox(spec, table["sky"])
    for name, surface in room.surfaces.items():
        add_surface(spec, name, surface)
    for item in room.items:
        builder.add(item)
    for number, solid in enumerate(room.solids):
        body = spec.body(solid.owner) or spec.worldbody.add_body(name=solid.owner)
        body.add_geom(name=f"{solid.owner}/{number}", **solid.geom, group=SCENERY_GROUP, **NO_CONTACT)
    for footprint in room.area.footprints:
        collider = (*footprint.half_m, footprint.height_m)
        builder.add(Item(footprint.name, (), (*footprint.centre_m, 0.0), footprint.yaw_rad, collider))
    for number, light in enumerate(room.lights, start=1):
        shadow = bool(light["castshadow"]) and builder.lights.shadows
        spec.worldbody.add_light(name=f"light/lamp-{number}", **{**light, "castshadow": shadow})
    for kind, values in table["light"].items():
        if kind == "ambient" or not room.lights:
            getattr(builder, f"add_{kind}")(**values)
    # The rectangles are coarser than what is drawn.
    return builder.finish(room.area.goals_m, contact=False)


def add_surface(spec: SceneSpec, name: str, surface: Surface) -> None:
    """Add a material of a file."""
    material = spec.add_material(name=name, emission=surface.emission, specular=0.0, shininess=0.0)
    material.rgba, material.texrepeat, material.texuniform = surface.rgba, surface.repeat, surface.uniform
    if surface.image is not None:
        height, width = surface.image.shape[:2]
        kind = mujoco.mjtTexture.mjTEXTURE_CUBE if height == 6 * width else mujoco.mjtTexture.mjTEXTURE_2D
        spec.add_image(f"{name}/image", surface.image, kind)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = f"{name}/image"


def distinct_names(names: Iterable[str]) -> list[str]:
    """Names of bodies for what files call so: all different, and none of those of people, robot and place."""
    seen: dict[str, int] = {}
    found: list[str] = []
    for name in names:
        plain = "room-" + (re.sub(r"[^A-Za-z0-9_.-]+", "-", name).strip("-")[:60] or "part")
        seen[plain] = seen.get(plain, 0) + 1
        found.append(plain if seen[plain] == 1 else f"{plain}-{seen[plain]}")
    return found
