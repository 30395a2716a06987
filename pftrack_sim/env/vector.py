"""Vector environments: each environment in a process of its own, observations in shared memory.

Gymnasium's `AsyncVectorEnv` with what these environments need beside it: fresh processes, since a process forked from
one that has rendered cannot open OpenGL; an end without processes left over after Ctrl-C or the death of a process; and
errors of this package as they were raised.
"""

from __future__ import annotations

import functools
import os
import signal
from collections.abc import Callable, Iterable
from multiprocessing.connection import wait
from typing import Any, cast

import gymnasium as gym
from gymnasium.vector import AsyncVectorEnv, AutoresetMode
from gymnasium.vector.async_vector_env import AsyncState

from pftrack_sim.core.errors import ParameterError, WorkerError
from pftrack_sim.env.base import CameraEnv
from pftrack_sim.env.tasks import FollowEnv, TrackAndFollowEnv, TrackEnv

_CLOSE_S = 30.0  # A reset may run when the environments are closed; then they are ended.


def _whole(exchange: Callable[..., Any]) -> Callable[..., Any]:
    """Mark the processes as cut off until an exchange is whole: Ctrl-C may end it in the middle of a message."""

    @functools.wraps(exchange)
    def marked(self: ProcessVectorEnv, *args: Any, **kwargs: Any) -> Any:
        self.cut_off = True
        try:
            answer = exchange(self, *args, **kwargs)
        except (EOFError, OSError) as error:
            wait([one.sentinel for one in self.processes], 1.0)
            ended = [
                f"{place} with exit code {one.exitcode}" for place, one in enumerate(self.processes) if one.exitcode
            ]
            self.close(terminate=True)
            raise WorkerError(
                "a process of the vector environment ended without an answer, perhaps for want of memory: number "
                f"{', '.join(ended) or 'unknown'} ({type(error).__name__}); all are closed now"
            ) from None
        self.cut_off = False
        return answer

    return marked


class ProcessVectorEnv(AsyncVectorEnv[Any, Any]):
    """N environments in N processes, for `gym.make_vec(id, N, vectorization_mode="vector_entry_point", ...)`.

    Environment i of `reset(seed=s)` gets the seed s + i (or the i-th of a list), and its observations, rewards and
    information equal those of a single environment with that seed to the bit; the episodes after an autoreset draw
    their seeds from it. A program that makes one needs `if __name__ == "__main__":`, as processes are started afresh.

    Args:
        num_envs: Number of environments.
        autoreset_mode: Gymnasium's: `"NextStep"`, `"SameStep"` or `"Disabled"`.
        wrapper: Called in each process with the environment, for example `wrappers.BoxObservation`; it must be
            possible to pickle it.
        kwargs: Arguments of the environment.

    Raises:
        ParameterError: No environment, an unknown autoreset mode, or a program without the line above.
        UnknownNameError, ScenarioError: As the environment; also at `reset` and `step`.
        WorkerError: At `reset` and `step`, where a process has died; all are closed then.
    """

    environment: type[CameraEnv] = TrackEnv
    cut_off = False  # An exchange with the processes was not finished: nothing more can be read from them

    reset_async, reset_wait = _whole(AsyncVectorEnv.reset_async), _whole(AsyncVectorEnv.reset_wait)
    step_async, step_wait = _whole(AsyncVectorEnv.step_async), _whole(AsyncVectorEnv.step_wait)
    call_async, call_wait = _whole(AsyncVectorEnv.call_async), _whole(AsyncVectorEnv.call_wait)

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        wrapper: Callable[[gym.Env[Any, Any]], gym.Env[Any, Any]] | None = None,
        **kwargs: Any,
    ) -> None:
        modes = [mode.value for mode in AutoresetMode]
        if autoreset_mode not in (*AutoresetMode, *modes):
            raise ParameterError(f"autoreset_mode must be one of {modes}, got {autoreset_mode!r}")
        if num_envs < 1:
            raise ParameterError(f"a vector environment needs 1 environment or more, got num_envs={num_envs}")
        make = functools.partial(_make, self.environment, wrapper, kwargs, os.getpid())
        try:
            super().__init__(  # pyright: ignore[reportUnknownMemberType]
                [make] * num_envs, context="forkserver", autoreset_mode=autoreset_mode
            )
        except (EOFError, ConnectionError):
            raise ParameterError(
                "a process of the vector environment ended while it started; processes import the program afresh: "
                "what makes the environments must be below `if __name__ == '__main__':`, or use "
                "vectorization_mode='sync'"
            ) from None

    def close_extras(self, timeout: float | None = _CLOSE_S, terminate: bool = False) -> None:
        """End all processes, whatever they are doing: those that do not answer within the timeout [s] are killed."""
        if self.cut_off:
            self._state, terminate = AsyncState.DEFAULT, True
        try:
            super().close_extras(timeout, terminate)
        except (EOFError, OSError, ValueError):  # a process has died, or its pipe is closed
            self._state = AsyncState.DEFAULT
            super().close_extras(terminate=True)

    def _raise_if_errors(self, successes: Iterable[bool]) -> None:
        """Raise the first error of the environments as it was raised there, and close all."""
        failed = [index for index, success in enumerate(successes) if not success]
        if not failed:
            return
        reports = [cast("Any", self.error_queue).get() for _ in failed]
        self._state = AsyncState.DEFAULT
        self.close(terminate=True)
        raise min(reports, key=lambda report: report[0])[2]


class TrackVectorEnv(ProcessVectorEnv):
    """Many `pftrack_sim/Track-v0`."""


class FollowVectorEnv(ProcessVectorEnv):
    """Many `pftrack_sim/Follow-v0`."""

    environment = FollowEnv


class TrackAndFollowVectorEnv(ProcessVectorEnv):
    """Many `pftrack_sim/TrackAndFollow-v0`."""

    environment = TrackAndFollowEnv


def _make(
    environment: type[CameraEnv],
    wrapper: Callable[[gym.Env[Any, Any]], gym.Env[Any, Any]] | None,
    kwargs: dict[str, Any],
    parent: int,
) -> gym.Env[Any, Any]:
    """Make one environment; in a process of its own, leave Ctrl-C to the parent and one core to each process."""
    if os.getpid() != parent:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        os.environ.setdefault("LP_NUM_THREADS", "0")  # Mesa draws in the calling thread
    env = environment(**kwargs)
    return env if wrapper is None else wrapper(env)
