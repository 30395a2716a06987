"""The numbers of a method: a frozen dataclass whose fields say what they may be.

    @dataclass(frozen=True)
    class Params:
        particle_count: Annotated[int, Between(1, 10_000)] = 100
        likelihood: Literal["linear", "exponential"] = "exponential"

`settle` puts a preset and a user's own values together and checks every one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from pftrack_sim.core.errors import ParameterError, did_you_mean

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

P = TypeVar("P", bound="DataclassInstance")


@dataclass(frozen=True)
class Between:
    """The range of a number, both ends allowed."""

    low: float
    high: float


def settle(tracker: str, presets: Mapping[str, P], preset: str, given: Mapping[str, Any]) -> P:
    """The parameters of a preset, with the user's own in their place.

    Args:
        tracker: Name, for the message.
        presets: What each preset's name stands for.
        preset: Which.
        given: Parameters by name.

    Raises:
        ParameterError: No such preset or parameter, or a value that is not allowed.
    """
    check_preset(tracker, presets, preset)
    chosen = presets[preset]
    check_names(tracker, [one.name for one in fields(chosen)], given)
    hints = get_type_hints(type(chosen), include_extras=True)
    return replace(
        chosen, **{name: _checked(f"{tracker}: {name}", hints[name], value) for name, value in given.items()}
    )


def check_preset(tracker: str, presets: Mapping[str, object] | tuple[str, ...], preset: str) -> None:
    """Raise ParameterError unless the preset exists."""
    if preset not in presets:
        known = ", ".join(sorted(presets))
        raise ParameterError(f"{tracker}: unknown preset {preset!r}{did_you_mean(preset, presets)} (known: {known})")


def check_names(tracker: str, allowed: list[str], given: Mapping[str, Any]) -> None:
    """Raise ParameterError unless every given parameter exists."""
    for name in given:
        if name not in allowed:
            known = ", ".join(sorted(allowed)) or "none"
            near = did_you_mean(name, allowed)
            raise ParameterError(f"{tracker}: unknown parameter {name!r}{near} (known: {known})")


def _checked(what: str, hint: Any, value: Any) -> Any:
    if get_origin(hint) is Literal:
        allowed = get_args(hint)
        if value not in allowed:
            known = ", ".join(repr(one) for one in allowed)
            raise ParameterError(f"{what} must be one of {known}, got {value!r}{did_you_mean(str(value), allowed)}")
        return value
    if hint is bool:
        if not isinstance(value, bool):
            raise ParameterError(f"{what} must be True or False, got {value!r}")
        return value
    kind, bounds = get_args(hint)
    whole = kind is int
    noun = "a whole number" if whole else "a number"
    text = f"{what} must be {noun} in [{bounds.low:g}, {bounds.high:g}], got {value!r}"
    if isinstance(value, bool):
        raise ParameterError(text)
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ParameterError(text) from None
    if math.isnan(number) or not bounds.low <= number <= bounds.high or (whole and number != int(number)):
        raise ParameterError(text)
    return int(number) if whole else number
