"""People and carts as one entity: they avoid each other, so they move together."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco

from pftrack_sim.agents.carried_items import CarriedItems
from pftrack_sim.agents.entity import SceneState
from pftrack_sim.agents.gait.gait import Gait
from pftrack_sim.agents.gait.mocap_writer import MocapWriter
from pftrack_sim.agents.gait.stride_width import median_width_phase
from pftrack_sim.agents.pedestrians.crowd import Crowd
from pftrack_sim.core import random_streams
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.occluders.carts import CartWriter
from pftrack_sim.scene.people.person import Person


class Traffic:
    """Paths from the crowd, limbs from the gait, and the mocap bodies of both people and carts."""

    def __init__(
        self,
        model: mujoco.MjModel,
        people: Sequence[Person],
        cart_names: Sequence[str],
        crowd: Crowd,
        seed: int,
        carried: CarriedItems | None = None,
    ) -> None:
        self.crowd = crowd
        self.names = tuple(person.name for person in people)
        self._target, self._seed = people[0], seed
        self._gait = self._gait_of(people)
        self._people_writer = MocapWriter(model, self.names)
        self._cart_writer = CartWriter(model, cart_names)
        self._carried = carried

    def reset(self, data: mujoco.MjData) -> None:
        """Everybody at the start."""
        self.crowd.reset()
        if self._carried is not None:
            self._carried.reset()
        self._reset_gait(data)

    def start_in_mid_stride(self, data: mujoco.MjData, T_world_camera: FloatArray) -> None:
        """Right after `reset`: let the target's box have its median width over a stride in a `(4, 4)` camera pose."""
        crowd = self.crowd
        start = crowd.positions_m[0], float(crowd.headings_rad[0]), float(crowd.speeds_m_s[0])
        alone = self._gait_of([self._target])
        self._gait.feet.start_phase[0] = median_width_phase(self._target, alone, *start, T_world_camera)
        self._reset_gait(data)

    def update(self, dt_s: float, state: SceneState) -> None:
        """Move by one tick."""
        crowd, (x, y, _), self._time_s = self.crowd, state.robot_pose, state.time_s
        crowd.tick(dt_s, state.time_s, (x, y), state.T_world_camera[:2, 3])
        self._gait.advance(dt_s, crowd.positions_m, crowd.headings_rad, crowd.postures)

    def write(self, data: mujoco.MjData) -> None:
        """Write the poses of limbs and carts."""
        self._people_writer.write(data, *self._gait.poses())
        if self._carried is not None:
            positions, rotations = self._gait.part_poses()
            self._carried.write(data, self._time_s, positions[0], rotations[0])
        self._cart_writer.write(data, [(cart.position_m, cart.yaw_rad) for cart in self.crowd.carts])

    def _reset_gait(self, data: mujoco.MjData) -> None:
        self._time_s = 0.0
        self._gait.reset(self.crowd.positions_m, self.crowd.headings_rad, self.crowd.speeds_m_s, self.crowd.postures)
        self.write(data)

    def _gait_of(self, people: Sequence[Person]) -> Gait:
        rngs = [random_streams.stream(self._seed, "gait", person.name) for person in people]
        return Gait([person.anatomy for person in people], rngs)

    def root_poses(self) -> FloatArray:
        """`(P, 4, 4)` poses of the people: origin on the ground below the pelvis, x forward, z up."""
        return self._gait.root_poses()
