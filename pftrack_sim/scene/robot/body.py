"""The robot as MuJoCo bodies, joints, motors and sensors.

    base (free) -+- wheel mounts (slide, sprung) - wheels (hinge, velocity servo)
                 +- casters (slide, sprung), front and rear, without friction
                 +- mast (pitch and roll hinge, stiff spring) - pan (position servo) - head (tilt) - camera

The base's frame lies on the ground below the middle of the axle: x forward, y left, z up.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from pftrack_sim.scenario import model
from pftrack_sim.scene.layout import HIDDEN_ROBOT_GROUP, ROBOT_GROUP
from pftrack_sim.scene.robot import dimensions as d
from pftrack_sim.scene.robot import visual_geoms as looks

CAMERA = "robot/camera"
BASE = "robot/base"

REST_YAW_RAD = {"front": 0.0, "left": math.pi / 2, "right": -math.pi / 2, "back": math.pi}
"""Pan at rest of each way to mount the camera."""

# MuJoCo's cameras look along -z with y up; this one looks along the head's x with z up.
_CAMERA_QUAT = (0.5, 0.5, -0.5, -0.5)

_ROBOT_BIT, _OTHERS_BITS = 2, 1 | 4
_GEOM, _JOINT = mujoco.mjtGeom, mujoco.mjtJoint


def add_robot(spec: mujoco.MjSpec, robot: model.Robot, camera: model.Camera) -> None:
    """Put the robot into the world, at the origin, facing +x, resting on the ground z = 0.

    Args:
        spec: Gets bodies, joints, actuators, sensors and the camera, all named `"robot/..."`. It needs a colliding
            ground plane at z = 0; a gravity of -9.81 along z is assumed.
        robot: How its tyres grip the floor; `Drive` keeps the limits, and every robot is built alike.
        camera: Field of view, mount, height of the optical centre and tilt at rest.
    """
    base = spec.worldbody.add_body(name=BASE)
    base.add_freejoint(name="robot/free")
    _chassis(base)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        _wheel(spec, base, side, sign, robot.floor_friction)
    for end, sign in (("front", 1.0), ("rear", -1.0)):
        _caster(base, end, sign)
    _mast(spec, base, camera)
    _imu(spec, base)


def _sprung_kg(mast: d.Mast) -> float:
    return d.CHASSIS_KG + d.BATTERY_KG + d.FOOT_KG + d.MAST_KG_M * max(mast.length_m, 0.0) + d.PAN_KG + d.HEAD_KG


def _chassis(base: mujoco.MjsBody) -> None:
    height = d.DECK_M - d.BASE_BOTTOM_M
    middle = 0.5 * (d.DECK_M + d.BASE_BOTTOM_M)
    _solid(base, "robot/hull", _GEOM.mjGEOM_CYLINDER, (d.BASE_RADIUS_M, height / 2, 0), (0, 0, middle), d.CHASSIS_KG)
    # The battery is the ballast: it lies on the bottom plate.
    base.add_geom(
        name="robot/battery",
        type=_GEOM.mjGEOM_BOX,
        size=[0.13, 0.1, 0.04],
        pos=[0, 0, d.BASE_BOTTOM_M + 0.045],
        mass=d.BATTERY_KG,
        contype=0,
        conaffinity=0,
        group=HIDDEN_ROBOT_GROUP,
    )
    looks.dress_base(base)


def _wheel(spec: mujoco.MjSpec, base: mujoco.MjsBody, side: str, sign: float, friction: float) -> None:
    mount = base.add_body(name=f"robot/mount-{side}", pos=[0, sign * d.TRACK_M / 2, d.WHEEL_RADIUS_M])
    _spring(mount, f"robot/suspension-{side}", d.WHEEL_SPRING_N_M, d.WHEEL_DAMPING_NS_M)
    _add_mass(mount, 0.4 * d.WHEEL_KG)
    wheel = mount.add_body(name=f"robot/wheel-{side}")
    axle = wheel.add_joint(name=f"robot/axle-{side}", type=_JOINT.mjJNT_HINGE, axis=[0, 1, 0])
    axle.armature = d.WHEEL_ARMATURE_KG_M2
    axle.damping = [0.004, 0, 0]
    # An ellipsoid touches the ground in one point, below the axle: it rolls without the bumps of a cylinder's rim.
    tyre = _solid(
        wheel,
        f"robot/tyre-{side}",
        _GEOM.mjGEOM_ELLIPSOID,
        (d.WHEEL_RADIUS_M, d.WHEEL_HALF_WIDTH_M, d.WHEEL_RADIUS_M),
        (0, 0, 0),
        0.6 * d.WHEEL_KG,
    )
    tyre.priority = 1
    tyre.friction = [friction, 0.005, 0.0001]
    tyre.solref = [0.01, 1.0]
    looks.dress_wheel(wheel, sign)
    motor = spec.add_actuator(name=f"robot/drive-{side}", target=f"robot/axle-{side}")
    motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
    motor.set_to_velocity(kv=d.WHEEL_SERVO_NMS)
    motor.forcerange = [-d.WHEEL_TORQUE_NM, d.WHEEL_TORQUE_NM]
    _sensor(spec, f"robot/wheel-speed-{side}", mujoco.mjtSensor.mjSENS_JOINTVEL, f"robot/axle-{side}")


def _caster(base: mujoco.MjsBody, end: str, sign: float) -> None:
    caster = base.add_body(name=f"robot/caster-{end}", pos=[sign * d.CASTER_ARM_M, 0, d.CASTER_RADIUS_M])
    _spring(caster, f"robot/suspension-{end}", d.CASTER_SPRING_N_M, d.CASTER_DAMPING_NS_M)
    ball = _solid(caster, f"robot/ball-{end}", _GEOM.mjGEOM_SPHERE, (d.CASTER_RADIUS_M, 0, 0), (0, 0, 0), d.CASTER_KG)
    # A caster swivels and rolls: seen from the base it slides without friction.
    ball.priority = 1
    ball.condim = 1
    ball.solref = [0.01, 1.0]
    looks.dress_caster(caster)


def _mast(spec: mujoco.MjSpec, base: mujoco.MjsBody, camera: model.Camera) -> None:
    mast = d.Mast.for_camera(camera.height_m, math.radians(camera.tilt_deg))
    # Springs are stretched so that they carry the robot level at zero deflection.
    weight = _sprung_kg(mast) * d.GRAVITY_M_S2
    for name in ("left", "right"):
        joint = spec.joint(f"robot/suspension-{name}")
        joint.springref = -(0.5 - d.CASTER_SHARE) * weight / d.WHEEL_SPRING_N_M
    for name in ("front", "rear"):
        joint = spec.joint(f"robot/suspension-{name}")
        joint.springref = -d.CASTER_SHARE * weight / d.CASTER_SPRING_N_M

    pole = base.add_body(name="robot/mast", pos=[0, 0, d.DECK_M])
    for name, axis in (("pitch", [0, 1, 0]), ("roll", [1, 0, 0])):
        joint = pole.add_joint(name=f"robot/mast-{name}", type=_JOINT.mjJNT_HINGE, axis=axis)
        joint.stiffness = [mast.stiffness_nm_rad, 0, 0]
        joint.damping = [mast.damping_nms_rad, 0, 0]
    # The clamp at its foot; it also gives the shortest mast an inertia.
    _add_mass(pole, d.FOOT_KG)
    if mast.length_m > 0.02:
        size = (looks.MAST_RADIUS_M, mast.length_m / 2, 0)
        _solid(
            pole,
            "robot/pole",
            _GEOM.mjGEOM_CYLINDER,
            size,
            (0, 0, mast.length_m / 2),
            d.MAST_KG_M * mast.length_m,
            rgba=looks.METAL,
        )
    looks.dress_mast(pole, mast.length_m)

    pan = pole.add_body(name="robot/pan", pos=[0, 0, mast.length_m])
    _servo(spec, pan, "robot/pan", [0, 0, 1], d.PAN_RANGE_RAD, d.PAN_INERTIA_KG_M2)
    _add_mass(pan, d.PAN_KG, height=0.02)
    looks.dress_pan(pan)

    head = pan.add_body(name="robot/head", pos=[0, 0, d.NECK_M])
    _servo(spec, head, "robot/tilt", [0, -1, 0], d.TILT_RANGE_RAD, d.TILT_INERTIA_KG_M2)
    _solid(head, "robot/head", _GEOM.mjGEOM_SPHERE, (0.05, 0, 0), (0, 0, 0), d.HEAD_KG)
    looks.dress_head(head)
    eye = head.add_camera(name=CAMERA, pos=[d.LENS_M, 0, 0], quat=_CAMERA_QUAT)
    eye.fovy = camera.fovy_deg


def _imu(spec: mujoco.MjSpec, base: mujoco.MjsBody) -> None:
    base.add_site(name="robot/imu", pos=[0, 0, 0.15], size=[0.005, 0.005, 0.005], group=HIDDEN_ROBOT_GROUP)
    _sensor(spec, "robot/gyro", mujoco.mjtSensor.mjSENS_GYRO, "robot/imu", mujoco.mjtObj.mjOBJ_SITE)
    _sensor(spec, "robot/accelerometer", mujoco.mjtSensor.mjSENS_ACCELEROMETER, "robot/imu", mujoco.mjtObj.mjOBJ_SITE)


def _servo(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, axis: list[int], range_rad: float, inertia_kg_m2: float
) -> None:
    joint = body.add_joint(name=name, type=_JOINT.mjJNT_HINGE, axis=axis)
    joint.armature = d.HEAD_ARMATURE_KG_M2
    joint.range = np.array([-range_rad, range_rad]) * (180.0 / math.pi if spec.compiler.degree else 1.0)
    motor = spec.add_actuator(name=name, target=name)
    motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
    motor.set_to_position(kp=inertia_kg_m2 * d.HEAD_SERVO_RAD_S**2, kv=2.0 * inertia_kg_m2 * d.HEAD_SERVO_RAD_S)
    motor.forcerange = [-d.HEAD_TORQUE_NM, d.HEAD_TORQUE_NM]
    _sensor(spec, name, mujoco.mjtSensor.mjSENS_JOINTPOS, name)


def _sensor(
    spec: mujoco.MjSpec,
    name: str,
    kind: mujoco.mjtSensor,
    target: str,
    target_kind: mujoco.mjtObj = mujoco.mjtObj.mjOBJ_JOINT,
) -> None:
    spec.add_sensor(name=name, type=kind, objtype=target_kind, objname=target)


def _spring(body: mujoco.MjsBody, name: str, stiffness_n_m: float, damping_ns_m: float) -> None:
    joint = body.add_joint(name=name, type=_JOINT.mjJNT_SLIDE, axis=[0, 0, 1], range=[-d.TRAVEL_M, d.TRAVEL_M])
    joint.stiffness = [stiffness_n_m, 0, 0]
    joint.damping = [damping_ns_m, 0, 0]


def _solid(
    body: mujoco.MjsBody,
    name: str,
    kind: mujoco.mjtGeom,
    size: tuple[float, float, float],
    pos: tuple[float, float, float],
    mass_kg: float,
    rgba: tuple[float, float, float, float] | None = None,
) -> mujoco.MjsGeom:
    """A geom that collides and weighs; drawn only if it has a colour."""
    geom = body.add_geom(name=name, type=kind, size=list(size), pos=list(pos), mass=mass_kg)
    geom.contype, geom.conaffinity = _ROBOT_BIT, _OTHERS_BITS
    geom.group = HIDDEN_ROBOT_GROUP if rgba is None else ROBOT_GROUP
    if rgba is not None:
        geom.rgba = rgba
    return geom


def _add_mass(body: mujoco.MjsBody, mass_kg: float, height: float = 0.0) -> None:
    """A small heavy ball that neither shows nor collides."""
    body.add_geom(
        type=_GEOM.mjGEOM_SPHERE,
        size=[0.04, 0, 0],
        pos=[0, 0, height],
        mass=mass_kg,
        contype=0,
        conaffinity=0,
        group=HIDDEN_ROBOT_GROUP,
    )
