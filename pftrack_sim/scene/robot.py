"""The robot of a scenario, which a file describes: `assets/robot.xml` where the scenario names none."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco

from pftrack_sim.core.errors import ParameterError, ScenarioError
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scenario.camera import Camera
from pftrack_sim.scenario.robot import Robot
from pftrack_sim.scene.robot_file.fitting import add_fitted, fit
from pftrack_sim.scene.robot_file.motorised import add_motorised, mast_of
from pftrack_sim.scene.robot_file.roles import Roles, ancestors
from pftrack_sim.scene.scene_spec import SceneSpec

BASE = "robot/base"
CAMERA = "robot/camera"

REST_YAW_RAD = {"front": 0.0, "left": math.pi / 2, "right": -math.pi / 2, "back": math.pi}
"""Pan angle at rest by camera mount."""


@dataclass(frozen=True)
class RobotForm:
    """What the robot's model depends on."""

    floor_friction: float
    camera_height_m: float
    camera_tilt_deg: float
    camera_fovy_deg: float
    roles: Roles

    @classmethod
    def of(cls, robot: Robot, camera: Camera) -> RobotForm:
        """That of a scenario."""
        return cls(robot.floor_friction, camera.height_m, camera.tilt_deg, camera.fovy_deg, Roles.of(robot))

    @property
    def lens_m(self) -> float:
        """From the middle of the base forward to the optical centre, in the direction of the gaze."""
        if self.roles.motorised:
            return mast_of(self.roles).lens_m * math.cos(math.radians(self.camera_tilt_deg))
        pose = fit(self.roles).T_base_camera
        ahead = pose[:2, 2] / max(math.hypot(*pose[:2, 2]), 1e-9)
        return float(ahead @ pose[:2, 3])


def fitted_settings(settings: ResolvedScenario) -> ResolvedScenario:
    """A scenario with what follows from the file of its robot: the camera's height, and the robot's radius.

    Raises:
        ScenarioError: The file cannot be used; the message says why.
    """
    roles, robot, camera = Roles.of(settings.robot), settings.robot, settings.camera
    try:
        if roles.motorised:
            mast_of(roles)
            return settings
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
    bodies = ancestors(model, int(model.cam_bodyid[model.camera(CAMERA).id]))
    return bodies[:-1] or bodies


def add_robot(spec: SceneSpec, form: RobotForm) -> None:
    """Attach the robot to the world at the origin, facing +x, resting on the ground z = 0.

    The spec gains bodies, joints, actuators, sensors and the camera, all named `"robot/..."`. It needs a colliding
    ground plane at z = 0 and gravity along -z. The drive (`agents.robot`) applies the speed limits.
    """
    roles = form.roles
    if roles.motorised:
        add_motorised(
            spec, roles, form.camera_height_m, form.camera_tilt_deg, form.camera_fovy_deg, form.floor_friction
        )
    else:
        add_fitted(spec, fit(roles), form.camera_fovy_deg)
