"""The robot: that of a scenario's file, or `assets/robot.xml` adapted to the camera and the floor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco

from pftrack_sim.core.data_files import assets_dir
from pftrack_sim.core.errors import ParameterError, ScenarioError
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scenario.camera import Camera
from pftrack_sim.scenario.robot import Robot
from pftrack_sim.scene.robot_file.fitting import add_fitted, fit
from pftrack_sim.scene.robot_file.roles import Roles
from pftrack_sim.scene.scene_spec import SceneSpec

PREFIX = "robot/"
BASE = "robot/base"
CAMERA = "robot/camera"

REST_YAW_RAD = {"front": 0.0, "left": math.pi / 2, "right": -math.pi / 2, "back": math.pi}
"""Pan angle at rest by camera mount."""

SUSPENSIONS = ("left", "right", "front", "rear")  # Of the wheels and of the casters
GRAVITY_M_S2 = 9.81

# Dimensions that Python code needs. They repeat the MJCF file; a test compares both.
DECK_M = 0.235  # Height of the foot of the mast
NECK_M = 0.055  # From the top of the mast up to the tilt axis
LENS_M = 0.06  # From the tilt axis forward to the optical centre

BASE_KG, FOOT_KG, PAN_KG, HEAD_KG = 17.0, 0.1, 0.45, 0.40
MAST_KG_M = 0.55
CASTER_SHARE = 0.2  # Share of the sprung weight on each caster; the wheels carry the rest, for traction
_MAST_HZ_M = 4.5  # Natural frequency of the mast on a fixed base, times its length: longer masts swing slower
_MAST_HZ_RANGE = (3.0, 15.0)
_MAST_DAMPING_RATIO = 0.06
_MIN_POLE_M = 0.02
_MIN_CLAMPED_M = 0.5


@dataclass(frozen=True)
class Mast:
    """The mast that holds a camera at a given height.

    Attributes:
        length_m: From the deck to the pan unit; negative if the neck is sunk into the deck.
        stiffness_nm_rad: Of the joints at its foot, in pitch and in roll.
        damping_nms_rad: Of the joints at its foot, in pitch and in roll.
    """

    length_m: float
    stiffness_nm_rad: float
    damping_nms_rad: float

    @classmethod
    def for_camera(cls, height_m: float, tilt_rad: float) -> Mast:
        """Mast with the optical centre at `height_m` above the ground when the robot is at rest, tilted `tilt_rad`."""
        length = height_m - LENS_M * math.sin(tilt_rad) - NECK_M - DECK_M
        pole, top = max(length, 0.0), max(length, 0.0) + NECK_M
        inertia = MAST_KG_M * pole**3 / 3.0 + (PAN_KG + HEAD_KG) * top**2
        gravity_torque = GRAVITY_M_S2 * (0.5 * MAST_KG_M * pole**2 + (PAN_KG + HEAD_KG) * top)
        low_hz, high_hz = _MAST_HZ_RANGE
        omega = 2.0 * math.pi * min(max(_MAST_HZ_M / top, low_hz), high_hz)
        return cls(length, inertia * omega**2 + gravity_torque, 2.0 * _MAST_DAMPING_RATIO * omega * inertia)

    @property
    def pole_kg(self) -> float:
        """Mass of the pole."""
        return MAST_KG_M * max(self.length_m, 0.0)


@dataclass(frozen=True)
class RobotForm:
    """What the robot's model depends on."""

    floor_friction: float
    camera_height_m: float
    camera_tilt_deg: float
    camera_fovy_deg: float
    roles: Roles | None = None

    @classmethod
    def of(cls, robot: Robot, camera: Camera) -> RobotForm:
        """That of a scenario."""
        return cls(robot.floor_friction, camera.height_m, camera.tilt_deg, camera.fovy_deg, Roles.of(robot))

    @property
    def lens_m(self) -> float:
        """From the middle of the base forward to the optical centre, in the direction of the gaze."""
        if self.roles is None:
            return LENS_M * math.cos(math.radians(self.camera_tilt_deg))
        pose = fit(self.roles).T_base_camera
        ahead = pose[:2, 2] / max(math.hypot(*pose[:2, 2]), 1e-9)
        return float(ahead @ pose[:2, 3])


def fitted_settings(settings: ResolvedScenario) -> ResolvedScenario:
    """A scenario with what follows from the file of its robot: the camera's height, and the robot's radius.

    Raises:
        ScenarioError: The file cannot be used; the message says why.
    """
    roles, robot, camera = Roles.of(settings.robot), settings.robot, settings.camera
    if roles is None:
        return settings
    try:
        found = fit(roles)
        if camera.tilt_deg and not found.tilts:
            raise ParameterError(f"camera.tilt_deg: no joint of the robot tilts its camera, got {camera.tilt_deg:g}")
    except ParameterError as error:
        raise ScenarioError(repr(settings.title), [str(error)]) from None
    height_m, radius_m = float(found.T_base_camera[2, 3]), robot.radius_m or found.radius_m
    slow = {} if found.pans else {"max_pan_deg_s": min(robot.max_pan_deg_s, robot.max_turn_deg_s)}
    changed = {"radius_m": radius_m, **slow}
    return settings.model_copy(
        update={"robot": robot.model_copy(update=changed), "camera": camera.model_copy(update={"height_m": height_m})}
    )


def mount(model: mujoco.MjModel) -> list[int]:
    """Bodies that carry the camera and shake with it: those above the base, or the base where it has none."""
    bodies = [int(model.cam_bodyid[model.camera(CAMERA).id])]
    while model.body_parentid[bodies[-1]] > 0:
        bodies.append(int(model.body_parentid[bodies[-1]]))
    return bodies[:-1] or bodies


def add_robot(spec: SceneSpec, form: RobotForm) -> None:
    """Attach the robot to the world at the origin, facing +x, resting on the ground z = 0.

    The spec gains bodies, joints, actuators, sensors and the camera, all named `"robot/..."`. It needs a colliding
    ground plane at z = 0 and gravity along -z. The drive (`agents.robot`) applies the speed limits.
    """
    if form.roles is not None:
        add_fitted(spec, fit(form.roles), PREFIX, form.camera_fovy_deg)
        return
    mjcf = mujoco.MjSpec.from_file(str(assets_dir() / "robot.xml"))
    mast = Mast.for_camera(form.camera_height_m, math.radians(form.camera_tilt_deg))
    mjcf.camera("camera").fovy = form.camera_fovy_deg
    for side in ("left", "right"):
        mjcf.geom(f"tyre-{side}").friction[0] = form.floor_friction
    _set_mast(mjcf, mast)
    _preload_suspension(mjcf, BASE_KG + FOOT_KG + mast.pole_kg + PAN_KG + HEAD_KG)
    spec.attach(mjcf, prefix=PREFIX, frame=spec.worldbody.add_frame())


def _set_mast(mjcf: mujoco.MjSpec, mast: Mast) -> None:
    half_m = 0.5 * mast.length_m
    for name in ("mast-pitch", "mast-roll"):
        joint = mjcf.joint(name)
        joint.stiffness[0] = mast.stiffness_nm_rad
        joint.damping[0] = mast.damping_nms_rad
    mjcf.body("pan").pos[2] = mast.length_m
    pole = mjcf.geom("pole")
    if mast.length_m > _MIN_POLE_M:
        pole.size[1] = pole.pos[2] = half_m
        pole.mass = mast.pole_kg
    else:
        mjcf.delete(pole)
    clamp = mjcf.frame("clamp")
    if mast.length_m > _MIN_CLAMPED_M:
        clamp.pos[2] = half_m
    else:
        mjcf.delete(clamp)


def _preload_suspension(mjcf: mujoco.MjSpec, sprung_kg: float) -> None:
    """Stretch the springs so that they carry the robot level at zero deflection."""
    weight_n = sprung_kg * GRAVITY_M_S2
    for end in SUSPENSIONS:
        joint, share = mjcf.joint(f"suspension-{end}"), 0.5 - CASTER_SHARE if end in ("left", "right") else CASTER_SHARE
        joint.springref = -share * weight_n / joint.stiffness[0]
