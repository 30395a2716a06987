"""The world of one episode: build, dry run, plan, compile, reset; then advance from frame to frame."""

from __future__ import annotations

import math
from functools import lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.agents.carried_items import CarriedItems
from pftrack_sim.agents.clock import Clock
from pftrack_sim.agents.pedestrians.crowd import Crowd
from pftrack_sim.agents.pedestrians.target import places_alone
from pftrack_sim.agents.robot.drive import Equilibrium
from pftrack_sim.agents.robot.motion import base_motion
from pftrack_sim.agents.robot.robot import Robot
from pftrack_sim.agents.robot.sensors import SensorErrors
from pftrack_sim.agents.tracked_thing import TrackedThing
from pftrack_sim.agents.traffic import Traffic
from pftrack_sim.core import random_streams
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.core.types import FloatArray, IntArray
from pftrack_sim.render.renderer import geoms_drawn
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scenario.people import Item, grips_s
from pftrack_sim.scene.build import add_agents, build_stage, compile_robot_alone
from pftrack_sim.scene.lighting import Lighting
from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.robot import RobotForm, mount
from pftrack_sim.scene.thing import BEARER
from pftrack_sim.simulation.feasibility import planned_seats, seat_problems
from pftrack_sim.simulation.planning import Plan, make_plan, make_script
from pftrack_sim.simulation.target_path import target_path


class World:
    """Place, robot, people and carts of one episode, at time 0.

    Args:
        draws: Whether it is drawn in colour; if not, its textures are blank.

    Attributes:
        path: The target's.

    Raises:
        ScenarioError: A requested occlusion, oncoming pedestrian or swing of the robot is impossible, the robot's or
            the target's way meets an obstacle, or the target is never in view.
    """

    def __init__(self, settings: ResolvedScenario, seed: int, *, draws: bool = True) -> None:
        self.settings = settings
        self._motion = base_motion(settings)
        self.clock = Clock.for_rate(settings.camera.rate_hz)
        self._seed = seed
        self.path = target_path(settings, seed)
        seats = planned_seats(settings, self.path)
        spec, layout = build_stage(settings, seed, self.clock.step_s, seats, draws=draws)
        if problems := seat_problems(seats, layout):
            raise ScenarioError(f"{settings.title!r} at seed {seed}", problems)
        script = make_script(settings, seed, layout, self.path)
        plan = make_plan(settings, seed, layout, self.path, seats, script)
        people = add_agents(spec, settings, seed, plan.static_occluders, plan.cart_sizes)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        form, step_s = RobotForm.of(settings.robot, settings.camera), self.clock.step_s
        alone, equilibrium = compile_robot_alone(form, step_s), _equilibrium(form, step_s)
        self.robot = Robot(self.model, settings, self.clock, script, seed, equilibrium, alone)
        crowd = self._crowd(plan)
        carried = self._carried(people[0].anatomy) if settings.target.carries else None
        thing, bearer = settings.target.thing, people[0].anatomy
        tracked = TrackedThing(self.model, crowd.names[0], thing, bearer, self.path) if thing is not None else None
        self.traffic = Traffic(self.model, people, tuple(plan.cart_sizes), crowd, seed, carried, tracked)
        self.people = self.traffic.names
        rng = random_streams.stream(seed, "lights", "axis")
        self._lighting = Lighting(self.model, settings.lights, settings.axes.light, rng)
        drawn, bodies = geoms_drawn(self.model), mount(self.model)
        self._mount_geoms = np.flatnonzero(drawn & np.isin(self.model.geom_bodyid, bodies))
        others = (self.model.body_rootid == self.model.body_rootid[bodies[0]])[self.model.geom_bodyid]
        self._base_geoms = np.setdiff1d(np.flatnonzero(drawn & others), self._mount_geoms)
        self._sensors = SensorErrors(settings.robot, seed, self.clock.tick_s)
        self._ticks = 0
        self._collision: str | None = None
        self.robot.reset(self.data)
        self.traffic.start(self.data)
        self._state = self.robot.scene_state(self.data, 0.0)
        if settings.target.start_stride == "median" and thing is None:
            self.traffic.start_in_mid_stride(self.data, self._state.T_world_camera)
        self._update_poses()
        self._sense()

    def advance(self, command: FloatArray | None = None, delay_s: float = 0.0) -> None:
        """Move on to the next frame.

        `command` is `(4,)` forward speed, turn rate, pan rate, tilt rate in [-1, 1] of the robot's limits; None lets
        the robot follow its script. It is given `delay_s` after this frame; until then the previous one stays in force.
        """
        self._collision = None
        tick_s, crowd = self.clock.tick_s, self.traffic.crowd
        for tick in range(self.clock.ticks):
            delay_in_tick_s = min(max(delay_s - tick * tick_s, 0.0), tick_s)
            self.robot.update(tick_s, self._state, crowd, command, delay_in_tick_s)
            self.robot.step(self.data)
            self._collision = self._collision or self.robot.collision(self.data)
            self._ticks += 1
            last = tick == self.clock.ticks - 1
            self._state = self.robot.scene_state(self.data, self.clock.time_s(self._ticks), posed_next=last)
            self.traffic.update(tick_s, self._state.time_s, *self._state.places_m)
            self.traffic.write(self.data)
            if not last:
                self._sense()
        self._update_poses()
        self._sense()

    def retune(self, settings: ResolvedScenario) -> None:
        """Go on under settings that differ in stress axes of the camera and the link only: here, the road's."""
        self.settings = settings
        self.robot.set_road(settings, self._seed)
        self._update_poses()

    @property
    def time_s(self) -> float:
        """Simulated time since the start of the episode."""
        return self._state.time_s

    def camera_pose(self) -> FloatArray:
        """`(4, 4)` T_world_camera of the camera on its mast, before any vibration of the mount."""
        rest = self._state.T_world_camera
        return rest.copy() if self._motion is None else self._motion.world_motion(self.robot_pose(), self.time_s) @ rest

    def displace_mount(self, T_world_camera: FloatArray) -> None:
        """Displace mast and head with the camera, which would otherwise see them, until it moves again.

        `T_world_camera` is the `(4, 4)` camera pose with the vibration of its mount.
        """
        self._displace(self._mount_geoms, T_world_camera)
        if self._motion is not None:
            self._displace(self._base_geoms, self.camera_pose())

    def _displace(self, geoms: IntArray, T_world_camera: FloatArray) -> None:
        """Displace geoms as the camera from where it is on its mast at rest."""
        data, rest = self.data, self._state.T_world_camera
        rotation = T_world_camera[:3, :3] @ rest[:3, :3].T
        data.geom_xpos[geoms] = (data.geom_xpos[geoms] - rest[:3, 3]) @ rotation.T + T_world_camera[:3, 3]
        data.geom_xmat[geoms] = (rotation @ data.geom_xmat[geoms].reshape(-1, 3, 3)).reshape(-1, 9)

    def root_poses(self) -> FloatArray:
        """`(P, 4, 4)` poses of target and people: origin on the ground below the pelvis or middle, x forward, z up."""
        return self.traffic.root_poses

    def proprio(self) -> NDArray[np.float32]:
        """`(n,)` float32 proprioception of the robot within its bounds, see `pftrack_sim.core.proprioception`."""
        return self._sensors.read(self._felt(), self._ticks)

    def collision(self) -> str | None:
        """Name of the first person or thing that the robot touched since the previous frame, or None."""
        return self._collision

    def bystander_m(self, target: str) -> float:
        """Distance on the ground from the robot to the nearest person but the target [m]; inf where there is none."""
        ours = {target, BEARER} if target == self.people[0] else {target}
        others = self.root_poses()[[name not in ours for name in self.people], :2, 3]
        return float(np.hypot(*(others - self.robot_pose()[:2]).T).min(initial=math.inf))

    def robot_pose(self) -> tuple[float, float, float]:
        """x, y [m] and heading [rad] of the robot."""
        return self.robot.drive.pose(self.data)

    def light(self, exposure_ev: float = 0.0) -> None:
        """Set the lights to the present time; the camera exposes `exposure_ev` stops longer than in the first frame."""
        self._lighting.apply(self.time_s, self.traffic.crowd.target_s_m, exposure_ev)

    def _update_poses(self) -> None:
        """Compute the poses of bodies, geoms and cameras, so that frame and truth belong to the same instant."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)

    def _sense(self) -> None:
        if self._sensors.hold:
            self._sensors.sense(self._felt(), self._ticks)

    def _felt(self) -> NDArray[np.float32]:
        proprio = self.robot.drive.proprio(self.data)
        return proprio if self._motion is None else self._motion.felt(proprio, self.time_s)

    def _carried(self, anatomy: Anatomy) -> CarriedItems:
        target = self.settings.target
        lying = [one for one in target.carries if not one.from_start and grips_s(one, target.actions)]
        lying.sort(key=lambda one: grips_s(one, target.actions)[0])
        times_s = [grips_s(one, target.actions)[0][0] for one in lying]
        found = places_alone(self.path, target, self.settings.axes.target, times_s)
        places: dict[Item, tuple[float, float, float]] = {}
        for one, (_, place) in zip(lying, found, strict=True):
            places[one.item] = place
        return CarriedItems(self.model, target, anatomy, places)

    def _crowd(self, plan: Plan) -> Crowd:
        settings = self.settings
        return Crowd(
            plan.layout,
            settings.target,
            self.path,
            settings.distractors,
            plan.crossings,
            self._seed,
            robot_start_m=self.robot.script.start_pose()[:2],
            oncoming=plan.oncoming,
            carts=plan.carts,
            target_axis=settings.axes.target,
            groups=settings.groups,
            targets=settings.walking_targets,
        )


@lru_cache(maxsize=8)
def _equilibrium(form: RobotForm, step_s: float) -> Equilibrium:
    """That of a robot, the same for every seed of a scenario."""
    return Equilibrium(compile_robot_alone(form, step_s))
