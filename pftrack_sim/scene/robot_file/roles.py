"""What in the file of a robot carries its camera: the camera itself, the joints of its head, its wheels."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import mujoco
import numpy as np

from pftrack_sim.core.data_files import assets_dir
from pftrack_sim.core.errors import ParameterError, did_you_mean
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.robot import Robot

_OBJECT = mujoco.mjtObj
_ALONG = 0.8  # Cosine from which an axis counts as upright or lateral
_FIXED_RAD = 1e-6
_MOST_NAMES = 40
_UPRIGHT = 0.5  # Cosine of the angle by which a camera may lean before it counts as one by mistake
_LEVEL = 1e-3  # Cosine of a pitch below which it is a right angle
_LINK = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # Axes of OpenCV in those of a link


@dataclass(frozen=True)
class Roles:
    """What a scenario says about a robot's file, by the keys of its table."""

    model: str
    model_digest: str
    camera_site: str | None
    camera_rpy_deg: tuple[float, float, float] | None
    drive: str
    wheels: tuple[str, str] | None
    pan: str | None
    tilt: str | None
    pose_deg: tuple[tuple[str, float], ...]

    @classmethod
    def of(cls, robot: Robot) -> Roles:
        """Those of a scenario; without a file, those of the robot that ships."""
        if robot.model is None:
            robot = robot.model_copy(update={"model": str(assets_dir() / "robot.xml"), "drive": "motors"})
        own: dict[str, Any] = {one.name: getattr(robot, one.name) for one in fields(cls)}
        own["pose_deg"] = tuple(sorted(robot.pose_deg.items()))
        return cls(**own)

    @property
    def motorised(self) -> bool:
        """Whether motors, wheels and masses of the file move it, not a base that is put under it."""
        return self.drive == "motors"


class Hinge(NamedTuple):
    """A joint that stays, read about an axis: counter-clockwise, or upwards, as pan and tilt of the proprioception.

    Attributes:
        body: That it moves; -1 where there is none.
        anchor_m: `(3,)` a point of its axis, a `(3,)` unit vector, in the frame of the base.
        rest_rad: What it reads in the pose of the file; `range_rad`: least and greatest of what it reads.
    """

    body: int
    anchor_m: FloatArray
    axis: FloatArray
    rest_rad: float
    range_rad: tuple[float, float]


def locate_camera(
    model: Any, data: mujoco.MjData, wanted: str | None, rpy_deg: tuple[float, float, float] | None
) -> tuple[int, FloatArray]:
    """Body of the camera, and its `(4, 4)` pose in OpenCV axes, turned by roll, pitch and yaw.

    Cameras of MJCF look along -z with y up, sites and links along x with z up, as REP-103 has them; those whose name
    holds `optical` look along z with y down.

    Raises:
        ParameterError: There is none of this name; or, without a name, none at all; or it lies on its side.
    """
    kinds = {
        "camera": _names(model, _OBJECT.mjOBJ_CAMERA, range(model.ncam)),
        "site": _names(model, _OBJECT.mjOBJ_SITE, range(model.nsite)),
        "body": _names(model, _OBJECT.mjOBJ_BODY, range(1, model.nbody)),
    }
    cameras, known = kinds["camera"], [name for names in kinds.values() for name in names]
    if wanted is None:
        likely = [one for one in known[len(cameras) :] if "camera" in one.lower() or "optical" in one.lower()]
        wanted = next(iter([*cameras, *sorted(likely, key=lambda one: "optical" not in one.lower())]), None)
        if wanted is None:
            has = _listed(_from_above(model, data, kinds["body"], known))
            raise ParameterError(
                "robot.camera_site: the robot has no camera, and no site or link called camera or optical: name the "
                f"site or link that the camera is at (it has: {has})"
            )
    kind = next((kind for kind, names in kinds.items() if wanted in names), None)
    if kind is None:
        raise ParameterError(
            f"robot.camera_site: the robot has no camera, site or link {wanted!r}{did_you_mean(wanted, known)} "
            f"(it has: {_listed(known)})"
        )
    own, placed = getattr(model, kind)(wanted), getattr(data, kind)(wanted)
    body = int(own.id if kind == "body" else own.bodyid[0])
    place, axes = placed.xpos, placed.xmat.reshape(3, 3)
    if kind == "camera":
        axes = axes * (1.0, -1.0, -1.0)
    elif "optical" not in wanted.lower():
        axes = axes @ _LINK
    link, pose, turn = axes @ _LINK.T, np.eye(4), np.empty(4)
    if rpy_deg is not None:
        matrix = np.empty(9)
        mujoco.mju_euler2Quat(turn, np.radians(rpy_deg), "XYZ")
        mujoco.mju_quat2Mat(matrix, turn)
        axes = link @ matrix.reshape(3, 3) @ _LINK
    elif link[2, 2] < _UPRIGHT:
        level = [*np.round(np.degrees(_rpy(link.T))).astype(int).tolist()]
        raise ParameterError(
            f"robot.camera_site: the upper side of the image of {wanted!r} would not be up: name another site or link, "
            f"or turn it; robot.camera_rpy_deg = {level} makes it look ahead"
        )
    pose[:3, :3], pose[:3, 3] = axes, place
    return body, pose


def _rpy(rotation: FloatArray) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a rotation, about the fixed axes x, then y, then z [rad]."""
    level = math.hypot(rotation[2, 1], rotation[2, 2])
    pitch = math.atan2(-rotation[2, 0], level)
    if level < _LEVEL:  # only the sum of roll and yaw, or their difference, is known
        return 0.0, pitch, math.atan2(-rotation[0, 1], rotation[1, 1])
    return math.atan2(rotation[2, 1], rotation[2, 2]), pitch, math.atan2(rotation[1, 0], rotation[0, 0])


def _from_above(model: Any, data: mujoco.MjData, bodies: list[str], known: list[str]) -> list[str]:
    """Names of sites and links, the highest link first."""
    heights = {name: float(data.xpos[model.body(name).id, 2]) for name in bodies}
    return sorted(known, key=lambda name: -heights.get(name, math.inf))


def ancestors(model: Any, body: int) -> list[int]:
    """A body and those that carry it, up to the root."""
    chain = [body]
    while model.body_parentid[chain[-1]] > 0:
        chain.append(int(model.body_parentid[chain[-1]]))
    return chain


def hinges_of(model: Any) -> list[int]:
    """All hinges."""
    return np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE).tolist()


def named_hinge(model: Any, key: str, name: str, known: Sequence[int]) -> int:
    """The hinge of a name among those known; `key` is named in the message.

    Raises:
        ParameterError: There is none.
    """
    joint = int(mujoco.mj_name2id(model, _OBJECT.mjOBJ_JOINT, name))
    if joint not in known:
        names = _names(model, _OBJECT.mjOBJ_JOINT, known)
        which = "moves the camera" if key in ("robot.pan", "robot.tilt") else "the robot has"
        raise ParameterError(
            f"{key}: {name!r} is no hinge that {which}{did_you_mean(name, names)} (those: {_listed(names)})"
        )
    return joint


def set_pose(model: Any, data: mujoco.MjData, pose_deg: Iterable[tuple[str, float]]) -> None:
    """Turn hinges to angles by their names.

    Raises:
        ParameterError: There is no hinge of a name.
    """
    known = hinges_of(model)
    for name, degrees in pose_deg:
        joint = named_hinge(model, "robot.pose_deg", name, known)
        data.qpos[model.jnt_qposadr[joint]] = math.radians(degrees)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)


def head_hinge(
    model: Any, data: mujoco.MjData, key: str, name: str | None, moving: Sequence[int], axis: FloatArray
) -> int | None:
    """The hinge that turns the camera about a `(3,)` axis: the one that is named, or the nearest to the camera.

    `moving` are those that carry the camera, the nearest first.

    Raises:
        ParameterError: The one that is named does not.
    """
    if name == "none":
        return None
    if name is None:
        return next((joint for joint in moving if abs(data.xaxis[joint] @ axis) > _ALONG), None)
    joint = named_hinge(model, key, name, moving)
    if abs(data.xaxis[joint] @ axis) <= _ALONG:
        about = "upright" if key == "robot.pan" else "lateral to the camera"
        raise ParameterError(f"{key}: the axis of {name!r} is not {about}: {data.xaxis[joint].round(3).tolist()}")
    return joint


def read_hinge(
    model: Any,
    data: mujoco.MjData,
    joint: int | None,
    axis: FloatArray,
    rest_rad: float,
    reach_rad: float,
    origin_m: FloatArray,
) -> Hinge:
    """A joint in the frame of a base, read about an axis; `reach_rad` is how far it turns where it has no limits.

    None is one at the base's middle that hardly moves.
    """
    if joint is None:
        return Hinge(-1, np.zeros(3), axis, rest_rad, (rest_rad - _FIXED_RAD, rest_rad + _FIXED_RAD))
    sign = math.copysign(1.0, data.xaxis[joint] @ axis)
    low, high = rest_rad - reach_rad, rest_rad + reach_rad
    if model.jnt_limited[joint]:
        angles = rest_rad + sign * (model.jnt_range[joint] - data.qpos[model.jnt_qposadr[joint]])
        low, high = sorted(angles.tolist())
    ends = min(low, rest_rad - _FIXED_RAD), max(high, rest_rad + _FIXED_RAD)
    return Hinge(int(model.jnt_bodyid[joint]), data.xanchor[joint] - origin_m, sign * data.xaxis[joint], rest_rad, ends)


def _names(model: Any, kind: mujoco.mjtObj, ids: Iterable[int]) -> list[str]:
    return [name for one in ids if (name := mujoco.mj_id2name(model, kind, one))]


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return ", ".join(names[:_MOST_NAMES]) + more if names else "none"
