"""Factories of strangers: entry points of installed packages, or spelled out as `package.module:factory`."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Container
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from pftrack_sim.errors import PftrackError, did_you_mean


def installed(group: str, taken: Container[str]) -> dict[str, EntryPoint]:
    """What installed packages announce, by name.

    Args:
        group: The entry-point group.
        taken: Names of ours, which nobody else can have.
    """
    return {point.name: point for point in entry_points(group=group) if point.name not in taken}


def load(kind: str, name: str, spelled: str, error_type: type[PftrackError]) -> Callable[..., Any]:
    """The factory behind `package.module:factory`.

    Args:
        kind: What it makes, for the message: `"tracker"`.
        name: What the user asked for.
        spelled: Module and factory.
        error_type: Raised when there is no such factory.
    """
    module_name, _, attribute = spelled.partition(":")
    module_name, attribute = module_name.strip(), attribute.partition("[")[0].strip()
    if not module_name or not attribute:
        raise error_type(f"{kind} {name!r} cannot be loaded: expected package.module:factory")
    try:
        found: Any = importlib.import_module(module_name)
    except Exception as error:
        raise error_type(f"{kind} {name!r} cannot be loaded: {type(error).__name__}: {error}") from error
    for part in attribute.split("."):
        if not hasattr(found, part):
            near = did_you_mean(part, [one for one in dir(found) if not one.startswith("_")])
            raise error_type(f"{kind} {name!r} cannot be loaded: {module_name} has no {attribute!r}{near}")
        found = getattr(found, part)
    if not callable(found):
        raise error_type(f"{kind} {name!r} cannot be loaded: {spelled} is no factory, it cannot be called")
    return found
