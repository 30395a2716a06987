"""People and carts as one entity: they avoid each other, so they move together."""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from pftrack_sim.agents.carried_items import CarriedItems
from pftrack_sim.agents.gait.gait import Gait, quaternions
from pftrack_sim.agents.pedestrians.crowd import Crowd
from pftrack_sim.agents.pedestrians.obstacle_map import Xy
from pftrack_sim.agents.tracked_thing import TrackedThing
from pftrack_sim.camera.extents import Bodies
from pftrack_sim.core import random_streams
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.mobility import Mobility
from pftrack_sim.scene.people.person import Person, mobility_names, part_meshes, part_mocap_ids
from pftrack_sim.scene.thing import WALKER

PHASES = np.arange(48) / 48
_NEAR_M = 0.05


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
        thing: TrackedThing | None = None,
    ) -> None:
        self.crowd = crowd
        self._thing, self._first = thing, int(people[0].name == WALKER)
        bearer = (people[0].name,) if thing is not None and not self._first else ()
        self.names = (crowd.names[0], *(person.name for person in people[1:]), *bearer)
        """Names of all whose truth is told, the target's first."""
        self._target, self._seed = people[0], seed
        self.gait = self._gait_of(people)
        self._part_ids = part_mocap_ids(model, [person.name for person in people[self._first :]])
        self._mobility_ids = {
            index: [int(model.body_mocapid[model.body(name).id]) for name in mobility_names(people[index])]
            for index in self.gait.riders
        }
        self._cart_ids = [int(model.body_mocapid[model.body(name).id]) for name in cart_names]
        self._carried = carried

    def start(self, data: mujoco.MjData) -> None:
        """Everybody at the start."""
        self._time_s = 0.0
        self.gait.reset(self.crowd.positions_m, self.crowd.headings_rad, self.crowd.speeds_m_s, self.crowd.postures)
        self.write(data)

    def start_in_mid_stride(self, data: mujoco.MjData, T_world_camera: FloatArray) -> None:
        """Right after `start`: let the target's box have its median width over a stride in a `(4, 4)` camera pose."""
        crowd = self.crowd
        start = crowd.positions_m[0], float(crowd.headings_rad[0]), float(crowd.speeds_m_s[0])
        gait = self._gait_of([self._target] * len(PHASES))
        self.gait.start_phase[0] = median_width_phase(self._target, gait, *start, T_world_camera)
        self.start(data)

    def update(self, dt_s: float, time_s: float, robot_m: Xy, camera_m: Xy) -> None:
        """Move by a tick that ends at `time_s`, with robot and camera (without vibration) at these places."""
        crowd, self._time_s = self.crowd, time_s
        crowd.tick(dt_s, time_s, robot_m, camera_m)
        self.gait.advance(dt_s, crowd.positions_m, crowd.headings_rad, crowd.postures)

    def write(self, data: mujoco.MjData) -> None:
        """Write the poses of limbs and carts."""
        gait = self.gait
        drawn, ids = slice(self._first, None), self._part_ids
        data.mocap_pos[ids], data.mocap_quat[ids] = gait.positions[drawn], quaternions(gait.rotations)[drawn]
        for index, mocaps in self._mobility_ids.items():
            rider = gait.riders[index]
            data.mocap_pos[mocaps], data.mocap_quat[mocaps] = rider.places, quaternions(rider.turned)
        if self._carried is not None:
            self._carried.write(data, self._time_s, gait.positions[0], gait.rotations[0])
        if self._thing is not None:
            s_m = self.crowd.target_s_m
            self._thing.write(data, self._time_s, s_m, gait.positions[0], gait.rotations[0])
        for mocap, cart in zip(self._cart_ids, self.crowd.carts, strict=True):
            data.mocap_pos[mocap] = (*cart.position_m, 0.0)
            data.mocap_quat[mocap] = (math.cos(0.5 * cart.yaw_rad), 0.0, 0.0, math.sin(0.5 * cart.yaw_rad))

    @property
    def root_poses(self) -> FloatArray:
        """`(P, 4, 4)` poses in the order of the names: origin on the ground below the middle, x forward, z up."""
        poses = self.gait.root_poses
        if self._thing is None:
            return poses
        return np.concatenate([self._thing.root_pose[None], poses[1:], poses[: len(self.names) - len(poses)]])

    def _gait_of(self, people: Sequence[Person]) -> Gait:
        rngs = [random_streams.stream(self._seed, "gait", person.name) for person in people]
        uses: dict[int, Mobility] = {
            index: person.uses for index, person in enumerate(people) if person.uses is not None
        }
        return Gait([person.anatomy for person in people], rngs, uses)


def median_width_phase(
    person: Person, gait: Gait, position_m: FloatArray, heading_rad: float, speed_m_s: float, T_world_camera: FloatArray
) -> float:
    """Gait phase at which the box of a person in a steady walk has its median width over a stride.

    Seen from the side the width swings by a factor of 2: a box selected at an unlucky moment has a width that the
    person seldom has again. Of the phases with the median width, it is the one nearest to the start phase of the gait;
    that phase itself where the width is constant, as at rest, or where the person is not in front of the camera.

    The gait is that of this person, once for each of the `PHASES`, and is reset; the person walks at `(2,)` x, y on the
    ground, seen from a `(4, 4)` camera pose.
    """
    bodies = Bodies([[mesh.vertices for mesh in part_meshes(person).values()]])
    drawn, widths = float(gait.start_phase[0]), np.empty(len(PHASES))
    gait.start_phase[:] = PHASES
    gait.reset(np.tile(position_m, (len(PHASES), 1)), [heading_rad] * len(PHASES), [speed_m_s] * len(PHASES))
    for index, (positions, rotations) in enumerate(zip(gait.positions, gait.rotations, strict=True)):
        widths[index] = bodies.boxes(positions, rotations, T_world_camera, np.eye(3), _NEAR_M)[0][0, 2]
    excess = widths - np.median(widths)
    following = np.roll(excess, -1)
    crossing = np.flatnonzero((excess < 0.0) != (following < 0.0))
    if not crossing.size:
        return drawn
    share = excess[crossing] / (excess[crossing] - following[crossing])
    found = (PHASES[crossing] + share / len(PHASES)) % 1.0
    return float(found[np.abs((found - drawn + 0.5) % 1.0 - 0.5).argmin()])
