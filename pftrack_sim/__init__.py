"""A Gymnasium environment for tracking people from a moving robot camera, with exact truth.

Importing this package registers `pftrack_sim/Track-v0`, `pftrack_sim/Follow-v0` and `pftrack_sim/TrackAndFollow-v0`,
and does nothing else: no graphics, no threads, no environment variables.
"""

from __future__ import annotations

from importlib.metadata import version as _version

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


register_envs()
