"""Motors, odometry and range finder of the compiled robot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.agents.robot.steering import Steering
from pftrack_sim.core.proprioception import BEAM_HEIGHT_M
from pftrack_sim.core.types import FloatArray, read_only
from pftrack_sim.scenario import robot as scenario
from pftrack_sim.scenario.camera import Camera
from pftrack_sim.scene.layout import GROUND, HIDDEN_GROUP, body_owners
from pftrack_sim.scene.robot import BASE, CAMERA, REST_YAW_RAD
from pftrack_sim.scene.robot_file.motorised import GRAVITY_M_S2, wheel_share

ACCELERATION = read_only(np.array([1.2, 4.0, 12.0, 8.0]))
"""Limits of the change of forward speed [m/s^2], turn, pan and tilt rate [rad/s^2]."""
_ACCELERATION: list[float] = ACCELERATION.tolist()

WHEEL_UNLOADING_SHARE = 0.35
"""Turns are slowed down where they would take more than this share of the load off the inner wheel."""

WINDUP_RAD = 0.3  # Limit of the distance between the head and its servo's reference
_SETTLE_S = 1.5
_FAR_M = 1000.0
_STUCK_RAD = 0.01  # A pan joint with less play is none
_JOINTS = ("robot/axle-left", "robot/axle-right", "robot/pan", "robot/tilt")
_MOTORS = ("robot/drive-left", "robot/drive-right", "robot/pan", "robot/tilt")
_PLANAR_MOTORS = ("robot/base-x", "robot/base-y", "robot/base-yaw")
_IDENTITY, _OPENCV_AXES = np.eye(4), np.array([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class OdometryCalibration:
    """Wheel radii and track (distance between the tyres' contacts) that the odometry assumes.

    Unequal wheels and an uncertain track are the two systematic errors of differential-drive odometry (Borenstein and
    Feng 1996, "Measurement and correction of systematic odometry errors in mobile robots", IEEE Transactions on
    Robotics and Automation 12(6)). Slip, the unsystematic error, comes from the physics.
    """

    left_radius_m: float
    right_radius_m: float
    track_m: float

    def sampled(self, error_percent: float, rng: np.random.Generator) -> OdometryCalibration:
        """This one with independent normal errors of the given standard deviation."""
        left, right, track = (1.0 + 0.01 * error_percent * rng.standard_normal(3)).tolist()
        return OdometryCalibration(left * self.left_radius_m, right * self.right_radius_m, track * self.track_m)


class Odometry(NamedTuple):
    """Pose in the frame of the start, heading in [-pi, pi], and the wheel angles that it belongs to."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0
    left_rad: float = 0.0
    right_rad: float = 0.0

    def updated(self, left_rad: float, right_rad: float, calibration: OdometryCalibration) -> Odometry:
        """The odometry after the wheels have turned to these angles.

        Second-order Runge-Kutta: the path is laid along the mean heading (Siciliano et al. 2009, "Robotics: modelling,
        planning and control", eq. 11.84).
        """
        left_m = calibration.left_radius_m * (left_rad - self.left_rad)
        right_m = calibration.right_radius_m * (right_rad - self.right_rad)
        distance, turn = 0.5 * (left_m + right_m), (right_m - left_m) / calibration.track_m
        mean = self.heading_rad + 0.5 * turn
        return Odometry(
            self.x_m + distance * math.cos(mean),
            self.y_m + distance * math.sin(mean),
            math.remainder(self.heading_rad + turn, 2.0 * math.pi),
            left_rad,
            right_rad,
        )


class Drive:
    """The robot's motors and sensors in a compiled model.

    Args:
        model: Compiled from a spec that went through `add_robot` with the same `robot` and `camera`.
        calibration: Wheel radii and track that the odometry assumes.
        equilibrium: Of the same robot, perhaps in another model.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        robot: scenario.Robot,
        camera: Camera,
        calibration: OdometryCalibration,
        equilibrium: Equilibrium,
    ) -> None:
        self._model, self._equilibrium = model, equilibrium
        self._wheels, self._calibration = equilibrium.wheels, calibration
        self.beams_rad, self.range_m = robot.range_finder.angles_rad, robot.range_finder.range_m
        self._beams = np.stack([np.cos(self.beams_rad), np.sin(self.beams_rad), 0.0 * self.beams_rad], axis=1)
        self._beam_groups = np.zeros(6, dtype=np.uint8)
        self._beam_groups[HIDDEN_GROUP] = 1
        degrees = (robot.max_turn_deg_s, robot.max_pan_deg_s, robot.max_tilt_deg_s)
        self.limits = read_only(np.array([robot.max_speed_m_s, *np.deg2rad(degrees)]))
        """`(4,)` highest forward speed [m/s], turn, pan and tilt rate [rad/s]."""
        self._highest: list[float] = self.limits.tolist()
        self._rest_rad = (REST_YAW_RAD[camera.mount], math.radians(camera.tilt_deg))
        self._base = model.body(BASE).id
        joints = [model.joint(name) for name in _JOINTS]
        self._joints = [int(joint.qposadr[0]) for joint in joints]
        self._head_range: list[list[float]] = np.array([joint.range for joint in joints[2:]]).tolist()
        self._motors = np.array([model.actuator(name).id for name in _MOTORS])
        names = ("wheel-speed-left", "wheel-speed-right", "gyro", "accelerometer", "pan", "tilt")
        sensors = [int(model.sensor(f"robot/{name}").id) for name in names]
        first, size = model.sensor_adr, model.sensor_dim
        self._sensors = np.array([int(first[i]) + k for i in sensors for k in range(int(size[i]))])
        self._sensor_scale = np.ones(len(self._sensors))
        self._sensor_scale[:2] = self._calibration.left_radius_m, self._calibration.right_radius_m
        self._qpos = _robot_qpos(model)
        self._free = self._qpos.start
        self._dofs = np.flatnonzero(model.body_rootid[model.dof_bodyid] == self._base)
        owners = body_owners(model)
        self._owners: list[str] = [owners[body] for body in model.geom_bodyid.tolist()]
        self._own_geoms = model.body_rootid[model.geom_bodyid] == self._base
        self._ignored_geoms = self._own_geoms | np.array([owner == GROUND for owner in self._owners])
        self.planar = bool(model.jnt_type[model.body(BASE).jntadr[0]] != mujoco.mjtJoint.mjJNT_FREE)
        """Whether the base slides on the ground by strong servos, without wheels and springs of its own."""
        self._base_motors = [model.actuator(name).id for name in _PLANAR_MOTORS] if self.planar else []
        low, high = self._head_range[0]
        self.turns_with_head = self.planar and high - low < _STUCK_RAD
        # The inner wheel lifts when m a h = F track, with F the load of one wheel at rest.
        share = math.inf if self.planar else WHEEL_UNLOADING_SHARE * GRAVITY_M_S2 * wheel_share(model)
        self._max_lateral_m_s2 = share * self._wheels.track_m / self._equilibrium.centre_of_mass_m
        self._robot = robot
        self._reset_references()

    def _reset_references(self) -> None:
        self._rates = [0.0] * 4
        self._head = list(self._rest_rad)
        self._odometry = Odometry()
        self.steering = Steering.of(self._robot)
        """How the base is steered; None where it turns on the spot."""

    def reset(
        self, data: mujoco.MjData, x_m: float, y_m: float, heading_rad: float, pan_rad: float | None = None
    ) -> None:
        """Stand still in static equilibrium on the suspension, with the middle of the axle at x, y.

        The head pans to `pan_rad`, counter-clockwise from straight ahead; None is the rest of the mount. The derived
        quantities in `data` are updated too.
        """
        self._reset_references()
        if pan_rad is not None:
            low, high = self._head_range[0]
            self._head[0] = min(max(math.remainder(pan_rad, 2.0 * math.pi), low), high)
        rest = self._equilibrium.at(np.array(self._head))
        data.qpos[self._qpos] = rest
        base = data.qpos[self._free : self._free + 7]
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        base[:2] = x_m + cos * rest[0] - sin * rest[1], y_m + sin * rest[0] + cos * rest[1]
        if self.planar:
            base[2] = heading_rad
        else:
            turn, turned = np.array([math.cos(heading_rad / 2), 0, 0, math.sin(heading_rad / 2)]), np.empty(4)
            mujoco.mju_mulQuat(turned, turn, rest[3:7])
            base[3:7] = turned
        data.qvel[self._dofs] = 0.0
        data.qacc_warmstart[self._dofs] = 0.0
        data.ctrl[self._motors] = [0.0, 0.0, *self._head]
        data.ctrl[self._base_motors] = 0.0
        mujoco.mj_forward(self._model, data)

    def scaled(self, command: ArrayLike) -> tuple[float, float, float, float]:
        """Forward speed [m/s], turn, pan, tilt rate [rad/s] of a `(4,)` command in [-1, 1] of the limits, clipped."""
        forward, turn, pan, tilt = np.clip(np.asarray(command, dtype=np.float64), -1.0, 1.0) * self.limits
        return float(forward), float(turn), float(pan), float(tilt)

    def command(
        self,
        data: mujoco.MjData,
        forward_m_s: float,
        turn_rad_s: float,
        pan_rad_s: float,
        tilt_rad_s: float,
        duration_s: float,
    ) -> None:
        """Set the motors for the coming physics steps.

        Speeds are clipped to the robot's limits and approached no faster than `ACCELERATION`. Turn and pan rate are
        counter-clockwise, the tilt rate is upwards; a base that is steered turns as far as it drives. Where nothing
        else can pan, the base turns by both rates.
        """
        if self.turns_with_head:
            turn_rad_s += pan_rad_s
        places = data.qpos.tolist()
        left, right, *head = [places[joint] for joint in self._joints]
        self._odometry = self._odometry.updated(left, right, self._calibration)
        # Numbers one by one: arrays of four cost five times as much.
        rates = self._rates
        for axis, wanted in enumerate((forward_m_s, turn_rad_s, pan_rad_s, tilt_rad_s)):
            limit, step = self._highest[axis], _ACCELERATION[axis] * duration_s
            change = min(max(wanted, -limit), limit) - rates[axis]
            rates[axis] += min(max(change, -step), step)
        if self.steering is not None:
            wanted = min(max(turn_rad_s, -self._highest[1]), self._highest[1])
            rates[1] = self.steering.turn_rad_s(rates[0], wanted, duration_s)
        forward, turn = rates[:2]
        lateral = abs(forward * turn)
        if lateral > self._max_lateral_m_s2:
            turn *= self._max_lateral_m_s2 / lateral
            rates[1] = turn
        half = 0.5 * self._wheels.track_m * turn
        for axis, angle in enumerate(head):
            moved = self._head[axis] + rates[2 + axis] * duration_s
            low, high = self._head_range[axis]
            self._head[axis] = min(max(min(max(moved, angle - WINDUP_RAD), angle + WINDUP_RAD), low), high)
        wheels = (forward - half) / self._wheels.left_radius_m, (forward + half) / self._wheels.right_radius_m
        data.ctrl[self._motors] = [*wheels, *self._head]
        if self.planar:
            # In the middle of the time for which it holds.
            heading = places[self._free + 2] + 0.5 * duration_s * turn
            data.ctrl[self._base_motors] = forward * math.cos(heading), forward * math.sin(heading), turn

    def pose(self, data: mujoco.MjData) -> tuple[float, float, float]:
        """x, y [m] of the middle of the axle and heading [rad] in [-pi, pi], world frame."""
        x, y, third, qw, qx, qy, qz = data.qpos[self._free : self._free + 7].tolist()
        if self.planar:
            return x, y, math.remainder(third, 2.0 * math.pi)
        return x, y, math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))

    def camera_mount(self, pan_rad: float, tilt_rad: float) -> FloatArray:
        """`(4, 4)` T_base_camera that angles of the head tell of a robot at rest, without the sway of its mast.

        The base is on the ground, x forward; camera axes as OpenCV.
        """
        return self._equilibrium.camera(pan_rad, tilt_rad)

    @property
    def track_m(self) -> float:
        """Distance between the contact points of its wheels."""
        return self._wheels.track_m

    def proprio(self, data: mujoco.MjData) -> NDArray[np.float32]:
        """`(n,)` proprioception in the order of `pftrack_sim.core.proprioception.PROPRIO_NAMES`.

        Poses of bodies and geoms in `data` must be up to date.
        """
        places = data.qpos.tolist()
        odometry = self._odometry.updated(places[self._joints[0]], places[self._joints[1]], self._calibration)
        sensed = data.sensordata[self._sensors] * self._sensor_scale
        return np.concatenate([odometry[:3], sensed, self._ranges(data)]).astype(np.float32)

    def _ranges(self, data: mujoco.MjData) -> FloatArray:
        """`(beams,)` ranges [m] along the beams, from the middle of the axle, up to the longest.

        The beams are fixed to the chassis. They meet hidden collision geoms, not what is drawn, and pass through the
        robot itself; on a robot that pitches they may meet the ground.
        """
        rotation, count = data.xmat[self._base].reshape(3, 3), len(self._beams)
        origin, directions = data.xpos[self._base] + BEAM_HEIGHT_M * rotation[:, 2], (self._beams @ rotation.T).ravel()
        ranges = np.empty(count)
        ends = np.empty(count, dtype=np.int32), ranges, None, count, self.range_m
        mujoco.mj_multiRay(self._model, data, origin, directions, self._beam_groups, True, self._base, *ends)
        ranges[(ranges < 0.0) | (ranges > self.range_m)] = self.range_m
        return ranges

    def collision(self, data: mujoco.MjData) -> str | None:
        """Owner of the geom in contact with the robot in the last physics step ("target", "pillar-3"), or None.

        The ground does not count. Of several contacts, the deepest counts.
        """
        pairs = data.contact.geom
        if len(pairs) == 0:
            return None
        relevant = self._own_geoms[pairs].any(axis=1) & ~self._ignored_geoms[pairs].all(axis=1)
        contacts = np.flatnonzero(relevant & (data.contact.dist <= 0.0))
        if contacts.size == 0:
            return None
        first, second = pairs[contacts[np.argmin(data.contact.dist[contacts])]]
        return self._owners[int(second if self._own_geoms[first] else first)]


class Equilibrium:
    """Joint positions of the robot at rest, simulated far from everything. Several threads may share it.

    Args:
        model: With the robot on the ground, and whatever else.

    Attributes:
        centre_of_mass_m: Height of the robot's centre of mass above the ground.
        wheels: The true radii of its wheels, and their track.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._qpos = _robot_qpos(model)
        self._joints = np.array([model.joint(name).qposadr[0] for name in _JOINTS])
        self._head_motors = np.array([model.actuator(name).id for name in _MOTORS[2:]])
        # By the bytes of the angles, which tell -0.0 from 0.0.
        self._settled = lru_cache(maxsize=16)(self._settle)
        scratch = mujoco.MjData(model)
        mujoco.mj_kinematics(model, scratch)
        mujoco.mj_comPos(model, scratch)
        self.centre_of_mass_m = float(scratch.subtree_com[model.body(BASE).id, 2])
        left, right = (scratch.xanchor[model.joint(name).id].tolist() for name in _JOINTS[:2])
        self.wheels = OdometryCalibration(left[2], right[2], left[1] - right[1])

    def at(self, head_rad: FloatArray) -> FloatArray:
        """Joint positions, with the middle of the axle about the origin, for `(2,)` pan and tilt; read-only."""
        return self._settled(head_rad.tobytes())

    def camera(self, pan_rad: float, tilt_rad: float) -> FloatArray:
        """`(4, 4)` pose of the camera over a base about the origin, for these angles of the head."""
        scratch = mujoco.MjData(self._model)
        scratch.qpos[self._qpos] = self.at(np.zeros(2))
        scratch.qpos[self._joints[2:]] = pan_rad, tilt_rad
        return camera_pose(self._model, scratch)

    def _settle(self, head: bytes) -> FloatArray:
        head_rad = np.frombuffer(head)
        scratch, free = mujoco.MjData(self._model), self._qpos.start
        scratch.qpos[free : free + 2] = _FAR_M
        scratch.qpos[self._joints[2:]] = head_rad
        scratch.ctrl[self._head_motors] = head_rad
        mujoco.mj_step(self._model, scratch, round(_SETTLE_S / self._model.opt.timestep))
        rest = scratch.qpos[self._qpos].copy()
        rest[:2] -= _FAR_M
        rest[self._joints[:2] - free] = 0.0
        return read_only(rest)


def camera_pose(model: mujoco.MjModel, data: mujoco.MjData) -> FloatArray:
    """`(4, 4)` T_world_camera, axes as OpenCV: x right, y down, z forward.

    Updates the poses of bodies, geoms and cameras in `data`: after `mj_step` they are one step old.
    """
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    camera, pose = data.camera(CAMERA), _IDENTITY.copy()
    # MuJoCo's y points up and its z backwards.
    pose[:3, :3] = camera.xmat.reshape(3, 3) * _OPENCV_AXES
    pose[:3, 3] = camera.xpos
    return pose


def _robot_qpos(model: mujoco.MjModel) -> slice:
    """Positions of the robot's joints in `qpos`, its free joint first."""
    owned = np.flatnonzero(model.body_rootid[model.jnt_bodyid] == model.body(BASE).id)
    return slice(int(model.jnt_qposadr[owned[0]]), int(model.jnt_qposadr[owned[-1]]) + 1)
