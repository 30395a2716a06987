"""The robot: script, command delay, drive and road; and the state of the scene it reacts to.

In every physics step MuJoCo computes the poses of all bodies and looks for contacts among all geoms. As long as the
robot can touch nothing but the ground, it is stepped in a model of its own: the same bits in a third of the time.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple, TypeAlias

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.clock import Clock
from pftrack_sim.agents.pedestrians.crowd import Crowd
from pftrack_sim.agents.pedestrians.obstacle_map import Xy
from pftrack_sim.agents.robot.drive import Drive, Equilibrium, camera_pose
from pftrack_sim.agents.robot.road import RoadExcitation
from pftrack_sim.agents.robot.script import Script
from pftrack_sim.core.random_streams import stream
from pftrack_sim.core.types import FloatArray, IntArray
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scene.robot import BASE

Speeds: TypeAlias = tuple[float, float, float, float]  # Forward speed [m/s], turn, pan and tilt rate [rad/s]
_AT_REST: Speeds = (0.0, 0.0, 0.0, 0.0)

_LIMB_M_S = 8.0  # Faster than any limb or cart moves
_LEAN_M = 0.15  # Farther from its axle the robot never reaches by leaning and turning its head
_CONTACT_M = 0.02  # Margin of contacts, and rounding
_MOST_TICKS = 100
_STATE = int(
    mujoco.mjtState.mjSTATE_TIME
    | mujoco.mjtState.mjSTATE_PHYSICS
    | mujoco.mjtState.mjSTATE_WARMSTART
    | mujoco.mjtState.mjSTATE_CTRL
    | mujoco.mjtState.mjSTATE_QFRC_APPLIED
)


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
        alone: A model of the same robot on the same ground, see `compile_robot_alone`.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        settings: ResolvedScenario,
        clock: Clock,
        script: Script,
        seed: int,
        equilibrium: Equilibrium,
        alone: mujoco.MjModel,
    ) -> None:
        self._model = model
        self._alone = _RobotAlone(model, alone)
        self._vicinity = _Vicinity(model, clock, settings.robot.max_speed_m_s)
        self._stepped_alone = False
        self._clock = clock
        calibration = equilibrium.wheels.sampled(settings.robot.odometry_error_percent, stream(seed, "odometry"))
        self.drive = Drive(model, settings.robot, settings.camera, calibration, equilibrium)
        self._delay = CommandDelay(clock, settings.robot.latency_ms)
        self.script = script
        self.set_road(settings, seed)
        self._segments: list[tuple[int, Speeds]] = []

    def set_road(self, settings: ResolvedScenario, seed: int) -> None:
        """Drive on the road of these settings from now on."""
        jitter, sills = settings.axes.jitter, settings.robot.sills
        rough = (jitter.roughness > 0.0 or sills.height_mm > 0.0) and not self.drive.planar
        self._road = RoadExcitation(self._model, jitter, sills, seed) if rough else None

    def reset(self, data: mujoco.MjData) -> None:
        """Stand at the start of the route."""
        self.script.reset()
        self.drive.reset(data, *self.script.start_pose())

    def scene_state(self, data: mujoco.MjData, time_s: float, *, posed_next: bool = False) -> SceneState:
        """What is observed now.

        Updates the poses of bodies, geoms and cameras in `data`; they may be left out if the caller does so next.
        """
        model, posed = self._model, data
        if posed_next and self._stepped_alone:
            model, posed = self._alone.model, self._alone.data
        return SceneState(time_s, self.drive.pose(data), camera_pose(model, posed))

    def update(
        self, dt_s: float, state: SceneState, crowd: Crowd, command: ArrayLike | None = None, delay_s: float = 0.0
    ) -> None:
        """Choose the speeds of the coming tick.

        The `(4,)` command holds forward, turn, pan, tilt as shares of the robot's limits in [-1, 1]; None follows the
        script. It is given `delay_s` into the tick; until then the previous one stays in force.
        """
        if command is None:
            forward, turn = self.script.drive(state.time_s, state.robot_pose, crowd.target_s_m)
            pan, tilt = self.script.gaze(state.T_world_camera, crowd.tracked_m, dt_s, state.time_s)
            if self.drive.turns_with_head and self.script.drives:
                pan = 0.0  # The base turns along its route.
            speeds = (forward, turn, pan, tilt)
        else:
            speeds = self.drive.scaled(command)
        self._segments = self._delay.segments(speeds, delay_s)

    def step(self, data: mujoco.MjData) -> None:
        """Integrate the physics of one tick. Poses of geoms in `data` must be at most a tick old."""
        self._stepped_alone = not self._vicinity.may_touch(data)
        if not self._stepped_alone:
            self._step(self._model, data)
            return
        alone = self._alone
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
    """Delays commands by a constant latency, rounded to physics steps; until the first one arrives, speeds are zero."""

    def __init__(self, clock: Clock, latency_ms: float) -> None:
        self._clock, self._last = clock, _AT_REST
        self._queue = deque([(round(1e-3 * latency_ms / clock.step_s), _AT_REST)])

    def segments(self, speeds: Speeds, delay_s: float = 0.0) -> list[tuple[int, Speeds]]:
        """Take the command of a tick, and return what reaches the motors during the tick.

        The command is given `delay_s` into the tick; until then the previous one stays in force.

        Returns:
            Numbers of physics steps, which sum to those of a tick, each with the command in force.
        """
        missing = self._clock.steps
        delay = min(round(delay_s / self._clock.step_s), missing)
        self._queue += [(delay, self._last), (missing - delay, speeds)]
        if delay < missing:
            self._last = speeds
        segments: list[tuple[int, Speeds]] = []
        while missing > 0:
            steps, first = self._queue.popleft()
            if steps > missing:
                self._queue.appendleft((steps - missing, first))
            segments.append((min(steps, missing), first))
            missing -= segments[-1][0]
        return [segment for segment in segments if segment[0] > 0]


class _RobotAlone:
    """The robot of a scene in a model of its own; its state is there from `load` to `store`."""

    def __init__(self, scene: mujoco.MjModel, model: mujoco.MjModel) -> None:
        self.model, self.data, self._scene = model, mujoco.MjData(model), scene
        self._state = np.empty(mujoco.mj_stateSize(model, _STATE))

    def load(self, data: mujoco.MjData) -> None:
        """Take time, positions, velocities and commands from the scene."""
        mujoco.mj_getState(self._scene, data, self._state, _STATE)
        mujoco.mj_setState(self.model, self.data, self._state, _STATE)

    def store(self, data: mujoco.MjData) -> None:
        """Write these, and the sensors, into the scene."""
        mujoco.mj_getState(self.model, self.data, self._state, _STATE)
        mujoco.mj_setState(self._scene, data, self._state, _STATE)
        data.sensordata[:] = self.data.sensordata


class _Vicinity:
    """What the robot could touch: everything else as upright boxes around its geoms, the robot as an upright cylinder.

    The robot's joints are the only ones of the scene, and it drives at `speed_m_s` at most.
    """

    def __init__(self, model: mujoco.MjModel, clock: Clock, speed_m_s: float) -> None:
        self._base = int(model.body(BASE).id)
        own = model.body_rootid[model.geom_bodyid] == self._base
        solid = (model.geom_contype | model.geom_conaffinity) != 0
        types = np.bitwise_or.reduce(model.geom_contype[own]), np.bitwise_or.reduce(model.geom_conaffinity[own])
        meets = ((model.geom_contype & types[1]) | (model.geom_conaffinity & types[0])) != 0
        planes = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
        self._others = np.flatnonzero(meets & ~own & ~planes)
        self._boxes = np.array(model.geom_aabb, dtype=np.float64).reshape(-1, 2, 3)
        rest = mujoco.MjData(model)
        mujoco.mj_kinematics(model, rest)
        middle, half = self._extents(rest, np.flatnonzero(own & solid))
        radius_m = np.hypot(*(np.abs(middle - rest.xpos[self._base, :2]) + half).T).max() + _LEAN_M
        # People stand still within a tick, but in the second one of a frame, the poses are those of the first.
        limb_m_s = _LIMB_M_S if clock.ticks > 1 else 0.0
        self._near_m = radius_m + _CONTACT_M + clock.tick_s * (2.0 * speed_m_s + limb_m_s)
        moving = model.body_mocapid[model.geom_bodyid[self._others]] >= 0
        self._closing_m = clock.tick_s * (2.0 * speed_m_s + _LIMB_M_S * moving)
        self._free_ticks = 0

    def may_touch(self, data: mujoco.MjData) -> bool:
        """Whether the robot may touch anything but the ground within a tick, by the poses of the scene's geoms.

        To be asked once a tick: what is far away is left out for as many ticks as it needs to come near.
        """
        if self._free_ticks > 0:
            self._free_ticks -= 1
            return False
        middle, half = self._extents(data, self._others)
        beyond = np.maximum(np.abs(middle - data.xpos[self._base, :2]) - half, 0.0)
        free_m = np.hypot(*beyond.T) - self._near_m
        self._free_ticks = int((free_m / self._closing_m).min(initial=_MOST_TICKS))
        return bool((free_m < 0.0).any())

    def _extents(self, data: mujoco.MjData, geoms: IntArray) -> tuple[FloatArray, FloatArray]:
        """`(N, 2)` middles and half sizes of the upright boxes around geoms, on the ground [m]."""
        rotation, boxes = data.geom_xmat[geoms].reshape(-1, 3, 3)[:, :2], self._boxes[geoms]
        middle = data.geom_xpos[geoms, :2] + (rotation @ boxes[:, 0, :, None])[..., 0]
        return middle, (np.abs(rotation) @ boxes[:, 1, :, None])[..., 0]
