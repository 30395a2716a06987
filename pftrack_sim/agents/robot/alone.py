"""Physics of the robot in a model without the scene, while it can touch nothing but the ground.

In every physics step MuJoCo computes the poses of all bodies and looks for contacts among all geoms. As long as the
robot is in contact with the ground alone, the small model gives the same bits in a third of the time.
"""

from __future__ import annotations

import mujoco
import numpy as np

from pftrack_sim.agents.clock import Clock
from pftrack_sim.agents.robot.drive import pose_of_camera
from pftrack_sim.core.types import FloatArray, IntArray
from pftrack_sim.scene.robot import BASE, CAMERA

_LIMB_M_S = 8.0  # Faster than any limb or cart moves
_CONTACT_M = 0.02  # Margin of contacts, and rounding
_MOST_TICKS = 100
_STATE = int(
    mujoco.mjtState.mjSTATE_TIME
    | mujoco.mjtState.mjSTATE_PHYSICS
    | mujoco.mjtState.mjSTATE_WARMSTART
    | mujoco.mjtState.mjSTATE_CTRL
    | mujoco.mjtState.mjSTATE_QFRC_APPLIED
)


class RobotAlone:
    """The robot of a scene in a model of its own.

    Args:
        model: The scene; its only joints are those of the robot.
        alone: The same robot on the same ground, see `compile_robot_alone`; its sensors are switched on.
        clock: Of the scene.
        speed_m_s: Highest speed of the robot.

    Attributes:
        model: That of the robot alone.
        data: Its state, from `load` to `store`.
    """

    def __init__(self, model: mujoco.MjModel, alone: mujoco.MjModel, clock: Clock, speed_m_s: float) -> None:
        self.model, self.data, self._scene = alone, mujoco.MjData(alone), model
        alone.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
        self._state = np.empty(mujoco.mj_stateSize(alone, _STATE))
        self._camera = int(alone.camera(CAMERA).id)
        self._base = int(model.body(BASE).id)
        own = model.body_rootid[model.geom_bodyid] == self._base
        solid = (model.geom_contype | model.geom_conaffinity) != 0
        types = np.bitwise_or.reduce(model.geom_contype[own]), np.bitwise_or.reduce(model.geom_conaffinity[own])
        meets = ((model.geom_contype & types[1]) | (model.geom_conaffinity & types[0])) != 0
        planes = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
        self._others = np.flatnonzero(meets & ~own & ~planes)
        boxes = np.array(model.geom_aabb[self._others], dtype=np.float64)
        self._middles, self._halves = boxes[:, :3], boxes[:, 3:]
        self._own, self._centres, radii_m = _spheres(model, np.flatnonzero(own & solid))
        # People stand still within a tick, but in the second one of a frame, the poses are those of the first.
        room_m = _CONTACT_M + clock.tick_s * (2.0 * speed_m_s + (_LIMB_M_S if clock.ticks > 1 else 0.0))
        self._near_m = room_m + radii_m
        self._near_base_m = room_m + _reach_m(model, np.flatnonzero(own & solid))
        moving = model.body_mocapid[model.geom_bodyid[self._others]] >= 0
        self._closing_m = clock.tick_s * (2.0 * speed_m_s + _LIMB_M_S * moving)
        self._free_ticks = 0

    def may_touch(self, data: mujoco.MjData) -> bool:
        """Whether the robot may touch anything but the ground within a tick, by the poses of the scene's geoms.

        To be asked once a tick: what is far away is left out for as many ticks as it needs to come near.
        """
        if self._free_ticks > 0:
            self._free_ticks -= 1
            return False
        rotations = data.geom_xmat.reshape(-1, 3, 3)
        origins, turned = data.geom_xpos[self._others], rotations[self._others]
        base = (data.xpos[self._base] - origins)[:, None] @ turned
        free_m = np.sqrt(self._squared_m(base, slice(None))[:, 0]) - self._near_base_m
        near = np.flatnonzero(free_m <= 0.0)
        if len(near):
            spheres = data.geom_xpos[self._own] + (rotations[self._own] @ self._centres[:, :, None])[:, :, 0]
            local = (spheres - origins[near, None]) @ turned[near]
            free_m[near] = (np.sqrt(self._squared_m(local, near)) - self._near_m).min(axis=1)
        self._free_ticks = int((free_m / self._closing_m).min(initial=_MOST_TICKS))
        return bool((free_m < 0.0).any())

    def _squared_m(self, points: FloatArray, others: IntArray | slice) -> FloatArray:
        """`(M, N)` squared distances of `(M, N, 3)` points in the frames of M other geoms from their boxes [m^2]."""
        beyond = np.maximum(np.abs(points - self._middles[others, None]) - self._halves[others, None], 0.0)
        return np.einsum("mni,mni->mn", beyond, beyond)

    def load(self, data: mujoco.MjData) -> None:
        """Take time, positions, velocities and commands from the scene."""
        mujoco.mj_getState(self._scene, data, self._state, _STATE)
        mujoco.mj_setState(self.model, self.data, self._state, _STATE)

    def camera_pose(self) -> FloatArray:
        """See `Drive.camera_pose`; after the steps, of this model's state."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)
        return pose_of_camera(self.data, self._camera)

    def store(self, data: mujoco.MjData) -> None:
        """Write these, and the sensors, into the scene."""
        mujoco.mj_getState(self.model, self.data, self._state, _STATE)
        mujoco.mj_setState(self._scene, data, self._state, _STATE)
        data.sensordata[:] = self.data.sensordata


def _spheres(model: mujoco.MjModel, geoms: IntArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Spheres that hold the bounding boxes of geoms, several in a row for a long one.

    Returns:
        `(N,)` geoms, `(N, 3)` centres in their frames [m], `(N,)` radii [m].
    """
    rows: list[tuple[int, FloatArray, float]] = []
    for geom in geoms.tolist():
        middle, half = np.array(model.geom_aabb[geom], dtype=np.float64).reshape(2, 3)
        longest = int(half.argmax())
        across_m = float(np.linalg.norm(np.delete(half, longest)))
        count = int(np.ceil(half[longest] / max(across_m, 0.1)))
        step_m = 2.0 * half[longest] / count
        for index in range(count):
            centre = middle.copy()
            centre[longest] += (index + 0.5) * step_m - half[longest]
            rows.append((geom, centre, float(np.hypot(across_m, 0.5 * step_m))))
    ids, centres, radii_m = zip(*rows, strict=True)
    return np.array(ids, dtype=np.intp), np.array(centres), np.array(radii_m)


def _reach_m(model: mujoco.MjModel, geoms: IntArray) -> float:
    """Radius of a sphere about the origin of the robot's base that holds its geoms however its joints are [m]."""
    reaches: list[float] = []
    for geom in geoms.tolist():
        body, reach = int(model.geom_bodyid[geom]), model.geom_rbound[geom] + np.linalg.norm(model.geom_pos[geom])
        while model.body_parentid[body] != 0:
            reach += np.linalg.norm(model.body_pos[body])
            body = int(model.body_parentid[body])
        reaches.append(float(reach))
    slides = model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE
    return max(reaches) + float(np.abs(model.jnt_range[slides]).max(initial=0.0))
