"""A Gymnasium environment for tracking people from a moving robot camera, with exact truth.

Importing this package registers `pftrack_sim/Track-v0`, `pftrack_sim/Follow-v0` and `pftrack_sim/TrackAndFollow-v0`.
It does nothing else: no graphics, no threads, no environment variables.
"""

from __future__ import annotations

from importlib import import_module as _import_module
from importlib.metadata import version as _version
from typing import Any as _Any

import gymnasium as _gym

__version__ = _version("pftrack-sim")


def register_envs() -> None:
    """Register the environments with Gymnasium; calling it again changes nothing."""
    for name in ("Track", "Follow", "TrackAndFollow"):
        if f"pftrack_sim/{name}-v0" not in _gym.registry:
            _gym.register(  # pyright: ignore[reportUnknownMemberType]
                id=f"pftrack_sim/{name}-v0",
                entry_point=f"pftrack_sim.env:{name}Env",
                vector_entry_point=f"pftrack_sim.env.vector:{name}VectorEnv",
            )


def __getattr__(name: str) -> _Any:
    """The package `studio`, which can be called, without an import of its own."""
    if name == "studio":
        return _import_module("pftrack_sim.studio")
    raise AttributeError(f"module 'pftrack_sim' has no attribute {name!r}")


register_envs()
