"""Compiled kernels: one decorator, and one line on stderr where compiling takes long.

A kernel is a function of a concept (a gait, an avoidance, a histogram) over scalars, arrays and arrays of records.
Numba compiles it at its first call and keeps the machine code in `__pycache__`. Scalar loops compile in tenths of a
second; array expressions and slices inside a kernel take seconds. Numba's cache does not see changes in another module:
what a kernel calls, and its constants, are in its own.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit
from numba.core import event as numba_event

_Function = TypeVar("_Function", bound=Callable[..., Any])

_PATIENCE_S = 0.5


class _Notice(numba_event.Listener):
    """Says once per process that kernels are being compiled, as soon as that has taken half a second."""

    def __init__(self) -> None:
        self._timer: Any = numba_event.TimingListener()
        self.said = False

    def on_start(self, event: Any) -> None:
        if not _is_own(event):
            return
        if not self.said and self._timer.done and self._timer.duration > _PATIENCE_S:
            self.said = True
            print("pftrack_sim: compiling for this machine, once: about 10 s", file=sys.stderr, flush=True)  # noqa: T201
        self._timer.on_start(event)

    def on_end(self, event: Any) -> None:
        if _is_own(event):
            self._timer.on_end(event)


def _is_own(event: Any) -> bool:
    return str(event.data["dispatcher"].py_func.__module__).startswith("pftrack_sim.")


_notice = _Notice()
cast("Any", numba_event).register("numba:compile", _notice)


def compile_in_silence() -> None:
    """Say nothing of compiling in this process: another one does."""
    _notice.said = True


_njit = cast("Any", njit)


def kernel(function: _Function) -> _Function:
    """Compile a function at its first call and keep the machine code; a division by zero gives inf or NaN."""
    return _njit(cache=True, nogil=True, error_model="numpy", no_cfunc_wrapper=True)(function)


def part_of_kernel(function: _Function) -> _Function:
    """Compile a function that only kernels of its own module call, with the kernel."""
    return _njit(nogil=True, error_model="numpy", no_cfunc_wrapper=True, no_cpython_wrapper=True)(function)


def record_type(fields: Sequence[tuple[str, str]]) -> np.dtype[Any]:
    """Type of records for kernels: names and types of fields, which are attributes also where nothing is compiled."""
    return np.dtype((np.record, list(fields)))
