"""Registry of factories: built-in ones, those of installed packages, and any `package.module:factory`.

Installed packages announce theirs in an entry-point group. A built-in name cannot be taken.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, Generic, TypeVar

from pftrack_sim.core.code_digest import code_digest
from pftrack_sim.core.errors import ParameterError, PftrackError, UnknownNameError, did_you_mean
from pftrack_sim.core.inputs import is_file
from pftrack_sim.core.text import describe_error, locate_error

T = TypeVar("T")


@dataclass(frozen=True)
class BuiltIn(Generic[T]):
    """A factory of this package, its description in one line, and the dotted name of the module with its code."""

    factory: Callable[..., T]
    description: str
    module: str


@dataclass(frozen=True)
class Registry(Generic[T]):
    """Factories of one interface by name.

    Attributes:
        kind: What the factories make, for messages: `"tracker"`.
        group: Entry-point group of third-party factories.
        error_type: Raised when a third-party factory cannot be loaded, fails, or makes something else.
        interface: Runtime-checkable protocol that every product must satisfy.
        methods: The protocol's methods, for messages.
        builtin: Built-in factories by name.
    """

    kind: str
    group: str
    error_type: type[PftrackError]
    interface: type[Any]
    methods: tuple[str, ...]
    builtin: Mapping[str, BuiltIn[T]]

    def names(self) -> list[str]:
        """All names, sorted: built-in and installed."""
        return sorted({*self.builtin, *self._installed()})

    def describe(self, name: str) -> str:
        """Description of one of `names()` in one line; raises `UnknownNameError` for another name."""
        if name in self.builtin:
            return self.builtin[name].description
        installed = self._installed()
        if name not in installed:
            raise self._unknown(name)
        return f"installed {self.kind} {installed[name].value}"

    def make(self, name: str, params: Mapping[str, Any], **always: Any) -> T:
        """Call a factory.

        Args:
            name: One of `names()`, or `package.module:factory`.
            params: The user's parameters for the factory.
            always: Arguments that every factory of this registry takes.

        Raises:
            UnknownNameError: No such name.
            ParameterError: The factory has no such parameter, or refuses its value.
            PftrackError: Of `error_type`: a third-party factory cannot be loaded, fails, or makes something else.
        """
        factory = self.factory(name)
        self._check_arguments(name, factory, params, always)
        try:
            product = factory(**always, **params)
        except PftrackError:
            raise
        except Exception as error:
            raise self.error_type(
                f"{self.kind} {name!r} could not be made: {describe_error(error)}{locate_error(error)}"
            ) from error
        if not isinstance(product, self.interface):
            methods, made = " and ".join(self.methods), type(product).__name__
            raise self.error_type(f"{self.kind} {name!r}: its factory must make an object with {methods}, got {made}")
        return product

    def factory(self, name: str) -> Callable[..., T]:
        """The factory itself, imported.

        Raises:
            UnknownNameError: No such name.
            PftrackError: Of `error_type`: it cannot be loaded.
        """
        return self.builtin[name].factory if name in self.builtin else self._load(name)

    def code_digest(self, name: str) -> str:
        """Digest of a factory's code, see `core.code_digest`; of a built-in one, what it imports from its own room."""
        if name in self.builtin:
            module = self.builtin[name].module
            return code_digest(module, own=".".join(module.split(".")[:2]))
        return code_digest(self._path(name).partition(":")[0].strip())

    def _path(self, name: str) -> str:
        """`package.module:factory` of a third-party factory."""
        installed = self._installed()
        if name not in installed and ":" not in name:
            raise self._unknown(name)
        return installed[name].value if name in installed else name

    def _unknown(self, name: str) -> PftrackError:
        if name.endswith(".py") or is_file(Path(f"{name}.py")):
            example = f"{_module_of(name)}:make"
            return self.error_type(f"{self.kind} {name!r}: expected module:factory, for example {example}")
        return UnknownNameError(self.kind, name, self.names(), hint="; one of your own: package.module:factory")

    def _installed(self) -> dict[str, EntryPoint]:
        return {point.name: point for point in entry_points(group=self.group) if point.name not in self.builtin}

    def _load(self, name: str) -> Callable[..., Any]:
        """Import a third-party factory, given its entry-point name or `package.module:factory`."""
        path = self._path(name)
        failure = f"{self.kind} {name!r} cannot be loaded"
        module_name, _, attribute = path.partition(":")
        module_name, attribute = module_name.strip(), attribute.partition("[")[0].strip()
        near = f"; did you mean '{_module_of(module_name)}:{attribute}'?" if module_name.endswith(".py") else ""
        if not module_name or not attribute:
            raise self.error_type(f"{failure}: expected package.module:factory")
        try:
            target: Any = importlib.import_module(module_name)
        except Exception as error:
            raise self.error_type(f"{failure}: {describe_error(error)}{locate_error(error)}{near}") from error
        for part in attribute.split("."):
            if not hasattr(target, part):
                near = did_you_mean(part, [key for key in dir(target) if not key.startswith("_")])
                raise self.error_type(f"{failure}: {module_name} has no {attribute!r}{near}")
            target = getattr(target, part)
        if not callable(target):
            raise self.error_type(f"{failure}: {path} is no factory, it cannot be called")
        return target

    def _check_arguments(
        self, name: str, factory: Callable[..., Any], params: Mapping[str, Any], always: Mapping[str, Any]
    ) -> None:
        try:
            signature = inspect.signature(factory)
        except (TypeError, ValueError):
            return  # a compiled factory without a signature: the call itself reports wrong arguments
        try:
            signature.bind_partial(**always)
        except TypeError as error:
            takes = ", ".join(always)
            raise self.error_type(f"{self.kind} {name!r}: its factory must take ({takes}, **params): {error}") from None
        parameters = signature.parameters
        if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values()):
            return
        allowed = sorted({*parameters} - {*always})
        for key in params:
            if key not in allowed:
                listed = ", ".join(allowed) or "none"
                raise ParameterError(
                    f"{self.kind} {name!r} has no parameter {key!r}{did_you_mean(key, allowed)} (allowed: {listed})"
                )


def _module_of(file: str) -> str:
    """The module that a file holds, seen from the working folder."""
    return file.removesuffix(".py").replace("/", ".").strip(".")
