"""The robot and everyone's feet, without bodies, light or pictures: enough to rehearse an episode."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.agents.clock import Clock
from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.crowd import Crowd
from pftrack_sim.agents.robot.command_delay import Delay
from pftrack_sim.agents.robot.drive import Drive
from pftrack_sim.agents.robot.odometry import Calibration
from pftrack_sim.agents.robot.road import Road
from pftrack_sim.agents.robot.script import Script
from pftrack_sim.core.random_streams import stream
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.simulation.dry_run import DryRun


class Motion:
    """Moves the robot and the crowd, one control tick at a time.

    Args:
        model: The compiled scene.
        data: Its state.
        settings: The scenario, every range drawn.
        clock: How often things happen.
        path: The target's.
        crowd: Who walks.
        seed: Root seed of the episode, for the road and the odometry.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        settings: ResolvedScenario,
        clock: Clock,
        path: Path,
        crowd: Crowd,
        seed: int,
    ) -> None:
        self._model = model
        self._data = data
        self._clock = clock
        self.crowd = crowd
        calibration = Calibration.drawn(settings.robot.odometry_error_percent, stream(seed, "odometry"))
        self.drive = Drive(model, settings.robot, settings.camera, calibration)
        self._delay = Delay(clock, settings.robot.latency_ms)
        self.script = Script(settings.robot, path, settings.target.speed_m_s, settings.axes.target, settings.camera)
        jitter = settings.axes.jitter
        self._road = Road(model, jitter, seed) if jitter.roughness > 0.0 else None
        self.ticks = 0

    def reset(self) -> None:
        """Back to the start of the episode; `data` is fresh."""
        self.ticks = 0
        self.crowd.reset()
        self.script.reset()
        self._delay.reset()
        self.drive.reset(self._data, *self.script.start_pose())

    @property
    def time_s(self) -> float:
        """Simulated time since the start."""
        return self._clock.time_s(self.ticks)

    def tick(self, command: NDArray[np.float64] | None, late_s: float = 0.0) -> None:
        """Move on by one control tick.

        Args:
            command: `(4,)` shares of the robot's limits in [-1, 1]; None follows the script.
            late_s: How far into the tick the command is given; until then the one before stays in force.
        """
        data, drive, crowd = self._data, self.drive, self.crowd
        tick_s = self._clock.tick_s
        if command is None:
            target_m = crowd.positions_m[0]
            forward, turn = self.script.command(self.time_s, drive.pose(data), crowd.target_s_m, target_m)
            pan, tilt = self.script.gaze(drive.camera_pose(data), target_m, tick_s, self.time_s)
        else:
            forward, turn, pan, tilt = drive.scaled(command)
        for steps, speeds in self._delay.pass_on((forward, turn, pan, tilt), late_s):
            drive.command(data, *speeds, tick_s * (steps / self._clock.steps))
            self._step(steps)
        self.ticks += 1
        # Walkers who cross keep to the line of sight as it is at the end of the tick.
        crowd.tick(tick_s, self.time_s, np.array(drive.pose(data)[:2]), drive.camera_pose(data)[:2, 3])

    def _step(self, steps: int) -> None:
        if self._road is None:
            mujoco.mj_step(self._model, self._data, steps)
            return
        for _ in range(steps):
            self._road.push(self._data)
            mujoco.mj_step(self._model, self._data)

    def rehearse(self, until_s: float, target_height_m: float) -> DryRun:
        """Follow the script and write down where camera, target and robot were; `data` is spent afterwards."""
        self.reset()
        times: list[float] = []
        cameras: list[NDArray[np.float64]] = []
        targets: list[NDArray[np.float64]] = []
        robots: list[tuple[float, float]] = []
        while True:
            times.append(self.time_s)
            cameras.append(self.drive.camera_pose(self._data)[:3, 3])
            targets.append(self.crowd.positions_m[0])
            robots.append(self.drive.pose(self._data)[:2])
            if self.time_s > until_s:
                return DryRun.of(times, cameras, targets, robots, target_height_m)
            self.tick(None)
