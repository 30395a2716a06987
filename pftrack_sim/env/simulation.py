"""One episode as it happens: the world moves, the camera looks, the truth is written down.

build -> compile -> reset -> (advance -> shake -> draw -> expose -> truth) for every frame. The Gymnasium environments
and the benchmark both stand on this class; it knows no actions, rewards or trackers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.jitter import combined
from pftrack_sim.camera.optics import intrinsics
from pftrack_sim.camera.sensor import Sensor
from pftrack_sim.errors import ScenarioError
from pftrack_sim.records import Frame
from pftrack_sim.render.choice import DescribedRenderer, check_name, open_renderer
from pftrack_sim.render.truth import TruthMaker
from pftrack_sim.scenario import ResolvedScenario, Scenario
from pftrack_sim.world import World


class Simulation:
    """Frames with exact truth from a scenario, one episode after the other.

    Args:
        scenario: The scenario with its ranges.
        backend: `"gl"`, `"egl"`, `"osmesa"`, `"warp"`, or None: OpenGL where a library loads, else warp if installed.

    Raises:
        UnknownNameError: An unknown backend.
        RenderError: Nothing can draw off-screen (raised at the first reset).
    """

    def __init__(self, scenario: Scenario, *, backend: str | None = None) -> None:
        self.scenario = scenario
        check_name(backend)  # a wrong name is told now, not at the first reset
        self._backend = backend
        self._image_size: tuple[int, int] | None = None
        self._renderer: DescribedRenderer | None = None
        self._world: World | None = None

    def reset(self, seed: int) -> Frame:
        """Start the episode of a seed.

        Returns:
            Its first frame.

        Raises:
            ScenarioError: The scenario contradicts itself at this seed, or its image size depends on the seed.
        """
        settings = self.scenario.resolve(seed)
        size = (settings.camera.width_px, settings.camera.height_px)
        if self._image_size not in (None, size):
            raise ScenarioError(
                self.scenario.name,
                [f"camera: the image size must not change with the seed, got {self._image_size} and then {size}"],
            )
        # The old world goes first: two compiled models at once would double the memory of a reset.
        self._world = None
        world = World(settings, seed)
        if self._renderer is None:
            self._renderer = open_renderer(world.model, *size, self._backend)
        else:
            self._renderer.rebind(world.model)
        self._image_size = size
        self._world = world
        self._K = intrinsics(*size, float(np.deg2rad(settings.camera.fovy_deg)))
        self._vibration = combined(settings.jitter, settings.axes.jitter, seed, settings.camera.height_m)
        self._sensor = Sensor(settings.sensor)
        self._truth = TruthMaker(world.model, world.people, self._renderer, self._K)
        self._index = 0
        return self._shoot()

    def advance(self, command: NDArray[np.float64] | None = None, late_s: float = 0.0) -> Frame:
        """Let the world move on to the next frame.

        Args:
            command: `(4,)` forward speed, turn rate, pan rate, tilt rate, each in [-1, 1] of the robot's limits;
                None lets the robot follow its script.
            late_s: How long after the last frame the command is given; until then the one before stays in force.
        """
        self.world.advance(command, late_s)
        self._index += 1
        return self._shoot()

    def _shoot(self) -> Frame:
        world = self.world
        assert self._renderer is not None
        T_world_camera = self._vibration.displace(world.camera_pose(), world.time_s)
        world.light()
        drawn = self._renderer.color(world.data, T_world_camera, self._K)
        image = self._sensor.expose(drawn)
        people = self._truth.observe(world.data, T_world_camera, image, world.time_s, world.root_poses())
        image.setflags(write=False)
        return Frame(self._index, world.time_s, image, people[0], people)

    @property
    def world(self) -> World:
        """The world of the running episode."""
        if self._world is None:
            raise ScenarioError(self.scenario.name, ["no episode is running: call reset(seed) first"])
        return self._world

    @property
    def settings(self) -> ResolvedScenario:
        """The scenario of the running episode, every range drawn."""
        return self.world.settings

    @property
    def graphics(self) -> str:
        """What draws, in one line; empty before the first reset."""
        return self._renderer.description if self._renderer is not None else ""

    def close(self) -> None:
        """Free the renderer. Closing twice is fine."""
        if self._renderer is not None:
            self._renderer.close()
        self._renderer = None
        self._world = None

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()
