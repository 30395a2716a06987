"""Adds props, colliders and lights to a spec, and records the footprints of what stands on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.model import Lights
from pftrack_sim.scene.layout import (
    CONTACT_OF_THINGS,
    GROUND,
    HIDDEN_GROUP,
    Bounds,
    Footprint,
    WalkableArea,
    edges,
)
from pftrack_sim.scene.places.materials import add_material
from pftrack_sim.scene.places.meshes import Prop, merged_by_material
from pftrack_sim.scene.places.shade import foliage, ground_contact, roof_with_windows
from pftrack_sim.scene.scene_spec import SceneSpec, add_box, add_mesh_geom

_LEAST_WINDOW_SUN_DEG = 40.0  # A lower sun would meet the walls, not the floor
_FOLIAGE_M = 7.0  # Height of the foliage that is not seen and casts shadows
_DISTANT = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL

Collider: TypeAlias = tuple[float, float, float]
"""Half width along x, half width along y, height [m] of a box that stands on the ground."""


class Item(NamedTuple):
    """Something that stands in a place.

    Attributes:
        name: Of its body.
        prop: Meshes in the frame of the body, whose origin lies on the ground.
        position_m: x, y, z.
        yaw_rad: Counter-clockwise.
        collider: A box that the robot collides with and people avoid; None for what hangs or lies flat.
        shadow: Whether it casts one; `"front"` if the sun is behind it.
    """

    name: str
    prop: Prop
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_rad: float = 0.0
    collider: Collider | None = None
    shadow: bool | Literal["front"] = True


@dataclass(eq=False)
class PlaceBuilder:
    """A place under construction.

    Attributes:
        bounds: Of the walkable area.
        lights: Light of the place.
        patch_rng: Draws the patches of light.
    """

    spec: SceneSpec
    rng: np.random.Generator
    bounds: Bounds
    lights: Lights
    patch_rng: np.random.Generator
    _footprints: list[Footprint] = field(default_factory=list[Footprint])
    _ground_m: list[float] = field(default_factory=list[float])

    def add(self, item: Item) -> None:
        """Add a body with one drawn geom per material."""
        name, prop, (x, y, z), yaw_rad, collider, shadow = item
        if shadow == "front":
            # Every triangle costs time in the shadow pass, and what has the sun before it casts its shadow outwards.
            shadow = float(sun_direction(self.lights)[:2] @ (np.sin(yaw_rad), -np.cos(yaw_rad))) > 1e-9
        quaternion = [np.cos(0.5 * yaw_rad), 0.0, 0.0, np.sin(0.5 * yaw_rad)]
        body = self.spec.worldbody.add_body(name=name, pos=[x, y, z], quat=quaternion)
        for mesh in merged_by_material(prop):
            part = f"{name}/{mesh.material}"
            add_material(self.spec, mesh.material)
            self.spec.add_mesh_file(part, mesh.file)
            add_mesh_geom(body, part, material=mesh.material, castshadow=shadow)
        if collider is not None:
            half_x, half_y, height = collider
            _add_collider(body, name, collider, 0.5 * height - z)
            self._footprints.append(Footprint(name, (float(x), float(y)), (half_x, half_y), float(yaw_rad), height))
            self._ground_m.append(z)

    def add_loose(self, items: Sequence[Item], share: float, displacement: Sequence[float]) -> None:
        """Add a random share of some items.

        They are displaced at random, at most by `displacement` in x, y [m] and optionally yaw [deg].
        """
        reach = np.array(displacement, dtype=np.float64)
        reach[2:] = np.deg2rad(reach[2:])
        offsets = self.rng.uniform(-1.0, 1.0, (len(items), len(reach))) * reach
        order = self.rng.permutation(len(items))
        for index in sorted(int(k) for k in order[: round(share * len(items))]):
            item, (dx, dy, turn) = items[index], (*offsets[index], 0.0)[:3]
            x, y, z = item.position_m
            self.add(item._replace(position_m=(x + dx, y + dy, z), yaw_rad=item.yaw_rad + turn))

    def add_ambient(self, rgb: ArrayLike, patches_take: float = 0.0) -> None:
        """Add light that reaches everything equally: the ambient part of the headlight, whose other parts are off."""
        headlight = self.spec.visual.headlight
        headlight.ambient = self._shaded(rgb, patches_take)
        headlight.diffuse = headlight.specular = [0.0, 0.0, 0.0]
        headlight.active = 1

    def add_daylight(self, sun: ArrayLike, sky: ArrayLike) -> None:
        """Add sun, partly behind the foliage of trees over the area, and sky, by their colours."""
        lights, direction = self.lights, sun_direction(self.lights)
        self._add_light("sun", _DISTANT, direction, sun, casts_shadow=lights.shadows)
        if lights.patches:
            crowns = foliage(self.bounds, lights.patches, lights.patch_m, _FOLIAGE_M, self.patch_rng)
            if lights.shadows and len(crowns.faces):
                self.add(Item("foliage", (crowns,)))
        # Light from the sky has a direction: without it all shaded fronts would look flat.
        self.add_fill("sky", (-0.75 * direction[0], -0.75 * direction[1], -0.5), sky)

    def add_ceiling(self, height: float, sun: ArrayLike, direction: ArrayLike, lamps: ArrayLike) -> None:
        """Add light from above: of the sun through windows in the roof if it has patches, else the sum of all lamps.

        `height` is that of the roof [m], `sun` a colour, and `lamps` the colour of what reaches the floor from all
        lamps together, in a mean `direction`.
        """
        lights = self.lights
        if not lights.patches:
            self._add_light("lamp-above", _DISTANT, direction, lamps)
            return
        elevation_deg = max(lights.sun_elevation_deg, _LEAST_WINDOW_SUN_DEG)
        above = sun_direction(lights.model_copy(update={"sun_elevation_deg": elevation_deg}))
        roof = roof_with_windows(self.bounds, lights.patches, lights.patch_m, height, self.patch_rng)
        if lights.shadows:  # It is drawn at random in any case: lamps draw from the same stream after it
            self.add(Item("windowed-roof", (roof,)))
        self._add_light("lamp-above", _DISTANT, above, sun, casts_shadow=lights.shadows)

    def add_fill(self, name: str, direction: ArrayLike, rgb: ArrayLike, patches_take: float = 0.0) -> None:
        """Add a weak directional light without shadows: light from the sky or reflected by walls."""
        self._add_light(name, _DISTANT, direction, self._shaded(rgb, patches_take))

    def add_lamps(
        self,
        at: Sequence[Sequence[float]],
        rgb: ArrayLike,
        cutoff_deg: float,
        attenuation: Sequence[float],
        exponent: float,
        other_rgb: ArrayLike | None = None,
    ) -> None:
        """Add spotlights `lamp-1`.. that shine straight down.

        `rgb` is the colour on the axis at distance 0, `cutoff_deg` half the angle of the cone, `attenuation` `(3,)`
        constant, linear and quadratic, and `exponent` that of the cosine fall-off towards the edge of the cone. Where
        the light has patches, lamps with an `other_rgb` light smaller pools, differ in brightness, and every other one
        turns to that colour. Lamps cast no shadows: the ground is darker below what stands on it.
        """
        colours, patches = np.tile(np.asarray(rgb, dtype=np.float64), (len(at), 1)), self.lights.patches
        if other_rgb is not None:
            brightness = 1.0 + patches * self.patch_rng.uniform(-0.4, 1.4, (len(at), 1))
            turned = patches * ((np.arange(len(at)) + self.patch_rng.integers(2)) % 2)
            colours = brightness * (colours + turned[:, None] * (np.asarray(other_rgb) - colours))
            exponent *= 1.0 + 2.0 * patches
        down, spot = (0.0, 0.0, -1.0), mujoco.mjtLightType.mjLIGHT_SPOT
        for index, position in enumerate(at):
            light = self._add_light(f"lamp-{index + 1}", spot, down, colours[index])
            light.pos, light.attenuation = list(position), list(attenuation)
            light.cutoff, light.exponent = cutoff_deg, exponent

    def _shaded(self, rgb: ArrayLike, patches_take: float) -> FloatArray:
        """A colour less the share that patches take from it."""
        return (1.0 - patches_take * self.lights.patches) * np.asarray(rgb, dtype=np.float64)

    def finish(self, goals: Sequence[tuple[float, float]], *, contact: bool = True) -> WalkableArea:
        """Add colliders along the edges of the walkable area, set the model's statistics and return the area.

        Without `contact` the ground is not darker around the footprints.
        """
        for edge in edges(self.bounds):
            body = self.spec.worldbody.add_body(name=edge.name, pos=[*edge.centre_m, 0.5 * edge.height_m])
            _add_collider(body, edge.name, (*edge.half_m, edge.height_m), 0.0)
        if self._footprints and contact:
            self.spec.add_mesh_file(CONTACT_OF_THINGS, ground_contact(self._footprints, self._ground_m).file)
        self.spec.stat.extent = 1.0
        left, low, right, high = self.bounds
        self.spec.stat.center = [0.5 * (left + right), 0.5 * (low + high), 1.0]
        return WalkableArea(self.bounds, tuple(self._footprints), tuple(goals))

    def _add_light(
        self, name: str, kind: mujoco.mjtLightType, direction: ArrayLike, rgb: ArrayLike, *, casts_shadow: bool = False
    ) -> mujoco.MjsLight:
        """Add a light that travels in `direction` `(3,)`."""
        colour, black = np.asarray(rgb, dtype=np.float32), [0.0, 0.0, 0.0]
        form = {"type": kind, "dir": direction, "castshadow": casts_shadow, "active": True}
        colours = {"diffuse": colour, "ambient": black, "specular": 0.1 * colour}
        return self.spec.worldbody.add_light(name=f"light/{name}", **form, **colours)


def add_ground_plane(spec: mujoco.MjSpec) -> None:
    """Add the flat plane that wheels roll on. It is not drawn."""
    body = spec.worldbody.add_body(name=GROUND)
    bits = {"group": HIDDEN_GROUP, "contype": 1, "conaffinity": 2}
    plane = {"type": mujoco.mjtGeom.mjGEOM_PLANE, "size": [0.0, 0.0, 1.0], "friction": [1.0, 0.005, 0.0001]}
    body.add_geom(name=f"{GROUND}/plane", **plane, **bits)


def _add_collider(body: mujoco.MjsBody, name: str, collider: Collider, z_m: float) -> None:
    """Add a hidden box whose centre is at height `z_m` in the frame of the body."""
    half_x, half_y, height = collider
    add_box(body, f"{name}/solid", [half_x, half_y, 0.5 * height], [0.0, 0.0, z_m], solid=True)


def sun_direction(lights: Lights) -> FloatArray:
    """`(3,)` unit vector in which sunlight travels."""
    azimuth, elevation = np.deg2rad([lights.sun_azimuth_deg, lights.sun_elevation_deg])
    level = np.cos(elevation)
    return -np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])


def bounding_box(prop: Prop) -> Collider:
    """Smallest collider around a prop that is centred on its origin."""
    vertices = np.concatenate([mesh.vertices for mesh in prop])
    half = np.abs(vertices[:, :2]).max(axis=0)
    return (float(half[0]), float(half[1]), float(vertices[:, 2].max()))
