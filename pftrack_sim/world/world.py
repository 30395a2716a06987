"""The world of one episode: it is built once, and moves from frame to frame."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim import streams
from pftrack_sim.errors import ParameterError, ScenarioError
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scenario.model import Distractors
from pftrack_sim.world import occlusion
from pftrack_sim.world.build import build
from pftrack_sim.world.clock import Clock
from pftrack_sim.world.crowd import Crossing, Crowd
from pftrack_sim.world.layout import Layout
from pftrack_sim.world.lighting import Lighting
from pftrack_sim.world.motion import Motion
from pftrack_sim.world.occlusion import Placement
from pftrack_sim.world.path import Path
from pftrack_sim.world.people import Gait, Puppets
from pftrack_sim.world.robot import Script


class World:
    """Place, robot and people of one episode, at time 0.

    Args:
        settings: The scenario, every range drawn.
        seed: Root seed of the episode.

    Raises:
        ScenarioError: An occlusion that was asked for cannot happen.
    """

    def __init__(self, settings: ResolvedScenario, seed: int) -> None:
        self.settings = settings
        self.clock = Clock.for_rate(settings.camera.rate_hz)
        scene = build(settings, seed, self.clock.step_s)
        self.model = scene.model
        self.data = mujoco.MjData(scene.model)
        self.people = tuple(person.name for person in scene.cast)
        path = Path(settings.target.path_m)
        layout, placements, crossings = self._plan_occlusions(scene.layout, path, seed)
        crowd = self._crowd(layout, path, settings.distractors, crossings, seed)
        self._motion = Motion(self.model, self.data, settings, self.clock, path, crowd, seed)
        self._gait = Gait(
            [person.anatomy for person in scene.cast], [streams.stream(seed, "gait", name) for name in self.people]
        )
        self._puppets = Puppets(self.model, self.people)
        self._lighting = Lighting(self.model, settings.lights)
        self._start(placements)

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
            self._gait.advance(self.clock.tick_s, crowd.positions_m, crowd.headings_rad)
        self._puppets.write(self.data, *self._gait.poses())
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
        """`(n,)` what the robot feels of itself, see `pftrack_sim.proprio`."""
        return self._motion.drive.proprio(self.data)

    def collision(self) -> str | None:
        """Name of a person or thing that the robot touches, or None."""
        return self._motion.drive.collision(self.data)

    def robot_pose(self) -> tuple[float, float, float]:
        """x, y [m] and heading [rad] of the robot."""
        return self._motion.drive.pose(self.data)

    def light(self) -> None:
        """Set the lights to what they are now."""
        self._lighting.apply(self.time_s)

    def _start(self, placements: dict[int, Placement]) -> None:
        mujoco.mj_resetData(self.model, self.data)
        for index, placement in placements.items():
            occlusion.place(self.model, self.data, index, placement)
        self._motion.reset()
        crowd = self._motion.crowd
        self._gait.reset(crowd.positions_m, crowd.headings_rad, crowd.speeds_m_s)
        self._puppets.write(self.data, *self._gait.poses())
        self._settle()

    def _settle(self) -> None:
        """Bring poses up to date with the state: what is drawn and what is true come from the same instant."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)

    def _crowd(
        self,
        layout: Layout,
        path: Path,
        distractors: Distractors,
        crossings: list[Crossing],
        seed: int,
    ) -> Crowd:
        start = Script(self.settings.robot, path, self.settings.target.speed_m_s).start_pose()
        return Crowd(layout, self.settings.target, path, distractors, crossings, seed, robot_start_m=start[:2])

    def _plan_occlusions(
        self, layout: Layout, path: Path, seed: int
    ) -> tuple[Layout, dict[int, Placement], list[Crossing]]:
        """Where standing occluders go and how walkers cross, found by running the episode without pictures.

        The target and the robot follow their scripts whoever else is about, so the rehearsal needs no strangers.
        """
        occluders = self.settings.occluders
        if not occluders:
            return layout, {}, []
        alone = self._crowd(layout, path, self.settings.distractors.model_copy(update={"count": 0}), [], seed)
        rehearsing = Motion(self.model, self.data, self.settings, self.clock, path, alone, seed)
        last_s = max(one.at_s + one.duration_s for one in occluders)
        rehearsal = rehearsing.rehearse(last_s + 3.0, self.settings.target.height_m)
        placements: dict[int, Placement] = {}
        crossings: list[Crossing] = []
        problems: list[str] = []
        names = occlusion.occluder_names(occluders)
        # Standing things first: walkers must know what they walk around.
        for index in sorted(range(len(occluders)), key=lambda index: names[index] is None):
            occluder, name = occluders[index], names[index]
            try:
                if name is None:
                    crossings.append(occlusion.plan_walker(occluder, rehearsal, layout, f"occluders.{index}"))
                else:
                    found = occlusion.plan_static(occluder, rehearsal, layout, f"occluders.{index}")
                    placements[index] = found
                    layout = replace(layout, footprints=(*layout.footprints, found.footprint(name)))
            except ParameterError as error:
                problems.append(str(error))
        if problems:
            raise ScenarioError(f"{self.settings.title!r} at seed {seed}", problems)
        return layout, placements, crossings
