"""One episode: the world moves, the camera takes frames, and the truth observes them.

(build -> dry run -> plan -> compile -> reset) -> (advance -> capture -> observe) for every frame. The Gymnasium
environments and the benchmark are built on this class; it knows no actions, rewards or trackers.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.shake import camera_shake
from pftrack_sim.core.arguments import checked
from pftrack_sim.core.errors import ParameterError, ScenarioError
from pftrack_sim.core.memory import return_freed_memory
from pftrack_sim.core.records import Frame
from pftrack_sim.core.types import FloatArray
from pftrack_sim.render.renderer import Renderer, check_name, open_renderer
from pftrack_sim.scenario import ResolvedScenario, Scenario
from pftrack_sim.scenario.frame_delivery import arrivals, frame_count
from pftrack_sim.scene.robot import fitted_settings
from pftrack_sim.simulation.camera import EpisodeCamera
from pftrack_sim.simulation.world import World
from pftrack_sim.truth.geometry import SceneGeometry
from pftrack_sim.truth.silhouettes import Silhouette

LIVE_AXES = ("jitter", "blur", "rolling_shutter", "distortion", "noise", "stream")
"""Stress axes of the camera and of the link, which can change within an episode."""

_TRIM_EVERY = 3  # Resets: to trim the memory at each would take a tenth of its time


class Simulation:
    """Frames with exact truth from a scenario, one episode after the other.

    Args:
        scenario: The scenario with its ranges.
        backend: `"gl"`, `"egl"`, `"osmesa"`, `"warp"`, or None: OpenGL where a library loads, else warp if installed.
        image: Whether frames have images. Without, nothing needs OpenGL, and the truth is the same but for its
            `luminance`, which is NaN; axes of pixels change nothing.
        cameras: Whether frames have those of the scenario's other cameras, too.

    Raises:
        UnknownNameError: An unknown backend.
        ParameterError: A backend, although there are no images to draw.
        RenderError: Nothing can draw off-screen (raised at the first reset).
    """

    @checked
    def __init__(
        self, scenario: Scenario, *, backend: str | None = None, image: bool = True, cameras: bool = False
    ) -> None:
        check_name(backend)  # A wrong name is an error now, not at the first reset.
        if backend is not None and not image:
            raise ParameterError(f"without images nothing is drawn: leave out the backend {backend!r}")
        self._clear(scenario, backend, image, cameras)

    def _clear(self, scenario: Scenario, backend: str | None, image: bool, cameras: bool) -> None:
        self.scenario, self._backend, self._draws, self._all_cameras = scenario, backend, image, cameras
        self._image_sizes: dict[str, tuple[int, int]] = {}
        self._renderers: dict[tuple[int, int], Renderer] = {}
        self._cameras: dict[str, EpisodeCamera] = {}
        self._world: World | None = None
        self._frame: Frame | None = None
        self._resets = 0
        self._collision: str | None = None
        self.frame_count = 0
        """Frames delivered in the running episode; 0 before the first reset."""
        self.command: FloatArray | None = None
        """Command in force at the last frame; None before the first one and while the robot follows its script."""

    def reset(self, seed: int) -> Frame:
        """Start the episode of a seed and return its first frame.

        Raises:
            ScenarioError: The scenario contradicts itself at this seed, or its image size depends on the seed.
        """
        self._begin(seed)
        return self._take_frame()

    def resume(self, seed: int, commands: Sequence[FloatArray | None]) -> Frame:
        """Start the episode of a seed at a later frame, equal to the bit to the one that `advance` would reach.

        The world moves on without rendering, except for frames that the camera meters and the last two.

        Args:
            seed: Root seed of the episode.
            commands: Of each camera period since the first frame, as in `advance`; at least as many periods pass, and
                the last command is held until a frame is delivered.

        Returns:
            The first delivered frame after these periods.

        Raises:
            ScenarioError: As `reset`.
        """
        self._begin(seed)
        before = sum(1 for _ in itertools.takewhile(lambda stop: stop < len(commands), arrivals(self.settings, seed)))
        for left in range(before, 0, -1):
            if left == 1:
                self._take_frame()  # For the motion in the image since
            else:
                self._meter()
            self._move_on(lambda period: commands[min(period, len(commands) - 1)])
        return self._take_frame()

    def switch_target(self, name: str) -> None:
        """Tell of this person as the target of the running episode, from the next frame on; the world does not change.

        Raises:
            UnknownNameError: There is no such person: see `world.people`.
            ScenarioError: No episode is running.
        """
        for camera in (self._camera, *self._cameras.values()):
            camera.truth.track(name)
        self._tracked = name

    def retune(self, scenario: Scenario, seed: int) -> None:
        """Continue the running episode with other severities or parameters of `LIVE_AXES`, from the next frame on.

        Poses before the change are not drawn again: an exposure that began earlier is cut, and the suspension has
        no memory of another road. `resume` gives the frames of the new settings to the bit.

        Args:
            scenario: Differs from the present one in `LIVE_AXES` only.
            seed: Root seed of the running episode.

        Raises:
            ScenarioError: It differs in something else, or the lens is not invertible.
        """
        settings, present = fitted_settings(scenario.resolve(seed)), self.settings
        live = {name: getattr(settings.axes, name) for name in LIVE_AXES}
        if present.model_copy(update={"axes": present.axes.model_copy(update=live)}) != settings:
            raise ScenarioError(scenario.name, [f"only {', '.join(LIVE_AXES)} can change within an episode"])
        frame, world = self.frame, self.world
        self.scenario = scenario
        self._shake = camera_shake(settings.jitter, settings.axes.jitter, seed, settings.camera.height_m)
        world.retune(settings)
        for name, camera in self._cameras.items():
            camera.retune(settings.seen_by(name), self._shake)
        self._bind_renderers(world)
        self._arrivals = arrivals(settings, seed)
        self._index = sum(1 for _ in itertools.takewhile(lambda index: index <= self._delivered, self._arrivals)) - 1
        self._arrivals = (index for index in arrivals(settings, seed) if index > self._delivered)
        self.frame_count = frame_count(settings, seed)
        self._frame = replace(frame, index=self._index)
        self._record_poses()

    def _begin(self, seed: int) -> None:
        """Build the world of a seed, and record the poses of the first frame."""
        settings = fitted_settings(self.scenario.resolve(seed))
        seen = {name: settings.seen_by(name).camera for name in settings.camera_names}
        sizes = {name: (one.width_px, one.height_px) for name, one in seen.items()}
        for name, size in sizes.items():
            if (known := self._image_sizes.get(name, size)) != size:
                problem = f"{name}: the image size must not change with the seed, got {known} and then {size}"
                raise ScenarioError(self.scenario.name, [problem])
        self._finish_truth()
        # Release the old model first: two compiled models at once would double the memory of a reset.
        self._world, self._frame, self._cameras = None, None, {}
        for renderer in self._renderers.values():
            renderer.unbind()
        self._resets += 1
        if self._resets % _TRIM_EVERY == 0:
            return_freed_memory()
        self._tracked = settings.tracked
        world = World(settings, seed, draws=self._draws)
        self._shake = camera_shake(settings.jitter, settings.axes.jitter, seed, settings.camera.height_m)
        names = [name for name in settings.camera_names if self._all_cameras or name == settings.viewed]
        cameras = {name: EpisodeCamera(world, settings.seen_by(name), name, seed, self._shake) for name in names}
        self._cameras, self._viewed = cameras, settings.viewed
        self._bind_renderers(world)
        self._image_sizes, self._world = sizes, world
        self._arrivals: Iterator[int] = arrivals(settings, seed)
        self._delivered = next(self._arrivals)
        self._index = 0
        self.frame_count = frame_count(settings, seed)
        self.command = self._collision = None
        self._record_poses()

    def advance(self, command: FloatArray | None = None, delay_s: float = 0.0) -> Frame:
        """Advance the world to the next frame that is delivered.

        Frames lost on the way are recorded, so that poses and exposures do not depend on the delivery; they are
        rendered only where the camera meters them.

        Args:
            command: `(4,)` forward speed, turn rate, pan rate, tilt rate, each in [-1, 1] of the robot's limits;
                None lets the robot follow its script. It stays in force until the next one is given.
            delay_s: Time from the last frame until the command is given; until then the one before stays in force. A
                command that is due after the next frame is not given.
        """
        self._move_on(lambda _: command, delay_s)
        return self._take_frame()

    def _move_on(self, command: Callable[[int], FloatArray | None], delay_s: float = 0.0) -> None:
        """Advance to the next frame that is delivered, with the command of each camera period."""
        delivered = next(self._arrivals)
        self._collision = None
        world, rate_hz = self.world, self.settings.camera.rate_hz
        for index in range(self._delivered, delivered):
            self._advance_period(command(index), delay_s - (index - self._delivered) / rate_hz)
            self._collision = self._collision or world.collision()
            self._record_poses()
            if index + 1 < delivered:
                self._meter()
        self._delivered = delivered
        self._index += 1

    def _bind_renderers(self, world: World) -> None:
        """Draw another model or at other sizes; cameras whose images have one size share a renderer."""
        for camera in self._cameras.values():
            camera.truth.track(self._tracked)
        if not self._draws:
            return
        sizes = dict.fromkeys(camera.render_size for camera in self._cameras.values())
        for size in self._renderers.keys() - sizes.keys():
            self._renderers.pop(size).close()
        for size in sizes:
            if size in self._renderers:
                self._renderers[size].rebind(world.model)
            else:
                self._renderers[size] = open_renderer(world.model, *size, self._backend)
        for camera in self._cameras.values():
            camera.renderer = self._renderers[camera.render_size]

    def _advance_period(self, command: FloatArray | None, delay_s: float) -> None:
        """Advance by one camera period with a command that is given after `delay_s`, or not within this period."""
        world = self.world
        period_s = 1.0 / world.settings.camera.rate_hz
        if delay_s <= period_s + 1e-9:
            self.command = command
            world.advance(command, min(max(delay_s, 0.0), period_s))
        else:
            world.advance(np.zeros(4) if self.command is None else self.command)

    def _record_poses(self) -> None:
        """Record the poses of a camera frame, delivered or not."""
        world = self.world
        world.displace_mount(self._shake.displace(world.camera_pose(), world.time_s))
        for camera in self._cameras.values():
            camera.record()

    def _meter(self) -> None:
        for camera in self._cameras.values():
            camera.meter()

    def _take_frame(self) -> Frame:
        others: dict[str, Frame] = {}
        for name, camera in self._cameras.items():
            if name != self._viewed:
                others[name] = camera.take(self._index, self._delivered, {})
        self._frame = self._camera.take(self._index, self._delivered, others)
        return self._frame

    @property
    def _camera(self) -> EpisodeCamera:
        """The camera that the episode is seen by."""
        if not self._cameras:
            raise self._no_episode()
        return self._cameras[self._viewed]

    def _finish_truth(self) -> None:
        for camera in self._cameras.values():
            camera.truth.finish()

    def scene_geometry(self) -> SceneGeometry:
        """What every pixel of the last frame shows, and how far it is.

        Raises:
            ScenarioError: A pixel of the frame has no single depth: exposure, readout or lens are not those of an
                instant through a pinhole.
        """
        self._check_instantaneous("depth and flow")
        return self._camera.truth.scene_geometry(self.world.data, self._camera.T_world_camera.copy())

    def extents_m(self) -> dict[str, FloatArray]:
        """`(2, 3)` smallest and largest coordinates [m] of each person's body in its own frame, by name.

        Raises:
            ScenarioError: As `scene_geometry`.
        """
        self._check_instantaneous("3D boxes")
        world = self.world
        return dict(zip(world.people, self._camera.truth.extents_m(world.data, world.root_poses()), strict=True))

    def _check_instantaneous(self, what: str) -> None:
        if not self._camera.instantaneous:
            remedy = "set blur, rolling_shutter, distortion to 0"
            raise ScenarioError(
                self.scenario.name, [f"{what} need frames that are an instant through a pinhole: {remedy}"]
            )

    @property
    def silhouettes(self) -> Mapping[str, Silhouette]:
        """Pixels of the people in the last frame, by name, of those who have some; under every effect."""
        return self._camera.truth.silhouettes if self._cameras else {}

    @property
    def periods(self) -> int:
        """Camera periods from the first frame to the last one delivered."""
        return self._delivered

    @property
    def frame(self) -> Frame:
        """The last frame of the running episode."""
        if self._frame is None:
            raise self._no_episode()
        return self._frame

    @property
    def world(self) -> World:
        """The world of the running episode."""
        if self._world is None:
            raise self._no_episode()
        return self._world

    def depth(self) -> NDArray[np.float32]:
        """`(H, W)` depth along the optical axis of what each pixel of the last frame shows [m]; infinite for the sky.

        Each pixel is that of its ray through the lens, at mid-exposure of its row. Through a lens that sees more than
        80 degrees off its axis, it is the distance along the ray.
        """
        return self._camera.truth.depth_m()

    def collision(self) -> str | None:
        """Name of the first person or thing that the robot touched since the previous delivered frame, or None."""
        return self._collision

    @property
    def settings(self) -> ResolvedScenario:
        """The scenario of the running episode, every range drawn."""
        return self.world.settings

    @property
    def graphics(self) -> str:
        """Description of the renderer in one line; empty before the first reset and without images."""
        return next((one.description for one in self._renderers.values()), "")

    def close(self) -> None:
        """Free the renderer. Closing twice is fine."""
        self._finish_truth()
        for renderer in self._renderers.values():
            renderer.close()
        self._renderers, self._cameras = {}, {}
        self._world = self._frame = None
        return_freed_memory()

    def __getstate__(self) -> tuple[Scenario, str | None, bool, bool]:
        """A pickled copy has no episode: models and graphics contexts belong to one process."""
        return self.scenario, self._backend, self._draws, self._all_cameras

    def __setstate__(self, state: tuple[Scenario, str | None, bool, bool]) -> None:
        self._clear(*state)

    def _no_episode(self) -> ScenarioError:
        return ScenarioError(self.scenario.name, ["no episode is running: call reset(seed) first"])

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()
