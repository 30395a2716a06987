"""One control tick of the robot's physics, shared by the dry run and the world."""

from __future__ import annotations

import mujoco

from pftrack_sim.agents.entity import SceneState
from pftrack_sim.agents.pedestrians.crowd import Crowd
from pftrack_sim.agents.robot.robot import Robot


def scene_state(data: mujoco.MjData, time_s: float, robot: Robot, crowd: Crowd) -> SceneState:
    """What the entities observe now. Brings the poses in `data` up to date with its state."""
    return SceneState(
        time_s, robot.drive.pose(data), robot.drive.camera_pose(data), crowd.positions_m[0], crowd.target_s_m
    )


def step_physics(model: mujoco.MjModel, data: mujoco.MjData, robot: Robot, steps: int) -> None:
    """Integrate some physics steps, with the robot's actuation of each."""
    for _ in range(steps):
        robot.write(data)
        mujoco.mj_step(model, data)
