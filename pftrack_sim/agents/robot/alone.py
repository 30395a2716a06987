"""Physics of the robot in a model without the scene, while it can touch nothing but the ground.

In every physics step MuJoCo computes the poses of all bodies and looks for contacts among all geoms. As long as the
robot is in contact with the ground alone, the small model gives the same bits in a third of the time.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numba import njit

from pftrack_sim.agents.clock import Clock
from pftrack_sim.agents.robot.pose_kernels import camera_pose
from pftrack_sim.core.types import FloatArray, IntArray
from pftrack_sim.scene.robot import BASE, CAMERA

_LIMB_M_S = 8.0  # Faster than any limb or cart moves
_CONTACT_M = 0.02  # Margin of contacts, and rounding
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
        own = model.body_rootid[model.geom_bodyid] == model.body(BASE).id
        solid = (model.geom_contype | model.geom_conaffinity) != 0
        types = np.bitwise_or.reduce(model.geom_contype[own]), np.bitwise_or.reduce(model.geom_conaffinity[own])
        meets = ((model.geom_contype & types[1]) | (model.geom_conaffinity & types[0])) != 0
        planes = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
        self._others = np.flatnonzero(meets & ~own & ~planes)
        self._boxes = np.array(model.geom_aabb[self._others], dtype=np.float64).reshape(-1, 2, 3)
        self._reach_m = np.linalg.norm(np.abs(self._boxes[:, 0]) + self._boxes[:, 1], axis=1)
        self._own, self._centres, self._radii_m = _spheres(model, np.flatnonzero(own & solid))
        # People stand still within a tick, but in the second one of a frame, the poses are those of the first.
        self._room_m = _CONTACT_M + clock.tick_s * (2.0 * speed_m_s + (_LIMB_M_S if clock.ticks > 1 else 0.0))

    def may_touch(self, data: mujoco.MjData) -> bool:
        """Whether the robot may touch anything but the ground within a tick, by the poses of the scene's geoms."""
        return reaches(
            self._room_m, self._own, self._centres, self._radii_m, self._others, self._boxes, self._reach_m,
            data.geom_xpos, data.geom_xmat,
        )  # fmt: skip

    def load(self, data: mujoco.MjData) -> None:
        """Take time, positions, velocities and commands from the scene."""
        mujoco.mj_getState(self._scene, data, self._state, _STATE)
        mujoco.mj_setState(self.model, self.data, self._state, _STATE)

    def camera_pose(self) -> FloatArray:
        """See `Drive.camera_pose`; after the steps, of this model's state."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)
        return camera_pose(self.data.cam_xpos, self.data.cam_xmat, self._camera)

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


@njit(cache=True, nogil=True)
def reaches(
    room_m: float,
    own: IntArray,
    centres: FloatArray,
    radii_m: FloatArray,
    others: IntArray,
    boxes: FloatArray,
    reach_m: FloatArray,
    positions: FloatArray,
    rotations: FloatArray,
) -> bool:
    """Whether the distance of a sphere from an oriented box may be less than `room_m`.

    Args:
        room_m: Distance to keep [m].
        own: `(N,)` geoms that the spheres belong to.
        centres: `(N, 3)` of the spheres in the frames of these [m].
        radii_m: `(N,)` of the spheres.
        others: `(M,)` geoms that the boxes belong to.
        boxes: `(M, 2, 3)` middles and half sizes in the frames of these [m].
        reach_m: `(M,)` radii of spheres about the origins of these that hold the boxes.
        positions: `(ngeom, 3)` of all geoms [m].
        rotations: `(ngeom, 9)` of all geoms.
    """
    places = np.empty((len(own), 3))
    for sphere in range(len(own)):
        place, turned = positions[own[sphere]], rotations[own[sphere]]
        for row in range(3):
            places[sphere, row] = place[row]
            for column in range(3):
                places[sphere, row] += turned[3 * row + column] * centres[sphere, column]
    for other in range(len(others)):
        origin, turned = positions[others[other]], rotations[others[other]]
        for sphere in range(len(own)):
            x, y, z = places[sphere, 0] - origin[0], places[sphere, 1] - origin[1], places[sphere, 2] - origin[2]
            near_m = room_m + radii_m[sphere]
            if x * x + y * y + z * z > (near_m + reach_m[other]) ** 2:
                continue
            squared = 0.0
            for axis in range(3):
                along = turned[axis] * x + turned[3 + axis] * y + turned[6 + axis] * z
                over = abs(along - boxes[other, 0, axis]) - boxes[other, 1, axis]
                squared += max(over, 0.0) ** 2
            if squared < near_m * near_m:
                return True
    return False
