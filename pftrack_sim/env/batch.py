"""Vector environments in one process whose frames are drawn together, on a GPU where there is one.

    envs = gym.make_vec("pftrack_sim/FollowBatch-v0", 16, scenario="plaza-walk")

Every environment is a single one; each step runs all of them in turns until they wait for their images, draws these in
one call, then finds the truth in the same way.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, TypeAlias, cast

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.vector.utils import concatenate, create_empty_array, iterate
from numpy.typing import NDArray

from pftrack_sim import scenario as scenarios
from pftrack_sim.core.errors import ParameterError, RenderError
from pftrack_sim.env.base import CameraEnv, Observation
from pftrack_sim.env.follow import FollowEnv, TrackAndFollowEnv
from pftrack_sim.env.track import TrackEnv
from pftrack_sim.env.vector import check_vector_arguments
from pftrack_sim.render.selection import WARP_INSTALL_HINT, warp_installed
from pftrack_sim.simulation.pooled import PooledSimulation

Step: TypeAlias = tuple[Observation, float, bool, bool, dict[str, Any]]
_MASK = "reset_mask"


class BatchVectorEnv(SyncVectorEnv[Any, Any]):
    """N environments of one scenario in this process, drawn together by the ray caster `warp`.

    Environment i of `reset(seed=s)` gets the seed s + i (or the i-th of a list); the episodes after an autoreset draw
    their seeds from it. Its observations, rewards and information equal those of a single environment with the renderer
    `warp` and that seed. Worlds need not be alike: place, people, lights, stress axes may differ from seed to seed.
    Physics and people are computed on the processor, one world after the other.

    Args:
        num_envs: Number of environments.
        autoreset_mode: Gymnasium's: `"NextStep"`, `"SameStep"` or `"Disabled"`.
        kwargs: Arguments of the environment: `scenario`, `overrides`, `render_mode` (`"rgb_array"` or
            `"depth_array"`).

    Raises:
        ParameterError: No environment, an unknown autoreset mode, or an argument that belongs to another way of
            drawing (`backend`, `image`, `wrapper`).
        RenderError: The extra `warp` is not installed.
        UnknownNameError, ScenarioError: As the environment; also at `reset` and `step`.
    """

    environment: type[CameraEnv] = TrackEnv

    def __init__(
        self, num_envs: int = 1, *, autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP, **kwargs: Any
    ) -> None:
        check_vector_arguments(num_envs, autoreset_mode)
        allowed = ("scenario", "overrides", "render_mode")
        if other := sorted(set(kwargs) - set(allowed)):
            raise ParameterError(
                f"environments that are drawn together take {', '.join(allowed)} and always draw with 'warp'; got "
                f"{', '.join(other)}. For these use pftrack_sim/{self.environment.__name__.removesuffix('Env')}-v0"
            )
        if kwargs.get("render_mode") == "human":
            raise ParameterError("render_mode='human' shows one environment; many have 'rgb_array' and 'depth_array'")
        if not warp_installed() or find_spec("greenlet") is None:
            raise RenderError(f"drawing many worlds together needs the renderer warp. Install it:\n{WARP_INSTALL_HINT}")
        from pftrack_sim.render.warp.world_pool import WorldPool

        self._pool = WorldPool()
        scenario = scenarios.load(kwargs.pop("scenario", "plaza-walk"), kwargs.pop("overrides", None))

        def make() -> CameraEnv:
            env = self.environment(scenario, **kwargs)
            env.simulation = PooledSimulation(scenario, self._pool)
            return env

        super().__init__([make] * num_envs, autoreset_mode=autoreset_mode)  # pyright: ignore[reportUnknownMemberType]

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode in all environments, or in those of the `(n,)` bool `options["reset_mask"]`.

        Raises:
            ParameterError: Not one seed per environment, an invalid mask, or another option.
        """
        seeds = [seed + index if isinstance(seed, int) else None for index in range(self.num_envs)]
        seeds = seed if isinstance(seed, list) else seeds
        if len(seeds) != self.num_envs:
            raise ParameterError(f"{self.num_envs} environments need as many seeds, got {len(seeds)}")
        chosen: list[int] = np.flatnonzero(self._mask(options)).tolist()
        if any(one is None and index not in chosen for index, one in enumerate(self._env_obs)):
            raise gym.error.ResetNeeded("a reset of some environments comes after one of all")
        tasks = [lambda index=index: self._single(index).reset(seed=seeds[index]) for index in chosen]
        infos: dict[str, Any] = {}
        for index, (observation, info) in zip(chosen, self._run(tasks), strict=True):
            self._env_obs[index] = observation
            self._autoreset_envs[index] = False
            infos = self._add_info(infos, info, index)
        return self._concatenated(), infos

    def step(
        self, actions: Any
    ) -> tuple[Observation, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Step all environments; those that were over start again, by the autoreset mode."""
        if self.autoreset_mode == AutoresetMode.DISABLED and self._autoreset_envs.any():
            over = np.flatnonzero(self._autoreset_envs).tolist()
            raise gym.error.ResetNeeded(f"the episodes of the environments {over} are over: reset them with {_MASK!r}")
        given = list(iterate(self.action_space, actions))  # pyright: ignore[reportUnknownMemberType]
        if len(given) != self.num_envs:
            raise ParameterError(f"{self.num_envs} environments need as many actions, got {len(given)}")
        tasks = [lambda index=index: self._step_one(index, given[index]) for index in range(self.num_envs)]
        rewards = np.zeros(self.num_envs)
        terminated, truncated = (np.zeros(self.num_envs, dtype=np.bool_) for _ in range(2))
        infos: dict[str, Any] = {}
        for index, (stepped, restarted) in enumerate(self._run(tasks)):
            observation, rewards[index], terminated[index], truncated[index], info = stepped
            if restarted is not None:
                infos = self._add_info(infos, {"final_obs": observation, "final_info": info}, index)
                observation, info = restarted
            self._env_obs[index] = observation
            infos = self._add_info(infos, info, index)
        self._autoreset_envs = terminated | truncated
        return self._concatenated(), rewards, terminated, truncated, infos

    def complete_truth(self, infos: dict[str, Any], *, people: bool = False) -> None:
        """Find at once, for all environments together, what of the truth is otherwise found when it is first read.

        Read one by one, each is a drawing of its own.

        Args:
            infos: Information of the last step or reset.
            people: Everybody in view, not the target alone.
        """
        truths, everybody = infos["truth"][infos["_truth"]], infos["people"][infos["_people"]]
        tasks: list[Callable[[], Any]] = [lambda truth=truth: truth.visible_box for truth in truths]
        if people:
            tasks = [lambda all_of_one=one: [person.visible_box for person in all_of_one] for one in everybody]
        self._run(tasks)

    def _step_one(self, index: int, action: Any) -> tuple[Step, tuple[Observation, dict[str, Any]] | None]:
        """A step of one environment, and the start of its next episode where that is in the same step."""
        env = self._single(index)
        if self._autoreset_envs[index] and self.autoreset_mode == AutoresetMode.NEXT_STEP:
            observation, info = env.reset()
            return (observation, 0.0, False, False, info), None
        stepped = cast("Step", env.step(action))
        restarts = self.autoreset_mode == AutoresetMode.SAME_STEP and (stepped[2] or stepped[3])
        return stepped, env.reset() if restarts else None

    def _run(self, tasks: list[Callable[[], Any]]) -> list[Any]:
        """Run tasks of environments together. After an error they are at different times: all are closed."""
        try:
            return self._pool.run(tasks)
        except BaseException:
            self.close()
            raise

    def _single(self, index: int) -> CameraEnv:
        return cast("CameraEnv", self.envs[index])

    def _mask(self, options: dict[str, Any] | None) -> NDArray[np.bool_]:
        """`(n,)` environments that a reset with these options starts."""
        if other := sorted(set(options or {}) - {_MASK}):
            raise ParameterError(f"reset has the option {_MASK!r} alone, got {other}")
        mask = np.ones(self.num_envs, dtype=np.bool_) if not options else np.asarray(options[_MASK])
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            raise ParameterError(f"{_MASK} must be {self.num_envs} bools, one of them true, got {mask.tolist()}")
        return mask

    def _concatenated(self) -> Observation:
        """New arrays of the observations of all environments."""
        space = cast("gym.Space[Any]", self._single(0).observation_space)
        return cast("Observation", concatenate(space, self._env_obs, create_empty_array(space, self.num_envs)))


class TrackBatchEnv(BatchVectorEnv):
    """Many `pftrack_sim/Track-v0`."""


class FollowBatchEnv(BatchVectorEnv):
    """Many `pftrack_sim/Follow-v0`."""

    environment = FollowEnv


class TrackAndFollowBatchEnv(BatchVectorEnv):
    """Many `pftrack_sim/TrackAndFollow-v0`."""

    environment = TrackAndFollowEnv
