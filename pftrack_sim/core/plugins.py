"""Names of ours and of strangers: entry points of installed packages, or spelled out as `package.module:factory`."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from pftrack_sim.core.errors import PftrackError, UnknownNameError, did_you_mean


@dataclass(frozen=True)
class Names:
    """One kind of thing that can be had by name.

    Attributes:
        kind: What it is, for messages: `"tracker"`.
        group: The entry-point group in which packages announce theirs.
        error_type: Raised where a stranger's factory cannot be loaded, or fails.
        ours: Names of ours with one line on each; nobody else can have them.
    """

    kind: str
    group: str
    error_type: type[PftrackError]
    ours: Mapping[str, str]

    def all(self) -> list[str]:
        """Every name, sorted: ours and those of installed packages."""
        return sorted({*self.ours, *self._installed()})

    def describe(self, name: str) -> str:
        """What it is, in one line.

        Raises:
            UnknownNameError: No such name.
        """
        if name in self.ours:
            return self.ours[name]
        installed = self._installed()
        if name not in installed:
            raise UnknownNameError(self.kind, name, self.all())
        return f"installed {self.kind} {installed[name].value}"

    def load(self, name: str) -> Callable[..., Any]:
        """The factory of a stranger, announced by a package or spelled out.

        Raises:
            UnknownNameError: No such name.
            PftrackError: It cannot be loaded; of the type `error_type`.
        """
        installed = self._installed()
        if name not in installed and ":" not in name:
            raise UnknownNameError(self.kind, name, self.all())
        return load(self.kind, name, installed[name].value if name in installed else name, self.error_type)

    def call(self, name: str, factory: Callable[..., Any], **arguments: Any) -> Any:
        """What a factory makes.

        Raises:
            PftrackError: As the factory raised it, or of the type `error_type` for anything else that it raised.
        """
        try:
            return factory(**arguments)
        except PftrackError:
            raise
        except Exception as error:
            says = f"{type(error).__name__}: {error}"
            raise self.error_type(f"{self.kind} {name!r} could not be made: {says}") from error

    def _installed(self) -> dict[str, EntryPoint]:
        return {point.name: point for point in entry_points(group=self.group) if point.name not in self.ours}


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
