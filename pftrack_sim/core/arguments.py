"""Check the arguments of public functions against their annotations, so that a wrong one is one clear error."""

from __future__ import annotations

import functools
import inspect
import re
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Any, Literal, ParamSpec, TypeVar

import numpy as np

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.text import one_line

P = ParamSpec("P")
R = TypeVar("R")

_NUMBERS: dict[Any, Any] = {float: Real, int: Integral, bool: np.bool_}  # those of NumPy, too


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """The function, with a ParameterError for an argument that is not of the type that it is annotated with.

    Elements of sequences, mappings and tuples count; those of iterators, which can be read only once, do not.
    """
    signature = inspect.signature(function)

    @functools.wraps(function)
    def called(*args: P.args, **kwargs: P.kwargs) -> R:
        hints = _hints(function)
        for name, value in signature.bind(*args, **kwargs).arguments.items():
            if not _fits(value, hints.get(name, Any)):
                wanted = re.sub(r"[\w.]+\.(?=\w)", "", inspect.formatannotation(hints[name]))
                raise ParameterError(f"{name} must be {wanted}, got {one_line(repr(value), 60)}")
        return function(*args, **kwargs)

    return called


@functools.cache
def _hints(function: Callable[..., Any]) -> dict[str, Any]:
    return typing.get_type_hints(function)


def _fits(value: object, wanted: Any) -> bool:
    if wanted is Any:
        return True
    origin, inner = typing.get_origin(wanted), typing.get_args(wanted)
    if origin in (typing.Union, UnionType):
        return any(_fits(value, one) for one in inner)
    if origin is Literal:
        return any(_fits(value, type(one)) for one in inner)  # its own error names those that are allowed
    if origin in (Sequence, Iterable, tuple):
        elements = inner if origin is tuple and ... not in inner else None
        whole = isinstance(value, (Sequence, np.ndarray))
        if isinstance(value, (str, bytes)) or not (whole or (origin is Iterable and isinstance(value, Iterable))):
            return False
        if not whole:
            return True
        listed = list(typing.cast("Sequence[object]", value))
        pairs = zip(listed, elements or inner[:1] * len(listed), strict=False)
        return (elements is None or len(listed) == len(elements)) and all(_fits(*pair) for pair in pairs)
    if origin is Mapping:
        return isinstance(value, Mapping) and all(
            _fits(key, inner[0]) and _fits(one, inner[1])
            for key, one in typing.cast("Mapping[object, object]", value).items()
        )
    kind = NoneType if wanted is None else origin or wanted
    if kind in _NUMBERS:
        return isinstance(value, (kind, _NUMBERS[kind])) and (kind is bool or not isinstance(value, bool))
    return not isinstance(kind, type) or isinstance(value, kind)
