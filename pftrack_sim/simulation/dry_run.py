"""The dry run: where camera, target and robot will be while the robot follows its script and nothing is in its way.

The base moves by its kinematics, as fast as its motors accelerate it, and the camera looks at the target: suspension,
mast, tyres and servos are left out. Camera and target stay within 7 cm of where they are in the episode.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.target import walk_of
from pftrack_sim.agents.robot.drive import ACCELERATION
from pftrack_sim.agents.robot.script import Script
from pftrack_sim.agents.robot.steering import Steering
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scene.robot import REST_YAW_RAD, RobotForm

_TICK_S = 0.04  # The motors follow their commands by about this time later


@dataclass(frozen=True)
class DryRun:
    """Where camera, target and robot are from the start of an episode to `end_s`.

    Attributes:
        times_s: `(T,)` times of the samples; the last one is the first after the end.
        camera_m: `(T, 3)` optical centre without vibration, world frame.
        target_m: `(T, 2)` centre line of the target on the ground.
        target_s_m: `(T,)` arc length of the target on its path.
        robot_m: `(T, 2)` centre of the robot on the ground.
    """

    times_s: FloatArray
    camera_m: FloatArray
    target_m: FloatArray
    target_s_m: FloatArray
    robot_m: FloatArray
    target_height_m: float
    end_s: float

    def until(self, time_s: float) -> DryRun:
        """The part up to a time."""
        end_s = min(time_s, self.end_s)
        count = int(np.searchsorted(self.times_s, end_s, side="right")) + 1
        parts = {
            name: getattr(self, name)[:count] for name in ("times_s", "camera_m", "target_m", "target_s_m", "robot_m")
        }
        return replace(self, end_s=end_s, **parts)

    def at(self, times_s: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Camera `(N, 3)` and target `(N, 2)` at given times, linearly interpolated."""
        return self._at(times_s, self.camera_m), self._at(times_s, self.target_m)

    def robot_at(self, times_s: ArrayLike) -> FloatArray:
        """Robot `(N, 2)` at given times, linearly interpolated."""
        return self._at(times_s, self.robot_m)

    def _at(self, times_s: ArrayLike, places_m: FloatArray) -> FloatArray:
        times = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
        columns: list[FloatArray] = [np.interp(times, self.times_s, column) for column in places_m.T]
        return np.stack(columns, axis=1)


def dry_run(settings: ResolvedScenario, path: Path, script: Script, end_s: float) -> DryRun:
    """Let target and robot move to the first sample after `end_s`; the script is reset before."""
    robot, camera = settings.robot, settings.camera
    target = walk_of(path, settings.target, settings.axes.target)
    script.reset()
    x, y, heading, _ = script.start_pose()
    mount_rad = REST_YAW_RAD[camera.mount]
    lens_m = RobotForm.of(robot, camera).lens_m
    speed_step, turn_step = (ACCELERATION[:2] * _TICK_S).tolist()
    max_speed_m_s, max_turn_rad_s = robot.max_speed_m_s, math.radians(robot.max_turn_deg_s)
    commands = deque([(0.0, 0.0)] * round(1e-3 * robot.latency_ms / _TICK_S))
    speed = turn = 0.0
    steering = Steering.of(robot)
    rows: list[tuple[float, ...]] = []
    for tick in range(math.ceil(end_s / _TICK_S) + 2):
        time_s, (target_x, target_y) = tick * _TICK_S, target.tracked_m
        yaw = math.atan2(target_y - y, target_x - x) if robot.gaze == "target" else heading + mount_rad
        camera_x, camera_y = x + lens_m * math.cos(yaw), y + lens_m * math.sin(yaw)
        rows.append((time_s, camera_x, camera_y, camera.height_m, target_x, target_y, target.s_m, x, y))
        commands.append(script.drive(time_s, (x, y, heading), target.s_m))
        # The motors have the speeds of the tick before.
        middle = heading + 0.5 * _TICK_S * turn
        x, y, heading = (
            x + _TICK_S * speed * math.cos(middle),
            y + _TICK_S * speed * math.sin(middle),
            heading + _TICK_S * turn,
        )
        target.update(_TICK_S, (x, y, speed * math.cos(middle), speed * math.sin(middle)), (camera_x, camera_y))
        wanted_speed, wanted_turn = commands.popleft()
        wanted_speed = min(max(wanted_speed, -max_speed_m_s), max_speed_m_s)
        wanted_turn = min(max(wanted_turn, -max_turn_rad_s), max_turn_rad_s)
        speed += min(max(wanted_speed - speed, -speed_step), speed_step)
        if steering is None:
            turn += min(max(wanted_turn - turn, -turn_step), turn_step)
        else:
            turn = steering.turn_rad_s(speed, wanted_turn, _TICK_S)
    table = np.array(rows)
    table.setflags(write=False)
    return DryRun(table[:, 0], table[:, 1:4], table[:, 4:6], table[:, 6], table[:, 7:], settings.target.top_m, end_s)
