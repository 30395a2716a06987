"""Controllers by name: built-in ones, those of installed packages, and any `package.module:factory`.

A factory is called as `factory(**params)` and returns a `Controller`. Installed packages announce theirs in the
entry-point group `pftrack_sim.controllers`.
"""

from __future__ import annotations

from typing import Any

from pftrack_sim.controllers.avoiding import Avoiding
from pftrack_sim.controllers.base import Controller
from pftrack_sim.controllers.searching import Searching
from pftrack_sim.controllers.servo import Servo
from pftrack_sim.controllers.still import Still
from pftrack_sim.core.errors import ControllerError
from pftrack_sim.core.plugins import BuiltIn, Registry

GROUP = "pftrack_sim.controllers"


def _servo(*, distance_m: float | None = None, person_m: float = 1.72, least_confidence: float = 0.2) -> Searching:
    return Searching(Servo(distance_m=distance_m, person_m=person_m, least_confidence=least_confidence))


def _servo_avoid(*, distance_m: float | None = None, person_m: float = 1.72, least_confidence: float = 0.2) -> Avoiding:
    return Avoiding(_servo(distance_m=distance_m, person_m=person_m, least_confidence=least_confidence))


_REGISTRY = Registry[Controller](
    kind="controller",
    group=GROUP,
    error_type=ControllerError,
    interface=Controller,
    methods=("reset", "act"),
    builtin={
        "servo": BuiltIn(_servo, "visual servoing by the box; searches where the target left when it is lost"),
        "servo-avoid": BuiltIn(_servo_avoid, "as servo, and avoids obstacles by the range finder"),
        "still": BuiltIn(Still, "stands still and looks ahead"),
    },
)


def names() -> list[str]:
    """All names that `make` knows, sorted: built-in and installed."""
    return _REGISTRY.names()


def describe(name: str) -> str:
    """Description of a controller in one line; raises UnknownNameError."""
    return _REGISTRY.describe(name)


def make(name: str, **params: Any) -> Controller:
    """Make a new controller.

    Args:
        name: One of `names()`, or `package.module:factory`.
        params: Parameters of the controller.

    Raises:
        UnknownNameError: No such controller.
        ParameterError: An unknown parameter, or a value that is not allowed.
        ControllerError: A third-party factory cannot be loaded, fails, or makes something else.

    >>> make("still").act(None, None).tolist()
    [0.0, 0.0, 0.0, 0.0]
    """
    return _REGISTRY.make(name, params)
