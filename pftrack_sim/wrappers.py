"""Wrappers of the environments for learning: boxes instead of pixels, or pixels alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from pftrack_sim import trackers
from pftrack_sim.core.errors import ParameterError, UnknownNameError
from pftrack_sim.core.proprioception import PROPRIO_INDEX, PROPRIO_NAMES
from pftrack_sim.core.records import Estimate
from pftrack_sim.env import FollowEnv, TrackAndFollowEnv
from pftrack_sim.policies import TrackingPolicy

SENSES = ("wheel_left_m_s", "wheel_right_m_s", "gyro_z_rad_s", "pan_rad", "tilt_rad")
"""Proprioception that a controller needs."""


class BoxObservation(gym.Wrapper[NDArray[np.float32], Any, dict[str, Any], Any], gym.utils.RecordConstructorArgs):
    """`Follow-v0` with a tracker inside: the observation is its box instead of the image.

    Observation: `(5 + len(senses),)` float32: x, y of the box's centre from the image's centre in halves of the image
    (-1 is the left or upper edge), w, h as shares of the image, the confidence, and then the senses. Before the target
    is selected, and where the tracker gives an empty box, the first five are 0.

    A new tracker is made for every episode from its seed; `estimate` holds its latest estimate.

    Args:
        env: `pftrack_sim/Follow-v0`, wrapped or not.
        tracker: Any name that `trackers.make` takes; `"oracle"` gives the true box.
        preset: The tracker's preset.
        senses: Which of `proprio.PROPRIO_NAMES` to add.
        params: The tracker's parameters.

    Raises:
        ParameterError: Another environment.
        UnknownNameError: An unknown tracker or sense.

    >>> import gymnasium as gym, pftrack_sim
    >>> env = BoxObservation(gym.make("pftrack_sim/Follow-v0", scenario="corridor"), "ko2012", particle_count=50)
    >>> env.observation_space.shape
    (10,)
    >>> env.close()
    """

    def __init__(
        self,
        env: gym.Env[dict[str, Any], Any],
        tracker: str = "oracle",
        *,
        preset: str = "default",
        senses: Sequence[str] = SENSES,
        **params: Any,
    ) -> None:
        gym.utils.RecordConstructorArgs.__init__(self, tracker=tracker, preset=preset, senses=senses, **params)
        gym.Wrapper.__init__(self, env)
        base = env.unwrapped
        if not isinstance(base, FollowEnv) or isinstance(base, TrackAndFollowEnv):
            raise ParameterError(f"BoxObservation wraps pftrack_sim/Follow-v0, got {type(base).__name__}")
        bounds = base.proprio_high
        for sense in senses:
            if PROPRIO_INDEX.get(sense, len(bounds)) >= len(bounds):
                raise UnknownNameError("sense", sense, PROPRIO_NAMES[: len(bounds)])
        self._base = base
        self._made = (tracker, preset, params)
        self._senses = [PROPRIO_INDEX[sense] for sense in senses]
        self._policy = self._new_policy(seed=0)
        far = np.full(4, np.inf, np.float32)
        low = np.concatenate([-far[:2], np.zeros(3, np.float32), -bounds[self._senses]])
        high = np.concatenate([far, np.ones(1, np.float32), bounds[self._senses]])
        self.observation_space = gym.spaces.Box(low, high, dtype=np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode with a new tracker."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._policy = self._new_policy(self._base.episode_seed)
        return self._observe(observation, info), info

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Drive until the next frame, and track the target in it."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._observe(observation, info), float(reward), terminated, truncated, info

    @property
    def estimate(self) -> Estimate | None:
        """Latest estimate of the tracker."""
        return self._policy.estimate

    def _new_policy(self, seed: int) -> TrackingPolicy:
        name, preset, params = self._made
        return TrackingPolicy(trackers.make(name, seed=seed, preset=preset, **params))

    def _observe(self, observation: Any, info: dict[str, Any]) -> NDArray[np.float32]:
        self._policy(observation, info)
        assert self.estimate is not None
        five = normalised_estimate(self.estimate, *self._base.image_size_px)
        return np.concatenate([five, observation["proprio"][self._senses]])


class PixelsOnly(gym.ObservationWrapper[NDArray[np.uint8], Any, dict[str, Any]], gym.utils.RecordConstructorArgs):
    """The image alone as the observation, for learning from pixels.

    Observation: `(H, W, 3)` uint8 RGB, or `(3, H, W)`. It does not say who was selected: with several people in view,
    `info["truth"]` does.

    Args:
        env: An environment of this package, wrapped or not.
        channels_first: `(3, H, W)`, as PyTorch's convolutions take images.

    Raises:
        ParameterError: An observation without an image.

    >>> import gymnasium as gym, pftrack_sim
    >>> env = PixelsOnly(gym.make("pftrack_sim/Follow-v0", scenario="corridor"), channels_first=True)
    >>> env.observation_space.shape
    (3, 240, 320)
    >>> env.close()
    """

    def __init__(self, env: gym.Env[dict[str, Any], Any], channels_first: bool = False) -> None:
        gym.utils.RecordConstructorArgs.__init__(self, channels_first=channels_first)
        gym.ObservationWrapper.__init__(self, env)
        space: Any = env.observation_space
        image = getattr(space, "spaces", {}).get("image")
        if image is None:
            raise ParameterError(f"PixelsOnly wraps environments whose observation has an image, got {space}")
        self._channels_first = channels_first
        height, width, channels = image.shape
        shape = (channels, height, width) if channels_first else (height, width, channels)
        self.observation_space = gym.spaces.Box(0, 255, shape, np.uint8)

    def observation(self, observation: Any) -> NDArray[np.uint8]:
        """The image of an observation."""
        image = observation["image"]
        return np.ascontiguousarray(np.moveaxis(image, -1, 0)) if self._channels_first else image


def normalised_estimate(estimate: Estimate, width_px: int, height_px: int) -> NDArray[np.float32]:
    """An estimate as five numbers independent of the image size; see `BoxObservation`.

    >>> normalised_estimate(Estimate([40, 0, 40, 60], 0.5), 80, 60).tolist()
    [0.5, 0.0, 0.5, 1.0, 0.5]
    """
    x, y, w, h = estimate.box.tolist()
    if w <= 0.0 or h <= 0.0:
        return np.zeros(5, np.float32)
    centre = (2.0 * x + w) / width_px - 1.0, (2.0 * y + h) / height_px - 1.0
    return np.array([*centre, w / width_px, h / height_px, estimate.confidence], np.float32)
