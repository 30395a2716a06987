"""The dry run: an episode of robot and target alone, to know where camera and target will be."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.clock import Clock
from pftrack_sim.agents.pedestrians.crowd import Crowd
from pftrack_sim.agents.robot.robot import Robot
from pftrack_sim.core.types import FloatArray


@dataclass(frozen=True)
class DryRun:
    """Where camera, target and robot are over one episode.

    Attributes:
        times_s: `(T,)` rising.
        camera_m: `(T, 3)` optical centre without vibration, world frame.
        target_m: `(T, 2)` centre line of the target on the ground.
        robot_m: `(T, 2)` centre of the robot on the ground.
    """

    times_s: FloatArray
    camera_m: FloatArray
    target_m: FloatArray
    robot_m: FloatArray
    target_height_m: float

    def until(self, time_s: float) -> DryRun:
        """The part up to the first sample after a time."""
        count = max(2, int(np.searchsorted(self.times_s, time_s, side="right")) + 1)
        times, camera, target, robot = self.times_s, self.camera_m, self.target_m, self.robot_m
        return DryRun(times[:count], camera[:count], target[:count], robot[:count], self.target_height_m)

    def at(self, times_s: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Camera `(N, 3)` and target `(N, 2)` at given times, linearly interpolated."""
        return self._interpolated(times_s, self.camera_m), self._interpolated(times_s, self.target_m)

    def robot_at(self, times_s: ArrayLike) -> FloatArray:
        """Robot `(N, 2)` at given times, linearly interpolated."""
        return self._interpolated(times_s, self.robot_m)

    def _interpolated(self, times_s: ArrayLike, track: FloatArray) -> FloatArray:
        times = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
        columns: list[FloatArray] = [np.interp(times, self.times_s, column) for column in track.T]
        return np.stack(columns, axis=1)


def dry_run(
    model: mujoco.MjModel, clock: Clock, robot: Robot, crowd: Crowd, until_s: float, target_height_m: float
) -> DryRun:
    """Let the robot follow its script up to a time, and record camera, target and robot at every control tick."""
    data = mujoco.MjData(model)
    crowd.reset()
    robot.reset(data)
    states, target_m = [robot.scene_state(data, 0.0)], [crowd.target_m]
    while states[-1].time_s <= until_s:
        robot.update(clock.tick_s, states[-1], crowd)
        robot.step(data)
        states.append(robot.scene_state(data, clock.time_s(len(states))))
        crowd.tick(clock.tick_s, states[-1].time_s, *states[-1].places_m)
        target_m.append(crowd.target_m)
    return DryRun(
        np.array([state.time_s for state in states]),
        np.array([state.T_world_camera[:3, 3] for state in states]),
        np.array(target_m),
        np.array([state.robot_pose[:2] for state in states]),
        target_height_m,
    )
