"""Controllers by name: ours, those of installed packages, and any `package.module:factory`.

A factory is called as `factory(**params)` and returns a `Controller`. Installed packages announce theirs in the
entry-point group `pftrack_sim.controllers`; a name of ours cannot be taken.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from pftrack_sim.controllers.avoiding import Avoiding
from pftrack_sim.controllers.base import Controller
from pftrack_sim.controllers.searching import Searching
from pftrack_sim.controllers.servo import Servo
from pftrack_sim.controllers.still import Still
from pftrack_sim.core import plugins
from pftrack_sim.core.errors import ControllerError, ParameterError, did_you_mean

GROUP = "pftrack_sim.controllers"


def make_servo(*, distance_m: float | None = None, person_m: float = 1.72, least_confidence: float = 0.2) -> Controller:
    """Image-based visual servoing by the box; on loss it searches where the target left."""
    return Searching(Servo(distance_m=distance_m, person_m=person_m, least_confidence=least_confidence))


def make_servo_avoid(
    *, distance_m: float | None = None, person_m: float = 1.72, least_confidence: float = 0.2
) -> Controller:
    """As `servo`, and goes around obstacles by the range finder."""
    return Avoiding(Searching(Servo(distance_m=distance_m, person_m=person_m, least_confidence=least_confidence)))


_OURS: Mapping[str, Callable[..., Controller]] = MappingProxyType(
    {"servo": make_servo, "servo-avoid": make_servo_avoid, "still": Still}
)

_NAMES = plugins.Names(
    kind="controller",
    group=GROUP,
    error_type=ControllerError,
    ours={name: (inspect.getdoc(factory) or "").split("\n", 1)[0] for name, factory in _OURS.items()},
)


def names() -> list[str]:
    """Every name `make` knows, sorted: ours and those of installed packages."""
    return _NAMES.all()


def describe(name: str) -> str:
    """What a controller does, in one line.

    Raises:
        UnknownNameError: No such controller.
    """
    return _NAMES.describe(name)


def make(name: str, **params: Any) -> Controller:
    """A new controller.

    Args:
        name: One of `names()`, or `package.module:factory`.
        params: Its own parameters.

    Raises:
        UnknownNameError: No such controller.
        ParameterError: A parameter it does not have, or a value it cannot take.
        ControllerError: A third party's factory that cannot be loaded, fails, or makes something else.

    >>> make("still").act(None, None).tolist()
    [0.0, 0.0, 0.0, 0.0]
    """
    factory = _OURS[name] if name in _OURS else _NAMES.load(name)
    _check_params(name, factory, params)
    made = _NAMES.call(name, factory, **params)
    if not isinstance(made, Controller):
        raise ControllerError(f"controller {name!r}: its factory made a {type(made).__name__} without reset and act")
    return made


def _check_params(name: str, factory: Callable[..., Any], params: Mapping[str, Any]) -> None:
    try:
        signature = inspect.signature(factory)
    except (TypeError, ValueError):
        return  # a compiled factory shows no signature; the call itself will tell
    known = sorted(signature.parameters)
    if any(one.kind is one.VAR_KEYWORD for one in signature.parameters.values()):
        return
    for key in params:
        if key not in known:
            listed = ", ".join(known) or "none"
            raise ParameterError(
                f"controller {name!r} has no parameter {key!r}{did_you_mean(key, known)} (it has: {listed})"
            )
