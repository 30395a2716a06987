"""Controllers by name: ours, those of installed packages, and any `package.module:factory`.

A factory is called as `factory(**params)` and returns a `Controller`. Installed packages announce theirs in the
entry-point group `pftrack_sim.controllers`; a name of ours cannot be taken.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from importlib.metadata import EntryPoint
from types import MappingProxyType
from typing import Any

from pftrack_sim import plugins
from pftrack_sim.controllers.avoiding import Avoiding
from pftrack_sim.controllers.base import Controller
from pftrack_sim.controllers.searching import Searching
from pftrack_sim.controllers.servo import Servo
from pftrack_sim.controllers.still import Still
from pftrack_sim.errors import ControllerError, ParameterError, PftrackError, UnknownNameError, did_you_mean

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


def names() -> list[str]:
    """Every name `make` knows, sorted: ours and those of installed packages."""
    return sorted({*_OURS, *_installed()})


def describe(name: str) -> str:
    """What a controller does, in one line.

    Raises:
        UnknownNameError: No such controller.
    """
    if name in _OURS:
        return (inspect.getdoc(_OURS[name]) or "").split("\n", 1)[0]
    installed = _installed()
    if name not in installed:
        raise UnknownNameError("controller", name, names())
    return f"installed controller {installed[name].value}"


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
    if name in _OURS:
        return _called(name, _OURS[name], params)
    installed = _installed()
    if name in installed:
        spelled = installed[name].value
    elif ":" in name:
        spelled = name
    else:
        raise UnknownNameError("controller", name, names())
    made = _called(name, plugins.load("controller", name, spelled, ControllerError), params)
    if not isinstance(made, Controller):
        raise ControllerError(f"controller {name!r}: its factory made a {type(made).__name__} without reset and act")
    return made


def _installed() -> dict[str, EntryPoint]:
    return plugins.installed(GROUP, _OURS)


def _called(name: str, factory: Callable[..., Any], params: Mapping[str, Any]) -> Any:
    """What a factory makes, and what is wrong where something is."""
    try:
        signature = inspect.signature(factory)
    except (TypeError, ValueError):
        signature = None  # a compiled factory shows no signature; the call itself will tell
    if signature is not None:
        known = sorted(signature.parameters)
        takes_any = any(one.kind is one.VAR_KEYWORD for one in signature.parameters.values())
        for key in params:
            if key not in known and not takes_any:
                listed = ", ".join(known) or "none"
                raise ParameterError(
                    f"controller {name!r} has no parameter {key!r}{did_you_mean(key, known)} (it has: {listed})"
                )
    try:
        return factory(**params)
    except PftrackError:
        raise
    except Exception as error:
        raise ControllerError(f"controller {name!r} could not be made: {type(error).__name__}: {error}") from error
