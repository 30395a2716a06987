"""Making an EGL context current by EGL's own functions.

`mujoco.egl` does it through PyOpenGL, whose checks and conversions take ten times as long as the calls, in every frame.
"""

from __future__ import annotations

import ctypes
import sys
from contextlib import AbstractContextManager
from typing import Any

EGL_LIBRARY = "libEGL.so.1"
_DRAW, _READ = 0x3059, 0x305A
_HANDLE = ctypes.c_void_p


class EGLBinding:
    """Makes one context of `mujoco.egl` current and restores the one before.

    Args:
        context: A `mujoco.egl.GLContext`.
    """

    def __init__(self, context: Any) -> None:
        self._module: Any = sys.modules["mujoco.egl"]
        self._display = ctypes.cast(self._module.EGL_DISPLAY, _HANDLE).value
        self._context = ctypes.cast(context._context, _HANDLE).value
        self._make_current = _function("eglMakeCurrent", ctypes.c_uint, _HANDLE, _HANDLE, _HANDLE, _HANDLE)
        self._current_context = _function("eglGetCurrentContext", _HANDLE)
        self._current_display = _function("eglGetCurrentDisplay", _HANDLE)
        self._current_surface = _function("eglGetCurrentSurface", _HANDLE, ctypes.c_int)

    def as_current(self) -> AbstractContextManager[None]:
        """Make it current in this thread, and restore the thread's previous context at the end.

        Raises:
            RuntimeError: It is current in another thread.
        """
        return _Bound(self)

    def bind(self) -> tuple[Any, ...] | None:
        """Make it current; what `restore` takes, None where nothing is to be restored."""
        before = self._current_context()
        # Without a display, `mujoco.egl` has ended it: at the exit of the interpreter, everything is freed already.
        if before == self._context or self._module.EGL_DISPLAY is None:
            return None
        place = (
            (self._current_display(), self._current_surface(_DRAW), self._current_surface(_READ))
            if before
            else (self._display, None, None)
        )
        if not self._make_current(self._display, None, None, self._context):
            raise RuntimeError("eglMakeCurrent failed")
        return *place, before

    def restore(self, before: tuple[Any, ...]) -> None:
        """Make current what was so before `bind`."""
        if self._module.EGL_DISPLAY is not None:
            self._make_current(*before)


class _Bound(AbstractContextManager[None]):
    """A block of `EGLBinding.as_current`; not a generator, which takes five times as long."""

    def __init__(self, binding: EGLBinding) -> None:
        self._binding = binding

    def __enter__(self) -> None:
        self._before = self._binding.bind()

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            self._binding.restore(self._before)


def _function(name: str, result: Any, *arguments: Any) -> Any:
    # Not by PyOpenGL's platform, which is another library's where OSMesa was tried after an EGL that failed.
    return ctypes.CFUNCTYPE(result, *arguments)((name, ctypes.CDLL(EGL_LIBRARY)))
