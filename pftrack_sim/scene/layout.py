"""What a place tells the people and the robot about itself: where one can walk, what stands in the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SCENERY_GROUP = 0
PEOPLE_GROUP = 1
ROBOT_GROUP = 2
HIDDEN_GROUP = 3
HIDDEN_ROBOT_GROUP = 4
"""MuJoCo geom groups. Hidden geoms collide and are never drawn; the others are drawn. The robot's own have a group of
their own: its range finder looks at all the others."""

SKY = "sky"
"""Name of the material whose emission is the brightness of the sky's picture: light changes it, renderers read it."""


@dataclass(frozen=True)
class Footprint:
    """An upright box that people walk around: an oriented rectangle on the ground.

    Attributes:
        name: Name of the body that stands there.
        centre_m: x, y, world frame.
        half_m: Half sizes along its own axes.
        yaw_rad: Angle of its first axis to the world's x.
        height_m: How tall it is.
    """

    name: str
    centre_m: tuple[float, float]
    half_m: tuple[float, float]
    yaw_rad: float = 0.0
    height_m: float = 3.0


@dataclass(frozen=True)
class WalkableArea:
    """The walkable area of a place.

    Attributes:
        bounds_m: x_min, y_min, x_max, y_max of the area people stay in.
        footprints: What stands in it.
        goals_m: Points that strangers walk between (free of footprints).
    """

    bounds_m: tuple[float, float, float, float]
    footprints: tuple[Footprint, ...]
    goals_m: tuple[tuple[float, float], ...]


def owner_name(body_name: str) -> str:
    """Who a body belongs to: the part before the first slash ("target/left-shank" -> "target").

    Bodies of scenery carry a plain readable name ("pillar-3"); people and the robot put their parts behind a slash.
    """
    return body_name.split("/", 1)[0]


def pose_matrix(position_m: NDArray[np.float64], rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """`(4, 4)` pose from a `(3,)` position [m] and a `(3, 3)` rotation."""
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = position_m
    return pose
