"""Controllers by name: built-in ones, those of installed packages, and any `package.module:factory`.

A factory is called as `factory(**params)` and returns a `Controller`. Installed packages announce theirs in the
entry-point group `pftrack_sim.controllers`.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.controllers.base import Controller, RobotParameters
from pftrack_sim.controllers.obstacle_avoidance import ObstacleAvoidance
from pftrack_sim.controllers.target_search import TargetSearch
from pftrack_sim.controllers.visual_servo import VisualServo
from pftrack_sim.core.arguments import checked
from pftrack_sim.core.errors import ControllerError
from pftrack_sim.core.plugins import BuiltIn, Registry
from pftrack_sim.core.records import Estimate
from pftrack_sim.core.types import FloatArray

GROUP = "pftrack_sim.controllers"


class Still:
    """Stands still and looks ahead."""

    def reset(self, robot: RobotParameters) -> None:
        """See `Controller.reset`."""

    def act(self, estimate: Estimate, proprio: NDArray[Any]) -> FloatArray:
        """`(4,)` zeros."""
        return np.zeros(4)


@functools.wraps(VisualServo)
def _servo(**params: Any) -> TargetSearch:
    return TargetSearch(VisualServo(**params))


@functools.wraps(VisualServo)
def _servo_avoid(**params: Any) -> ObstacleAvoidance:
    return ObstacleAvoidance(TargetSearch(VisualServo(**params), drives=True))


_REGISTRY = Registry[Controller](
    kind="controller",
    group=GROUP,
    error_type=ControllerError,
    interface=Controller,
    methods=("reset", "act"),
    builtin={
        "servo": BuiltIn(
            _servo,
            "visual servoing by box, ground plane and range finder, with a search when the target is lost",
            __name__,
        ),
        "servo-avoid": BuiltIn(_servo_avoid, "servo with obstacle avoidance by the range finder", __name__),
        "still": BuiltIn(Still, "stands still and looks ahead", __name__),
    },
)
names = _REGISTRY.names
describe = _REGISTRY.describe
code_digest = _REGISTRY.code_digest


@checked
def make(name: str, **params: Any) -> Controller:
    """Make a new controller; see `Registry.make` for names, parameters and errors.

    >>> make("still").act(None, None).tolist()
    [0.0, 0.0, 0.0, 0.0]
    """
    return _REGISTRY.make(name, params)
