"""One camera of an episode: what it captures and exposes, and the truth of its frames."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pftrack_sim.camera.sensor import Sensor
from pftrack_sim.camera.shake import CameraShake
from pftrack_sim.core.records import Frame, Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.render.capture.frame_capture import CapturedFrame, make_frame_capture
from pftrack_sim.render.renderer import Renderer
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scenario.camera import CAMERA, seed_of_camera
from pftrack_sim.scene.people.person import TRUNK
from pftrack_sim.simulation.world import World
from pftrack_sim.truth.observer import TruthObserver


class EpisodeCamera:
    """A camera of one episode.

    Args:
        settings: The scenario as this camera sees it, see `ResolvedScenario.seen_by`.
        name: `"camera"`, or that of a further one.
        shake: Vibration of the mount.

    Attributes:
        truth: The observer of its frames.
        renderer: One with images of `render_size`; None: it has no images.
        K: `(3, 3)` camera matrix [px].
    """

    def __init__(self, world: World, settings: ResolvedScenario, name: str, seed: int, shake: CameraShake) -> None:
        self._world, self._name = world, name
        self._seed = seed_of_camera(seed, name)
        self.renderer: Renderer | None = None
        camera = settings.camera
        self.sensor = Sensor(settings.sensor, settings.axes, self._seed, grey=camera.grey)
        self.K = camera.K
        self.size = camera.width_px, camera.height_px
        self._black = np.broadcast_to(np.uint8(0), (camera.height_px, camera.width_px, 3))
        parts = TRUNK if settings.target.init == "torso" else ()
        self.truth = TruthObserver(world.model, world.people, self.K, self.size, parts, settings.target_names[1:])
        self._look_through(settings, shake)

    def retune(self, settings: ResolvedScenario, shake: CameraShake) -> None:
        """Go on under other stress axes; it needs a renderer of the new `render_size`."""
        self.sensor.retune(settings.axes, self._seed)
        self._look_through(settings, shake)

    def _look_through(self, settings: ResolvedScenario, shake: CameraShake) -> None:
        self._shake = shake if self._name == CAMERA else shake.seen_from(settings.T_camera(self._name))
        self._capture = make_frame_capture(settings, self._world.model, self._shake)

    @property
    def instantaneous(self) -> bool:
        """Whether each frame is an instant through a pinhole."""
        return self._capture is None

    @property
    def render_size(self) -> tuple[int, int]:
        """Width and height of the images that it needs drawn."""
        return self.size if self._capture is None else self._capture.render_size

    def record(self) -> None:
        """Record the poses of a frame, delivered or not."""
        world, rest = self._world, self._world.camera_pose()
        self.T_world_camera = self._shake.displace(rest, world.time_s)
        """`(4, 4)` its pose, with the vibration of its mount."""
        if self._capture is not None:
            self._capture.record(world.data, world.time_s, rest, world.root_poses())

    def expose(self) -> tuple[Image, CapturedFrame | FloatArray]:
        """Render, expose and meter the frame recorded last: the image, and what `_captured` gives."""
        world = self._world
        world.light(self.sensor.settle(world.time_s))
        captured = self._captured()
        if isinstance(captured, CapturedFrame):
            rendered = captured.image
        else:
            assert self.renderer is not None
            rendered = self.renderer.color(world.data, captured, self.K)
        assert rendered is not None
        return self.sensor.expose(rendered, world.time_s), captured

    def meter(self) -> None:
        """Expose a frame that is not delivered, where later ones depend on it."""
        if self.renderer is not None and self.sensor.metering:
            self.expose()

    def _captured(self) -> CapturedFrame | FloatArray:
        """What is captured; where that is an instant through a pinhole, `(4, 4)` T_world_camera."""
        return self.T_world_camera.copy() if self._capture is None else self._capture.capture(self.renderer)

    def take(self, index: int, taken: int, cameras: Mapping[str, Frame]) -> Frame:
        """The frame recorded last, the `index`-th delivered and the `taken`-th of all, with those of other cameras."""
        world = self._world
        if self.renderer is not None:
            exposed, captured = self.expose()
            image = self.sensor.read(exposed, taken)
        else:
            image, captured = None, self._captured()
        if isinstance(captured, CapturedFrame):
            people = self.truth.observe_captured(captured, image, world.time_s)
        else:
            people = self.truth.observe(world.data, captured, image, world.time_s, world.root_poses())
        image = self._black if image is None else image
        image.setflags(write=False)
        return Frame(index, world.time_s, image, people[0], people, cameras)
