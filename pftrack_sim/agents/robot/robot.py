"""The robot: script, command delay, drive, odometry and road excitation; and the state of the scene it reacts to."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple, TypeAlias

import mujoco
from numpy.typing import ArrayLike

from pftrack_sim.agents.clock import Clock
from pftrack_sim.agents.pedestrians.crowd import Crowd
from pftrack_sim.agents.pedestrians.obstacle_map import Xy
from pftrack_sim.agents.robot.alone import RobotAlone
from pftrack_sim.agents.robot.drive import Drive, Equilibrium
from pftrack_sim.agents.robot.road import RoadExcitation
from pftrack_sim.agents.robot.script import Script
from pftrack_sim.agents.robot.sensors import OdometryCalibration
from pftrack_sim.core.random_streams import stream
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario import ResolvedScenario

Speeds: TypeAlias = tuple[float, float, float, float]  # Forward speed [m/s], turn, pan and tilt rate [rad/s]
_AT_REST: Speeds = (0.0, 0.0, 0.0, 0.0)


class SceneState(NamedTuple):
    """What the entities observe of the robot at one instant.

    Attributes:
        robot_pose: x, y [m] and heading [rad].
        T_world_camera: `(4, 4)` camera on its mast, without vibration of the mount.
    """

    time_s: float
    robot_pose: tuple[float, float, float]
    T_world_camera: FloatArray

    @property
    def places_m(self) -> tuple[Xy, Xy]:
        """x, y of the robot and of the camera."""
        camera_x, camera_y = self.T_world_camera[:2, 3].tolist()
        return self.robot_pose[:2], (camera_x, camera_y)


class Robot:
    """Follows its script or external commands.

    Args:
        equilibrium: That of the same robot, perhaps in another model.
        alone: A model of the same robot alone, in which it is stepped while it is far from everything; or None.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        settings: ResolvedScenario,
        clock: Clock,
        script: Script,
        seed: int,
        equilibrium: Equilibrium,
        alone: mujoco.MjModel | None = None,
    ) -> None:
        self._model = model
        speed_m_s = settings.robot.max_speed_m_s
        self._alone = RobotAlone(model, alone, clock, speed_m_s) if alone is not None else None
        self._stepped_alone = False
        self._clock = clock
        calibration = OdometryCalibration.sampled(settings.robot.odometry_error_percent, stream(seed, "odometry"))
        self.drive = Drive(model, settings.robot, settings.camera, calibration, equilibrium)
        self._delay = CommandDelay(clock, settings.robot.latency_ms)
        self.script = script
        self.set_road(settings, seed)
        self._segments: list[tuple[int, Speeds]] = []

    def set_road(self, settings: ResolvedScenario, seed: int) -> None:
        """Drive on the road of these settings from now on."""
        jitter, sills = settings.axes.jitter, settings.robot.sills
        rough = jitter.roughness > 0.0 or sills.height_mm > 0.0
        self._road = RoadExcitation(self._model, jitter, sills, seed) if rough else None

    def reset(self, data: mujoco.MjData) -> None:
        """Stand at the start of the route."""
        self.script.reset()
        self._delay.reset()
        self.drive.reset(data, *self.script.start_pose())

    def scene_state(self, data: mujoco.MjData, time_s: float, *, posed_next: bool = False) -> SceneState:
        """What is observed now.

        Updates the poses of bodies, geoms and cameras in `data`; they may be left out if the caller does so next.
        """
        alone = self._alone
        if posed_next and alone is not None and self._stepped_alone:
            return SceneState(time_s, self.drive.pose(data), alone.camera_pose())
        return SceneState(time_s, self.drive.pose(data), self.drive.camera_pose(data))

    def update(
        self, dt_s: float, state: SceneState, crowd: Crowd, command: ArrayLike | None = None, delay_s: float = 0.0
    ) -> None:
        """Choose the speeds of the coming tick.

        The `(4,)` command holds forward, turn, pan, tilt as shares of the robot's limits in [-1, 1]; None follows the
        script. It is given `delay_s` into the tick; until then the previous one stays in force.
        """
        if command is None:
            forward, turn = self.script.drive(state.time_s, state.robot_pose, crowd.target_s_m)
            pan, tilt = self.script.gaze(state.T_world_camera, crowd.target_m, dt_s, state.time_s)
            speeds = (forward, turn, pan, tilt)
        else:
            speeds = self.drive.scaled(command)
        self._segments = self._delay.segments(speeds, delay_s)

    def step(self, data: mujoco.MjData) -> None:
        """Integrate the physics of one tick. Poses of geoms in `data` must be at most a tick old."""
        alone = self._alone
        self._stepped_alone = alone is not None and not alone.may_touch(data)
        if alone is None or not self._stepped_alone:
            self._step(self._model, data)
            return
        alone.load(data)
        self._step(alone.model, alone.data)
        alone.store(data)

    def _step(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        for steps, speeds in self._segments:
            self.drive.command(data, *speeds, self._clock.tick_s * (steps / self._clock.steps))
            if self._road is None:
                mujoco.mj_step(model, data, steps)
                continue
            for _ in range(steps):
                self._road.write(data)
                mujoco.mj_step(model, data)

    def collision(self, data: mujoco.MjData) -> str | None:
        """Name of what the robot touched in the last physics step, see `Drive.collision`."""
        return None if self._stepped_alone else self.drive.collision(data)


class CommandDelay:
    """Delays commands by a constant latency, rounded to physics steps."""

    def __init__(self, clock: Clock, latency_ms: float) -> None:
        self._clock = clock
        self._latency_steps = round(1e-3 * latency_ms / clock.step_s)
        self.reset()

    def reset(self) -> None:
        """Command zero speeds until the first command arrives."""
        self._last = _AT_REST
        self._queue: deque[tuple[int, Speeds]] = deque()
        self._append(self._latency_steps, _AT_REST)

    def segments(self, speeds: Speeds, delay_s: float = 0.0) -> list[tuple[int, Speeds]]:
        """Take the command of a tick, and return what reaches the motors during the tick.

        The command is given `delay_s` into the tick; until then the previous one stays in force.

        Returns:
            Numbers of physics steps, which sum to those of a tick, each with the command in force.
        """
        delay = min(round(delay_s / self._clock.step_s), self._clock.steps)
        self._append(delay, self._last)
        self._append(self._clock.steps - delay, speeds)
        if delay < self._clock.steps:
            self._last = speeds
        segments: list[tuple[int, Speeds]] = []
        missing = self._clock.steps
        while missing > 0:
            steps, first = self._queue.popleft()
            if steps > missing:
                self._queue.appendleft((steps - missing, first))
            segments.append((min(steps, missing), first))
            missing -= segments[-1][0]
        return segments

    def _append(self, steps: int, speeds: Speeds) -> None:
        if steps > 0:
            self._queue.append((steps, speeds))
