"""The robot alone on flat ground."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import pytest

from pftrack_sim.agents.robot.drive import Drive, Equilibrium, camera_pose
from pftrack_sim.scenario.camera import Camera
from pftrack_sim.scenario.robot import Robot, StillRoute
from pftrack_sim.scene.robot import RobotForm, add_robot
from pftrack_sim.scene.scene_spec import SceneSpec

TICK_S = 1.0 / 60.0


@dataclass
class Lab:
    robot: Robot
    camera: Camera
    model: mujoco.MjModel
    data: mujoco.MjData
    drive: Drive
    steps: int

    def tick(self, forward: float = 0.0, turn: float = 0.0, pan: float = 0.0, tilt: float = 0.0) -> None:
        self.drive.command(self.data, forward, turn, pan, tilt, TICK_S)
        mujoco.mj_step(self.model, self.data, self.steps)

    def run(self, seconds: float, **speeds: float) -> np.ndarray:
        """`(T, 8)` x, y, heading, camera x, y, z, pitch up, roll to the right, after each tick."""
        rows = []
        for _ in range(round(seconds / TICK_S)):
            self.tick(**speeds)
            T = camera_pose(self.model, self.data)
            rows.append((*self.drive.pose(self.data), *T[:3, 3], np.arcsin(T[2, 2]), np.arctan2(-T[2, 0], -T[2, 1])))
        return np.array(rows)


@pytest.fixture
def lab() -> Callable[..., Lab]:
    def build(
        furnish: Callable[[SceneSpec], None] | None = None,
        steps: int = 9,
        robot: Robot | None = None,
        degree: bool = True,
        **camera: Any,
    ) -> Lab:
        spec = SceneSpec()
        spec.compiler.degree = degree
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.timestep = TICK_S / steps
        ground = spec.worldbody.add_body(name="ground")
        plane = ground.add_geom(name="ground/plane", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[50, 50, 0.1])
        plane.contype, plane.conaffinity = 1, 2
        if furnish is not None:
            furnish(spec)
        robot = robot or Robot(route=StillRoute(kind="still"))
        eye = Camera(**camera)
        add_robot(spec, RobotForm.of(robot, eye))
        model = spec.compile()
        data = mujoco.MjData(model)
        rest = Equilibrium(model)
        drive = Drive(model, robot, eye, rest.wheels, rest)
        drive.reset(data, 0.0, 0.0, 0.0)
        return Lab(robot, eye, model, data, drive, steps)

    return build
