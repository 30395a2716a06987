"""What moves in a scene: the protocol of entities, and the state of the scene that they react to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import mujoco

from pftrack_sim.core.types import FloatArray


@dataclass(frozen=True)
class SceneState:
    """What the entities observe at one instant.

    Attributes:
        robot_pose: x, y [m] and heading [rad].
        T_world_camera: `(4, 4)` camera on its mast, without vibration of the mount.
        target_m: `(2,)` x, y of the target.
    """

    time_s: float
    robot_pose: tuple[float, float, float]
    T_world_camera: FloatArray
    target_m: FloatArray
    target_s_m: float


class Entity(Protocol):
    """Something that moves.

    `update` decides its motion in one control tick, `write` puts the result into the physics state.
    """

    def reset(self, data: mujoco.MjData) -> None:
        """Return to the start of the episode, and write it to `data`."""
        ...

    def update(self, dt_s: float, state: SceneState) -> None:
        """Advance by one control tick of `dt_s`, reacting to the state of the scene."""
        ...

    def write(self, data: mujoco.MjData) -> None:
        """Write poses or actuator commands to `data`."""
        ...
