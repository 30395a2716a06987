"""The world of one episode: it is built once, and moves from frame to frame."""

from __future__ import annotations

from functools import partial

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.agents.clock import Clock
from pftrack_sim.agents.gait.gait import Gait
from pftrack_sim.agents.gait.mocap_writer import MocapWriter
from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.crowd import Crowd
from pftrack_sim.agents.robot.script import Script
from pftrack_sim.core import random_streams
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scenario.model import Distractors
from pftrack_sim.scene.build import build
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.lighting import Lighting
from pftrack_sim.scene.occluders.bodies import place
from pftrack_sim.scene.occluders.carts import cart_names, move_cart, size_cart
from pftrack_sim.simulation.dry_run import DryRun
from pftrack_sim.simulation.motion import Motion
from pftrack_sim.simulation.planning import Plans, plan


class World:
    """Place, robot and people of one episode, at time 0.

    Args:
        settings: The scenario, every range drawn.
        seed: Root seed of the episode.

    Raises:
        ScenarioError: An occlusion or a passing that was asked for cannot happen.
    """

    def __init__(self, settings: ResolvedScenario, seed: int) -> None:
        self.settings = settings
        self.clock = Clock.for_rate(settings.camera.rate_hz)
        scene = build(settings, seed, self.clock.step_s)
        self.model = scene.model
        self.data = mujoco.MjData(scene.model)
        self.people = tuple(person.name for person in scene.cast)
        path = Path(settings.target.path_m)
        self._robot_start_m = Script(settings.robot, path, settings.target.speed_m_s).start_pose()[:2]
        plans = plan(settings, seed, scene.layout, path, partial(self._rehearse, scene.stage, scene.layout, path, seed))
        crowd = self._crowd(path, plans, settings.distractors, seed)
        self._motion = Motion(self.model, self.data, settings, self.clock, path, crowd, seed)
        self._gait = Gait(
            [person.anatomy for person in scene.cast],
            [random_streams.stream(seed, "gait", name) for name in self.people],
        )
        self._puppets = MocapWriter(self.model, self.people)
        rng = random_streams.stream(seed, "lights", "axis")
        self._lighting = Lighting(self.model, settings.lights, settings.axes.light, rng)
        self._cart_names = cart_names(settings.axes.occlusion)
        self._start(plans)

    def advance(self, command: NDArray[np.float64] | None = None, late_s: float = 0.0) -> None:
        """Move on to the next frame.

        Args:
            command: `(4,)` forward speed, turn rate, pan rate, tilt rate in [-1, 1] of the robot's limits; None lets
                the robot follow its script.
            late_s: How long after this frame the command is given; until then the one before stays in force.
        """
        crowd = self._motion.crowd
        tick_s = self.clock.tick_s
        for tick in range(self.clock.ticks):
            self._motion.tick(command, min(max(late_s - tick * tick_s, 0.0), tick_s))
            self._gait.advance(self.clock.tick_s, crowd.positions_m, crowd.headings_rad, crowd.crouching, crowd.running)
        self._puppets.write(self.data, *self._gait.poses())
        self._move_carts()
        self._settle()

    @property
    def time_s(self) -> float:
        """Simulated time since the start of the episode."""
        return self._motion.time_s

    def camera_pose(self) -> NDArray[np.float64]:
        """`(4, 4)` T_world_camera of the camera on its mast, before any vibration of the mount."""
        return self._motion.drive.camera_pose(self.data)

    def root_poses(self) -> NDArray[np.float64]:
        """`(P, 4, 4)` poses of the people: origin on the ground below the pelvis, x forward, z up."""
        return self._gait.root_poses()

    def proprio(self) -> NDArray[np.float32]:
        """`(n,)` what the robot feels of itself, see `pftrack_sim.core.proprioception`."""
        return self._motion.drive.proprio(self.data)

    def collision(self) -> str | None:
        """Name of a person or thing that the robot touches, or None."""
        return self._motion.drive.collision(self.data)

    def robot_pose(self) -> tuple[float, float, float]:
        """x, y [m] and heading [rad] of the robot."""
        return self._motion.drive.pose(self.data)

    def light(self, exposure_ev: float = 0.0) -> None:
        """Set the lights to what they are now.

        Args:
            exposure_ev: Stops by which the camera exposes longer than it does at first.
        """
        self._lighting.apply(self.time_s, self._motion.crowd.target_s_m, exposure_ev)

    def _start(self, plans: Plans) -> None:
        for index, placement in plans.placements.items():
            place(self.model, self.data, index, placement)
        for name, crossing, height in zip(self._cart_names, plans.carts, plans.cart_heights_m, strict=True):
            size_cart(self.model, name, crossing.half_width_m, height)
        self._motion.reset()
        crowd = self._motion.crowd
        self._gait.reset(crowd.positions_m, crowd.headings_rad, crowd.speeds_m_s)
        self._puppets.write(self.data, *self._gait.poses())
        self._move_carts()
        self._settle()

    def _settle(self) -> None:
        """Bring poses up to date with the state: what is drawn and what is true come from the same instant."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)

    def _crowd(self, path: Path, plans: Plans, distractors: Distractors, seed: int) -> Crowd:
        return Crowd(
            plans.layout,
            self.settings.target,
            path,
            distractors,
            plans.crossings,
            seed,
            robot_start_m=self._robot_start_m,
            oncoming=plans.passings,
            carts=plans.carts,
            target_axis=self.settings.axes.target,
        )

    def _rehearse(self, spec: mujoco.MjSpec, layout: WalkableArea, path: Path, seed: int, until_s: float) -> DryRun:
        """The target and the robot alone."""
        nobody = self.settings.distractors.model_copy(update={"count": 0})
        alone = self._crowd(path, Plans(layout, {}), nobody, seed)
        stage = spec.compile()
        motion = Motion(stage, mujoco.MjData(stage), self.settings, self.clock, path, alone, seed)
        return motion.rehearse(until_s, self.settings.target.height_m)

    def _move_carts(self) -> None:
        for name, cart in zip(self._cart_names, self._motion.crowd.carts, strict=True):
            move_cart(self.model, self.data, name, cart.position_m, cart.yaw_rad)
