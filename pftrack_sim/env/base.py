"""Base of the three environments: observations, information, rendering, the end of an episode."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim import scenario as scenarios
from pftrack_sim.core.arguments import checked
from pftrack_sim.core.errors import CommandError, ParameterError, ScenarioError
from pftrack_sim.core.proprioception import proprio_high
from pftrack_sim.core.records import Estimate, Frame, Image
from pftrack_sim.core.text import one_line
from pftrack_sim.env.window import Window
from pftrack_sim.render.overlay import draw_frame
from pftrack_sim.scenario import ResolvedScenario, ScenarioLike
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.truth.detector import DetectionModel

Observation = dict[str, Any]


class CameraEnv(gym.Env[Observation, Any]):
    """Base of the environments; see `TrackEnv`, `FollowEnv` and `TrackAndFollowEnv`.

    Observation, a dict:

    - `image`: `(H, W, 3)` uint8 RGB; left out with `image=False`.
    - `images`: a dict of `(H, W, 3)` uint8 RGB by name, of the scenario's other cameras where it has any.
    - `depth`: `(H, W)` float32 distance along the optical axis of what each pixel shows [m], infinite for the sky, with
      `depth=True`. It is exact, and the same without images: see `Simulation.depth`.
    - `init_box`: `(4,)` float64 x, y, w, h [px]: the target while `first` is 1, else zeros.
    - `first`: 1 in the frame in which the target is selected, else 0: the first in which anything of it can be seen.
      Unless the target starts out of view that is the first frame of the episode.
    - `proprio`: `(n,)` float32, proprioception (`pftrack_sim.core.proprioception.PROPRIO_NAMES`).

    Information, a dict: `truth` of the target, of all `people` in view, and of `targets` by name; `detections` of
    people as a detector gives them (`core.records.Detections`, see the stress axis `detector`); `cameras` with these
    four of other cameras, by name; `time_s`, `frame`, `seed`. Others than the target, detections, and the pixels of a
    target that nothing can occlude are computed when they are first read: in the thread that steps the environment,
    since they are rendered.

    Args:
        scenario: A name in `envs/`, a path to a TOML file, a dict, or a Scenario.
        overrides: Dotted keys and values, `{"duration_s": 5, "axes.jitter.severity": 2.0}`.
        render_mode: `"rgb_array"` (truth and last action drawn on the frame), `"human"` (the same in a window),
            `"depth_array"`, or None; `gym.make` adds `"rgb_array_list"`.
        backend: `"gl"`, `"egl"`, `"osmesa"`, `"warp"`, or None: OpenGL where a library loads, else warp if installed.
        image: False leaves out the pixels, for learning controllers on boxes and for many episodes of following: no
            OpenGL library is loaded, and the truth is the same but for its `luminance`. Every stress axis is accepted;
            those that only change pixels (`light`, `noise`, the compression of `stream`) change nothing.
        depth: Whether observations have a depth image; nothing else changes.

    Raises:
        UnknownNameError: No such scenario or backend.
        ScenarioError: The scenario or an override is wrong; every mistake is listed.
        ParameterError: An unknown render mode, or a backend or render mode together with `image=False`.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - Gymnasium's own way
        "render_modes": ["human", "rgb_array", "depth_array"],
        "render_fps": 30,
    }

    @checked
    def __init__(
        self,
        scenario: ScenarioLike = "plaza-walk",
        overrides: Mapping[str, Any] | None = None,
        render_mode: str | None = None,
        backend: str | None = None,
        image: bool = True,
        depth: bool = False,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ParameterError(
                f"render_mode must be 'rgb_array', 'depth_array', 'human' or None, got {render_mode!r} (gym.make adds "
                "'rgb_array_list')"
            )
        if render_mode is not None and not image:
            raise ParameterError(f"without images there is nothing to render: leave out render_mode {render_mode!r}")
        self.render_mode, self._image, self._depth = render_mode, image, depth
        self.scenario = scenarios.load(scenario, overrides)
        settings = self.scenario.resolve(0)
        camera, scan = settings.viewing.camera, settings.robot.range_finder
        self.proprio_high = proprio_high(scan.beams, scan.range_m)
        self.metadata = {**type(self).metadata, "render_fps": round(camera.rate_hz)}
        if not image:
            self.metadata["render_modes"] = []
        self.image_size_px = (camera.width_px, camera.height_px)
        far = float(max(self.image_size_px))
        seen = {name: settings.seen_by(name).camera for name in settings.camera_names}
        others: dict[str, gym.Space[Any]] = {
            name: gym.spaces.Box(0, 255, (one.height_px, one.width_px, 3), np.uint8) for name, one in seen.items()
        }
        spaces: dict[str, gym.Space[Any]] = {
            # A selected box lies inside the image.
            "init_box": gym.spaces.Box(0.0, far, (4,), np.float64),
            "first": gym.spaces.Discrete(2),
            "proprio": gym.spaces.Box(-self.proprio_high, self.proprio_high, dtype=np.float32),
        }
        if image:
            spaces["image"] = others.pop(settings.viewed)
        if image and others:
            spaces["images"] = gym.spaces.Dict(others)
        if depth:
            spaces["depth"] = gym.spaces.Box(0.0, np.inf, (camera.height_px, camera.width_px), np.float32)
        self.observation_space = gym.spaces.Dict(spaces)
        self._observed = _observed(settings)
        self.simulation = Simulation(self.scenario, backend=backend, image=image, cameras=True)
        self.episode_seed = 0
        """Root seed of the episode; 0 before the first reset."""
        self._window = Window(self.scenario.name, camera.rate_hz) if render_mode == "human" else None
        self._frame: Frame | None = None
        self._answered: tuple[Frame, Mapping[str, Estimate]] | None = None
        self._shown: Mapping[str, Estimate] | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode of a root seed; None draws one from the environment's own generator. It has no options."""
        if options:
            raise ParameterError(f"reset takes no options, got {one_line(repr(options), 60)}")
        super().reset(seed=seed)
        self.episode_seed = seed if seed is not None else int(self.np_random.integers(2**31))
        self._frame = self.simulation.reset(self.episode_seed)
        settings = self.simulation.settings
        now = _observed(settings)
        if other := [name for name, value in self._observed.items() if now.get(name) != value]:
            self._frame, name = None, other[0]
            changed = f"got {now.get(name)} at seed {self.episode_seed}, and {self._observed[name]} at seed 0"
            raise ScenarioError(
                self.scenario.name, [f"{name}: the observation must not change with the seed, {changed}"]
            )
        self._detectors = {
            name: DetectionModel(settings.model_copy(update={"viewed": name}), self.episode_seed)
            for name in settings.camera_names
        }
        self._answered = self._shown = None
        self._selected_in: int | None = None
        self._show_window()
        return self._observation(self._frame), self._info(self._frame)

    def switch_target(self, name: str) -> None:
        """Track another person of `info["people"]` from the next frame on; the world does not change.

        The frame in which anything of that person can first be seen has `first` 1 and the person's box, as the first
        one of an episode; truth, rewards and the end of the episode are about that person then.

        Raises:
            UnknownNameError: There is no such person in the episode.
            ScenarioError: No episode is running.
        """
        self.simulation.switch_target(name)
        self._selected_in = None

    def render(self) -> NDArray[Any] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Picture of the episode; None without a render mode, and for `"human"`, whose window follows by itself.

        `"rgb_array"`: `(H, W, 3)` uint8, the last frame answered by an action, with truth and action; before the first
        step, the first frame with its truth. `"depth_array"`: `(H, W)` float32, see `Simulation.depth`, of the frame in
        the last observation.
        """
        if self.render_mode is None:
            gym.logger.warn("render() needs a render_mode, for example 'rgb_array', given to gym.make")
        if self.render_mode in (None, "human"):
            return None
        if self.render_mode == "depth_array":
            self._current  # noqa: B018 - raises before the first reset
            return self.simulation.depth()
        return self._picture()

    def _picture(self) -> Image:
        frame, estimates = self._answered or (self._current, dict[str, Estimate]())
        return draw_frame(frame, estimates)

    def _show_window(self) -> None:
        if self._window is not None:
            self._window.show(self._picture())

    def show(self, estimates: Mapping[str, Estimate]) -> None:
        """Draw these estimates in `render`, by name, instead of the box of the next action; valid for one step.

        An estimate also holds whether the target is occluded, and particles where the tracker gives them:
        `env.unwrapped.show({"ko2012": policy.estimate})` before `env.step`.
        """
        self._shown = dict(estimates)

    def close(self) -> None:
        """Free the graphics context and close the window."""
        self.simulation.close()
        if self._window is not None:
            self._window.close()
        self._frame = self._answered = self._shown = None

    def __getstate__(self) -> dict[str, Any]:
        """A pickled copy has no episode: it needs `reset`."""
        return {**self.__dict__, "_frame": None, "_answered": None, "_shown": None, "_window": None}

    @property
    def _current(self) -> Frame:
        if self._frame is None:
            raise gym.error.ResetNeeded("Cannot step or render before reset()")
        return self._frame

    def _observation(self, frame: Frame) -> Observation:
        if self._selected_in is None and frame.truth.scored:
            self._selected_in = frame.index
        first = int(frame.index == self._selected_in)
        box = frame.truth.box.copy() if first else np.zeros(4)
        # Copies: wrappers and learners may write into an observation.
        pixels: dict[str, Any] = {"image": frame.image.copy()} if self._image else {}
        if self._image and frame.cameras:
            pixels["images"] = {name: one.image.copy() for name, one in frame.cameras.items()}
        depth = {"depth": self.simulation.depth()} if self._depth else {}
        return {**pixels, **depth, "init_box": box, "first": first, "proprio": self.simulation.world.proprio()}

    def _info(self, frame: Frame) -> dict[str, Any]:
        cameras = {name: self._seen(one, name) for name, one in frame.cameras.items()}
        return {
            **self._seen(frame, self.simulation.settings.viewed),
            **({"cameras": cameras} if cameras else {}),
            "time_s": frame.time_s,
            "frame": frame.index,
            "seed": self.episode_seed,
            "image_size_px": self.image_size_px,
        }

    def _seen(self, frame: Frame, camera: str) -> dict[str, Any]:
        """What is told of the people in a frame."""
        names = self.simulation.settings.target_names
        told = frame.people if len(names) > 1 else (frame.truth,)
        return {
            "truth": frame.truth,
            "people": frame.people,
            "targets": {one.name: one for one in told if one.name in names or one is frame.truth},
            "detections": self._detectors[camera].detect(frame.people, frame.image if self._image else None),
        }

    def _advance(self, command: NDArray[np.float64] | None, answer: Estimate | None, late_s: float = 0.0) -> Frame:
        """Keep the frame and its estimates for `render`, then advance to the next frame."""
        shown = self._current
        bare = {} if answer is None else {"action": answer}
        self._answered = (shown, bare if self._shown is None else self._shown)
        self._shown = None
        self._frame = self.simulation.advance(command, late_s)
        self._show_window()
        return self._frame

    @property
    def _over(self) -> bool:
        """Whether the last frame of the scenario has been answered."""
        return self._current.index >= self.simulation.frame_count


def _observed(settings: ResolvedScenario) -> dict[str, Any]:
    """What of a scenario the observation space consists of, by key."""
    seen = {name: settings.seen_by(name).camera for name in settings.camera_names}
    sizes = {f"size of {name!r} [px]": (one.width_px, one.height_px) for name, one in seen.items()}
    scan = settings.robot.range_finder
    finder = {"robot.range_finder.beams": scan.beams, "robot.range_finder.range_m": scan.range_m}
    return {"cameras": list(seen), "viewed": settings.viewed, **sizes, **finder}


def checked_command(action: ArrayLike) -> NDArray[np.float64]:
    """A `(4,)` command as four finite numbers; not clipped. Anything else raises `CommandError`."""
    try:
        command = np.array(action, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise CommandError(f"a command must be four numbers, got {action!r}") from error
    if command.shape != (4,):
        raise CommandError(
            f"a command must have shape (4,) (forward, turn, pan, tilt, each in [-1, 1]), got shape {command.shape}"
        )
    if not np.isfinite(command).all():
        raise CommandError(f"a command must be finite, got {command.tolist()}")
    return command
