"""Poses of a thing that is tracked: it slides or rolls along the target's path, or hands or physics move it."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from pftrack_sim.agents.carried_items import between_hands, turned_by
from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pushed_thing import PushedWay
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.thing import Thing
from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.thing import BODY, half_sizes_m, solid


class TrackedThing:
    """The target, where it is a thing.

    Args:
        model: Has its mocap body, see `add_thing`.
        name: That of the target.
        bearer: Body of who carries it.
    """

    def __init__(self, model: mujoco.MjModel, name: str, thing: Thing, bearer: Anatomy, path: Path) -> None:
        self._mocap = int(model.body_mocapid[model.body(f"{name}/{BODY}").id])
        self._thing, self._bearer, self._path = thing, bearer, path
        self._ahead_m = float(half_sizes_m(thing)[0])
        self._is_ball = solid(thing)[0] == mujoco.mjtGeom.mjGEOM_SPHERE
        self.root_pose = np.eye(4)
        """`(4, 4)` its pose: origin on the ground below its middle, x forward, z up."""

    def write(
        self, data: mujoco.MjData, time_s: float, s_m: float, positions: FloatArray, rotations: FloatArray
    ) -> None:
        """Set its pose where the target is at arc length `s_m`, its bearer's parts at `(13, 3)` and `(13, 3, 3)`."""
        thing = self._thing
        if thing.moves == "carried":
            place, facing = between_hands(self._bearer, positions, rotations)
            place += self._ahead_m * facing[:, 0]
            turn = math.radians(thing.turn_deg) * math.sin(2.0 * math.pi * time_s / thing.turn_s)
            yaw = math.atan2(facing[1, 0], facing[0, 0]) + turn
            turned = turned_by(yaw)
        elif isinstance(self._path, PushedWay):
            place, quaternion = self._path.at_time(time_s)
            turned = np.empty(9)
            mujoco.mju_quat2Mat(turned, quaternion)
            # A ball has no front of its own but where it goes.
            yaw = self._path.pose(s_m)[2] if self._is_ball else math.atan2(turned[3], turned[0])
        else:
            x, y, yaw = self._path.pose(s_m)
            place = np.array([x, y, 0.5 * thing.height_m])
            turned = turned_by(yaw, pitch_rad=2.0 * s_m / thing.height_m if thing.moves == "rolling" else 0.0)
        data.mocap_pos[self._mocap] = place
        mujoco.mju_mat2Quat(data.mocap_quat[self._mocap], turned.ravel())
        self.root_pose = np.eye(4)
        self.root_pose[:3, :3], self.root_pose[:2, 3] = turned_by(yaw), place[:2]
