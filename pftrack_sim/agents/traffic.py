"""People and carts as one entity: they avoid each other, so they move together."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco

from pftrack_sim.agents.entity import SceneState
from pftrack_sim.agents.gait.gait import Gait
from pftrack_sim.agents.gait.mocap_writer import MocapWriter
from pftrack_sim.agents.pedestrians.crowd import Crowd
from pftrack_sim.core import random_streams
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.occluders.carts import CartWriter
from pftrack_sim.scene.people.person import Person


class Traffic:
    """Paths from the crowd, limbs from the gait, and the mocap bodies of both people and carts."""

    def __init__(
        self, model: mujoco.MjModel, people: Sequence[Person], cart_names: Sequence[str], crowd: Crowd, seed: int
    ) -> None:
        self.crowd = crowd
        self.names = tuple(person.name for person in people)
        rngs = [random_streams.stream(seed, "gait", name) for name in self.names]
        self._gait = Gait([person.anatomy for person in people], rngs)
        self._people_writer = MocapWriter(model, self.names)
        self._cart_writer = CartWriter(model, cart_names)

    def reset(self, data: mujoco.MjData) -> None:
        """Everybody at the start."""
        self.crowd.reset()
        self._gait.reset(self.crowd.positions_m, self.crowd.headings_rad, self.crowd.speeds_m_s)
        self.write(data)

    def update(self, dt_s: float, state: SceneState) -> None:
        """Move by one tick."""
        crowd, (x, y, _) = self.crowd, state.robot_pose
        crowd.tick(dt_s, state.time_s, (x, y), state.T_world_camera[:2, 3])
        self._gait.advance(dt_s, crowd.positions_m, crowd.headings_rad, crowd.crouching, crowd.running)

    def write(self, data: mujoco.MjData) -> None:
        """Write the poses of limbs and carts."""
        self._people_writer.write(data, *self._gait.poses())
        self._cart_writer.write(data, [(cart.position_m, cart.yaw_rad) for cart in self.crowd.carts])

    def root_poses(self) -> FloatArray:
        """`(P, 4, 4)` poses of the people: origin on the ground below the pelvis, x forward, z up."""
        return self._gait.root_poses()
