"""The stage: puts pieces, colliders and lights into a spec, and keeps the list of what stands where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.scene.layout import HIDDEN_GROUP, SCENERY_GROUP, Footprint, WalkableArea
from pftrack_sim.scene.places import surfaces
from pftrack_sim.scene.places.shapes import Array, Piece, Shape, joined

EXTENT_M = 1.0
"""`stat.extent` of every place: clipping planes and the area of directional shadows are then in metres."""

Bounds = tuple[float, float, float, float]
Solid = tuple[float, float, float]
"""Half width along x, half width along y, height [m] of what stands on the ground."""


@dataclass(eq=False)
class Stage:
    """A place under construction.

    Attributes:
        spec: The model that everything goes into.
        rng: Draws what varies from seed to seed.
        clutter: Share of the loose furniture that is put out.
        shadows: Whether the main light casts shadows.
    """

    spec: mujoco.MjSpec
    rng: np.random.Generator
    clutter: float = 1.0
    shadows: bool = True
    _footprints: list[Footprint] = field(default_factory=list[Footprint])

    def put(
        self,
        name: str,
        piece: Sequence[Shape],
        at: Sequence[float] = (0.0, 0.0),
        yaw_rad: float = 0.0,
        solid: Solid | None = None,
        casts_shadow: bool = True,
    ) -> None:
        """Put a piece there as a body of its own: one drawn mesh per material.

        Args:
            name: Unique name of the body.
            piece: Shapes in the body's frame: origin on the ground.
            at: x, y and perhaps z [m].
            yaw_rad: Turn about z.
            solid: Box that the robot collides with and people walk around; None for what hangs or lies flat.
            casts_shadow: Whether it counts in the shadow pass.
        """
        x, y, z = (*at, 0.0)[:3]
        body = self.spec.worldbody.add_body(
            name=name, pos=[x, y, z], quat=[np.cos(0.5 * yaw_rad), 0.0, 0.0, np.sin(0.5 * yaw_rad)]
        )
        for shape in joined(piece):
            self._draw(body, f"{name}/{shape.material}", shape, casts_shadow)
        if solid is not None:
            half_x, half_y, height = solid
            body.add_geom(
                name=f"{name}/solid",
                type=mujoco.mjtGeom.mjGEOM_BOX,
                pos=[0.0, 0.0, 0.5 * height - z],
                size=[half_x, half_y, 0.5 * height],
                group=HIDDEN_GROUP,
                contype=1,
                conaffinity=2,
            )
            self._footprints.append(Footprint(name, (float(x), float(y)), (half_x, half_y), float(yaw_rad), height))

    def _draw(self, body: mujoco.MjsBody, name: str, shape: Shape, casts_shadow: bool) -> None:
        surfaces.add_material(self.spec, shape.material)
        mesh = self.spec.add_mesh(name=name)
        # Surfaces are open: there is no volume to take an inertia from, and nothing here moves.
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        mesh.uservert = shape.points.astype(np.float32).ravel()
        mesh.usernormal = shape.normals.astype(np.float32).ravel()
        # Pictures are stored from the top; v counts from the bottom.
        mesh.usertexcoord = (shape.uv * (1.0, -1.0)).astype(np.float32).ravel()
        mesh.userface = shape.faces.ravel()
        geom = body.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=name,
            material=shape.material,
            group=SCENERY_GROUP,
            contype=0,
            conaffinity=0,
            mass=0.0,
        )
        geom.castshadow = bool(casts_shadow)

    def floor(self) -> None:
        """The plane that wheels roll on: never drawn, for ever flat."""
        body = self.spec.worldbody.add_body(name="ground")
        body.add_geom(
            name="ground/plane",
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[0.0, 0.0, 1.0],
            friction=[1.0, 0.005, 0.0001],
            group=HIDDEN_GROUP,
            contype=1,
            conaffinity=2,
        )

    def barrier(self, name: str, centre: Sequence[float], half: Sequence[float], height: float = 3.0) -> None:
        """A body with nothing but a collider: the line of a wall that is drawn elsewhere or far away."""
        body = self.spec.worldbody.add_body(name=name, pos=[centre[0], centre[1], 0.5 * height])
        body.add_geom(
            name=f"{name}/solid",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[half[0], half[1], 0.5 * height],
            group=HIDDEN_GROUP,
            contype=1,
            conaffinity=2,
        )

    def enclose(self, bounds: Bounds) -> None:
        """Barriers along the four edges of the walkable area."""
        left, low, right, high = bounds
        middle_x, middle_y = 0.5 * (left + right), 0.5 * (low + high)
        half_x, half_y = 0.5 * (right - left) + 0.4, 0.5 * (high - low) + 0.4
        self.barrier("edge-north", (middle_x, high + 0.2), (half_x, 0.2))
        self.barrier("edge-south", (middle_x, low - 0.2), (half_x, 0.2))
        self.barrier("edge-east", (right + 0.2, middle_y), (0.2, half_y))
        self.barrier("edge-west", (left - 0.2, middle_y), (0.2, half_y))

    def kept(self, count: int) -> list[int]:
        """Which of `count` loose things are put out: the share that the scenario asks for, drawn per seed."""
        order = self.rng.permutation(count)
        return sorted(int(index) for index in order[: round(self.clutter * count)])

    def jitter(self, amount: float, size: int = 2) -> Array:
        """`(size,)` offsets, uniform in +/- `amount`."""
        return self.rng.uniform(-amount, amount, size)

    def sky_light(self, ambient: ArrayLike) -> None:
        """Light from everywhere: the headlight's ambient part, and nothing else of the headlight."""
        head = self.spec.visual.headlight
        head.ambient = np.asarray(ambient, dtype=np.float64)
        head.diffuse = [0.0, 0.0, 0.0]
        head.specular = [0.0, 0.0, 0.0]
        head.active = 1

    def beam(self, name: str, towards: ArrayLike, diffuse: ArrayLike, reach: tuple[float, float, float, float]) -> None:
        """A directional light that may cast the shadows of the place.

        Args:
            name: `"sun"` or `"lamp-..."`.
            towards: `(3,)` direction of the light.
            diffuse: `(3,)` colour.
            reach: x, y, z of the middle of the shadows and half the width of the area they cover [m].
        """
        direction = np.asarray(towards, dtype=np.float64)
        direction = direction / np.linalg.norm(direction)
        x, y, z, half = reach
        self.spec.visual.map.shadowclip = half / EXTENT_M
        self._light(name, mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, direction, diffuse, self.shadows).pos = (
            np.array([x, y, z]) - 40.0 * direction
        )

    def fill(self, name: str, towards: ArrayLike, diffuse: ArrayLike) -> None:
        """A weak directional light without shadows: light from the open sky or reflected by walls."""
        self._light(name, mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, towards, diffuse, False).pos = [0.0, 0.0, 8.0]

    def lamp(
        self,
        name: str,
        at: Sequence[float],
        diffuse: ArrayLike,
        cutoff_deg: float,
        attenuation: Sequence[float],
        shadow: bool = False,
        exponent: float = 1.0,
    ) -> None:
        """A lamp that shines straight down.

        Args:
            name: `"lamp-1"`, ...
            at: `(3,)` where it hangs [m].
            diffuse: `(3,)` colour on the axis at distance 0.
            cutoff_deg: Half angle of its cone.
            attenuation: `(3,)` constant, linear and quadratic.
            shadow: Whether it is the one lamp of the place that casts shadows.
            exponent: Fall-off towards the edge of the cone: cosine to this power.
        """
        down = (0.0, 0.0, -1.0)
        light = self._light(name, mujoco.mjtLightType.mjLIGHT_SPOT, down, diffuse, shadow and self.shadows)
        light.pos = list(at)
        light.cutoff = cutoff_deg
        light.exponent = exponent
        light.attenuation = list(attenuation)
        if shadow:
            self.spec.visual.map.shadowscale = 1.0

    def _light(
        self, name: str, kind: mujoco.mjtLightType, towards: ArrayLike, diffuse: ArrayLike, shadow: bool
    ) -> mujoco.MjsLight:
        light = self.spec.worldbody.add_light(name=f"light/{name}", type=kind)
        light.dir = np.asarray(towards, dtype=np.float64)
        light.diffuse = np.asarray(diffuse, dtype=np.float64)
        light.ambient = [0.0, 0.0, 0.0]
        light.specular = 0.1 * light.diffuse
        light.castshadow = shadow
        light.active = True
        return light

    def finish(self, bounds: Bounds, goals: Sequence[tuple[float, float]]) -> WalkableArea:
        """Close the place and say where one can walk."""
        self.spec.stat.extent = EXTENT_M
        self.spec.stat.center = [0.5 * (bounds[0] + bounds[2]), 0.5 * (bounds[1] + bounds[3]), 1.0]
        return WalkableArea(bounds, tuple(self._footprints), tuple(goals))


def sun_direction(azimuth_deg: float, elevation_deg: float) -> Array:
    """`(3,)` unit vector in which sunlight travels, for a sun that stands there."""
    azimuth, elevation = np.deg2rad([azimuth_deg, elevation_deg])
    level = np.cos(elevation)
    return -np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])


def standing(piece: Piece) -> Solid:
    """The solid around a piece that is centred on its origin."""
    points = np.concatenate([shape.points for shape in piece])
    half = np.abs(points[:, :2]).max(axis=0)
    return (float(half[0]), float(half[1]), float(points[:, 2].max()))
