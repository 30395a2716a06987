"""Whether a function reads one of its arguments."""

from __future__ import annotations

import dis
import inspect
from collections.abc import Callable
from typing import Any

_READS_ALL = {"locals", "vars", "eval", "exec", "_getframe", "currentframe", "stack"}
"""Names by which code may read arguments that it does not name."""


def ignores_argument(function: Callable[..., Any], name: str) -> bool:
    """Whether a function never reads a keyword argument, so that what it returns cannot depend on it.

    Args:
        function: A Python function, or a class with an `__init__` of its own; anything else may read it.
        name: A parameter of the function, or one that its `**` parameter takes.

    >>> ignores_argument(lambda *, seed: 1, "seed"), ignores_argument(lambda *, seed: seed + 1, "seed")
    (True, False)
    >>> ignores_argument(lambda **more: 1, "seed"), ignores_argument(lambda **more: dict(**more), "seed")
    (True, False)
    """
    if type(function) is type and function.__new__ is object.__new__:
        function = function.__init__
    if not inspect.isfunction(function):
        return False
    code = function.__code__
    named = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
    if name not in named:
        if not code.co_flags & inspect.CO_VARKEYWORDS:
            return False
        name = code.co_varnames[len(named) + bool(code.co_flags & inspect.CO_VARARGS)]
    if _READS_ALL & {*code.co_names}:
        return False
    # A name in two of three operands of one instruction counts too.
    used = (one.argval for one in dis.get_instructions(code))
    return not any(one == name or (isinstance(one, tuple) and name in one) for one in used)
