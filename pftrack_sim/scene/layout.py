"""Walkable area of a place, and the names and groups that scene, truth and rendering agree on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

SCENERY_GROUP = 0
PEOPLE_GROUP = 1
ROBOT_GROUP = 2
HIDDEN_GROUP = 3
HIDDEN_ROBOT_GROUP = 4
"""MuJoCo geom groups. Hidden geoms collide and are not drawn; those of the robot are ignored by its range finder."""

PEOPLE_CONTYPE, PEOPLE_CONAFFINITY = 4, 2
"""Collision bits of people: they collide with robots only."""

Bounds: TypeAlias = tuple[float, float, float, float]  # x_min, y_min, x_max, y_max [m]
CONTACT = "contact"  # Name of the material and the mesh of the darkness under feet
CONTACT_OF_THINGS = "contact-of-things"  # Name of the mesh of the darkness around what stands on the ground
CONTACT_OF_THINGS_HEIGHT_M, CONTACT_HEIGHT_M = 0.006, 0.008
"""Heights of both above the ground, and above all that is painted on it: at equal heights they would flicker."""
GROUND = "ground"  # Name of the body of the flat ground
SKY = "sky"  # Name of the material whose emission is the brightness of the sky's texture


@dataclass(frozen=True)
class Footprint:
    """An upright box that people walk around: an oriented rectangle on the ground.

    Attributes:
        centre_m: x, y, world frame.
        half_m: Half sizes along its own axes.
        yaw_rad: Angle of its first axis to the world's x.
    """

    name: str
    centre_m: tuple[float, float]
    half_m: tuple[float, float]
    yaw_rad: float = 0.0
    height_m: float = 3.0


def edges(bounds_m: Bounds) -> tuple[Footprint, ...]:
    """What encloses a walkable area."""
    left, low, right, high = bounds_m
    x, y = 0.5 * (left + right), 0.5 * (low + high)
    half_x, half_y = 0.5 * (right - left) + 0.4, 0.5 * (high - low) + 0.4
    return (
        Footprint("edge-north", (x, high + 0.2), (half_x, 0.2)),
        Footprint("edge-south", (x, low - 0.2), (half_x, 0.2)),
        Footprint("edge-east", (right + 0.2, y), (0.2, half_y)),
        Footprint("edge-west", (left - 0.2, y), (0.2, half_y)),
    )


@dataclass(frozen=True)
class WalkableArea:
    """The walkable area of a place.

    Attributes:
        bounds_m: x_min, y_min, x_max, y_max of the area people stay in.
        footprints: Obstacles in it.
        goals_m: Goals of pedestrians, free of obstacles.
    """

    bounds_m: Bounds
    footprints: tuple[Footprint, ...]
    goals_m: tuple[tuple[float, float], ...]


def body_owners(model: Any) -> list[str]:
    """`owner_name` of every body of a model."""
    names: bytes = model.names
    return [owner_name(names[start : names.index(b"\0", start)].decode()) for start in model.name_bodyadr.tolist()]


def owner_name(body_name: str) -> str:
    """Name of the person or thing that a body belongs to: "target/left-shank" -> "target", "pillar-3" -> "pillar-3"."""
    return body_name.split("/", 1)[0]
