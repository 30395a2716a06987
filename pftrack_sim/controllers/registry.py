"""Controllers by name."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from pftrack_sim.controllers.base import Controller
from pftrack_sim.controllers.servo import Servo
from pftrack_sim.controllers.still import Still
from pftrack_sim.errors import ParameterError, UnknownNameError, did_you_mean

_FACTORIES: Mapping[str, Callable[..., Controller]] = MappingProxyType({"servo": Servo, "still": Still})


def names() -> list[str]:
    """All controllers that `make` knows."""
    return sorted(_FACTORIES)


def describe(name: str) -> str:
    """One line on what a controller does.

    Raises:
        UnknownNameError: No such controller.
    """
    return (inspect.getdoc(_factory(name)) or "").split("\n", 1)[0]


def make(name: str, **params: Any) -> Controller:
    """A new controller.

    Args:
        name: One of `names()`.
        params: Its own parameters.

    Raises:
        UnknownNameError: No such controller.
        ParameterError: A parameter it does not have, or a value it cannot take.

    >>> make("still").act(None, None).tolist()
    [0.0, 0.0, 0.0, 0.0]
    """
    factory = _factory(name)
    known = sorted(inspect.signature(factory).parameters)
    for key in params:
        if key not in known:
            listed = ", ".join(known) or "none"
            raise ParameterError(
                f"controller {name!r} has no parameter {key!r}{did_you_mean(key, known)} (it has: {listed})"
            )
    return factory(**params)


def _factory(name: str) -> Callable[..., Controller]:
    if name not in _FACTORIES:
        raise UnknownNameError("controller", name, names())
    return _FACTORIES[name]
