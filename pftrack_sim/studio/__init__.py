"""A live view of an episode in the browser, whose settings change while it runs (`pftrack-sim studio`).

`pftrack_sim.studio(env)` opens one for an environment's scenario: this package can be called.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from types import ModuleType
from typing import Any

import gymnasium as gym

from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.env.base import CameraEnv
from pftrack_sim.studio.server import Studio
from pftrack_sim.studio.session import Session
from pftrack_sim.studio.settings import Settings, settings_of
from pftrack_sim.studio.tracked import Moment


def open_env(env: gym.Env[Any, Any], trackers: Sequence[str] = ("ko2012",), **options: Any) -> Studio:
    """Open a studio on the scenario of an environment, at the seed of its last episode.

    As the last line of a notebook's cell it is an inline frame. It runs a simulation of its own: the environment stays
    where it is.

    Args:
        env: One of the three environments, wrapped or not.
        trackers: Names of the trackers that run from the start.
        options: Those of `Studio`.

    Raises:
        ParameterError: Another environment, or one whose scenario is a dict.
        StudioError: viser is missing, or the address cannot be bound.
    """
    base = env.unwrapped
    if not isinstance(base, CameraEnv):
        raise ParameterError(f"the studio shows environments of pftrack_sim, got {type(base).__name__}")
    settings = settings_of(base.scenario, base.episode_seed, tuple(TrackerSpec(name=name) for name in trackers))
    return Studio(settings, **options)


class _CallablePackage(ModuleType):
    __call__ = staticmethod(open_env)


sys.modules[__name__].__class__ = _CallablePackage

__all__ = ["Moment", "Session", "Settings", "Studio", "open_env"]
