"""How EGL, OSMesa, CGL and WGL make an OpenGL context without a display."""

from __future__ import annotations

import ctypes
import importlib
from collections.abc import Callable
from typing import Any

from pftrack_sim.core.errors import RenderError

_EGL_DEVICE, _EGL_SURFACELESS, _EGL_OPENGL_API = 0x313F, 0x31DD, 0x30A2
# Red, green, blue, alpha: 8 bits; depth 24; stencil 8; surface type: pbuffer; renderable: OpenGL.
_EGL_CONFIG = (0x3024, 8, 0x3023, 8, 0x3022, 8, 0x3021, 8, 0x3025, 24, 0x3026, 8, 0x3033, 1, 0x3040, 8, 0x3038)
_EGL_DRAW, _EGL_READ = 0x3059, 0x305A
_MAX_DEVICES = 32
_OSMESA_RGBA, _GL_UNSIGNED_BYTE = 0x1908, 0x1401
_GL_STRINGS = (0x1F00, 0x1F01, 0x1F02)
"""OpenGL's names for vendor, renderer and version."""

_EGL_SIGNATURES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "eglGetProcAddress": (ctypes.c_void_p, (ctypes.c_char_p,)),
    "eglGetError": (ctypes.c_int, ()),
    "eglGetDisplay": (ctypes.c_void_p, (ctypes.c_void_p,)),
    "eglInitialize": (ctypes.c_uint, (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)),
    "eglBindAPI": (ctypes.c_uint, (ctypes.c_uint,)),
    "eglChooseConfig": (ctypes.c_uint, (ctypes.c_void_p, *(ctypes.c_void_p,) * 2, ctypes.c_int, ctypes.c_void_p)),
    "eglCreateContext": (ctypes.c_void_p, (ctypes.c_void_p,) * 4),
    "eglDestroyContext": (ctypes.c_uint, (ctypes.c_void_p,) * 2),
    "eglMakeCurrent": (ctypes.c_uint, (ctypes.c_void_p,) * 4),
    "eglGetCurrentContext": (ctypes.c_void_p, ()),
    "eglGetCurrentDisplay": (ctypes.c_void_p, ()),
    "eglGetCurrentSurface": (ctypes.c_void_p, (ctypes.c_int,)),
}
_OSMESA_SIGNATURES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "OSMesaGetProcAddress": (ctypes.c_void_p, (ctypes.c_char_p,)),
    "OSMesaCreateContextExt": (ctypes.c_void_p, (*(ctypes.c_int,) * 4, ctypes.c_void_p)),
    "OSMesaDestroyContext": (None, (ctypes.c_void_p,)),
    "OSMesaMakeCurrent": (ctypes.c_ubyte, (*(ctypes.c_void_p,) * 2, ctypes.c_uint, ctypes.c_int, ctypes.c_int)),
}


class Platform:
    """How one library makes contexts. Handles are whatever the library needs."""

    name: str

    def create(self, size: tuple[int, int]) -> Any:
        """A new context, not current."""
        raise NotImplementedError

    def destroy(self, handle: Any) -> None:
        """Free a context that is current nowhere."""
        raise NotImplementedError

    def make_current(self, handle: Any) -> None:
        """Draw in this context from now on, in this thread."""
        raise NotImplementedError

    def current(self) -> Any:
        """What is current in this thread, for `restore`."""
        return None

    def restore(self, before: Any) -> None:
        """Make current what was, or nothing."""
        raise NotImplementedError

    def strings(self) -> tuple[str, str, str]:
        """Vendor, renderer and version of the current context."""
        address = self.address(b"glGetString")
        vendor, renderer, version = (_gl_string(name, address) for name in _GL_STRINGS)
        return vendor, renderer, version

    def address(self, function: bytes) -> int | None:
        """Address of an OpenGL function."""
        return None


class Egl(Platform):
    """EGL on the first device that works, else on Mesa's surfaceless platform, else on the default display."""

    name = "egl"

    def __init__(self) -> None:
        self._library = _library(("libEGL.so.1", "libEGL.so"), _EGL_SIGNATURES)
        self._display = self._open_display()
        config, count = ctypes.c_void_p(), ctypes.c_int()
        wanted = (ctypes.c_int * len(_EGL_CONFIG))(*_EGL_CONFIG)
        egl = self._library
        if not egl.eglChooseConfig(self._display, wanted, ctypes.byref(config), 1, ctypes.byref(count)) or not count:
            raise RenderError("EGL has no configuration with OpenGL, 24 bits of depth and 8 of stencil")
        self._config = config
        self._shared = False

    def _open_display(self) -> int:
        egl = self._library
        displays: list[Callable[[], int | None]] = []
        address = egl.eglGetProcAddress(b"eglGetPlatformDisplayEXT")
        if address:
            of_platform = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p)(address)
            displays += [lambda d=device: of_platform(_EGL_DEVICE, d, None) for device in self._devices()]
            displays.append(lambda: of_platform(_EGL_SURFACELESS, None, None))
        displays.append(lambda: egl.eglGetDisplay(None))
        for open_one in displays:
            display = open_one()
            if display and egl.eglInitialize(display, None, None):
                return display
        raise RenderError(f"EGL found no device to draw on (error 0x{egl.eglGetError():x})")

    def _devices(self) -> list[int]:
        address = self._library.eglGetProcAddress(b"eglQueryDevicesEXT")
        if not address:
            return []
        query = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(address)
        found, count = (ctypes.c_void_p * _MAX_DEVICES)(), ctypes.c_int()
        if not query(_MAX_DEVICES, found, ctypes.byref(count)):
            return []
        return [device for device in found[: count.value] if device]

    def create(self, size: tuple[int, int]) -> int:
        """A new context, not current."""
        egl = self._library
        egl.eglBindAPI(_EGL_OPENGL_API)
        context = egl.eglCreateContext(self._display, self._config, None, None)
        if not context:
            raise RenderError(f"EGL could not create an OpenGL context (error 0x{egl.eglGetError():x})")
        if not self._shared:
            # Only a library that works may become visible to MuJoCo's look-up, or it would hide OSMesa behind it.
            _library(("libEGL.so.1", "libEGL.so"), _EGL_SIGNATURES, visible=True)
            self._shared = True
        return context

    def destroy(self, handle: int) -> None:
        """Free a context that is current nowhere."""
        self._library.eglDestroyContext(self._display, handle)

    def make_current(self, handle: int) -> None:
        """Draw in this context from now on, in this thread."""
        egl = self._library
        egl.eglBindAPI(_EGL_OPENGL_API)
        if not egl.eglMakeCurrent(self._display, None, None, handle):
            raise RenderError(
                f"EGL could not make the context current (error 0x{egl.eglGetError():x}); is another thread using it?"
            )

    def current(self) -> tuple[int | None, ...]:
        """What is current in this thread, for `restore`."""
        egl = self._library
        egl.eglBindAPI(_EGL_OPENGL_API)
        context = egl.eglGetCurrentContext()
        if not context:
            return (self._display, None, None, None)
        surfaces = egl.eglGetCurrentSurface(_EGL_DRAW), egl.eglGetCurrentSurface(_EGL_READ)
        return (egl.eglGetCurrentDisplay(), *surfaces, context)

    def restore(self, before: tuple[int | None, ...]) -> None:
        """Make current what was, or nothing."""
        self._library.eglMakeCurrent(*before)

    def address(self, function: bytes) -> int | None:
        """Address of an OpenGL function."""
        return self._library.eglGetProcAddress(function)


class OsMesa(Platform):
    """Mesa's off-screen interface: software drawing with no device, driver or display."""

    name = "osmesa"

    def __init__(self) -> None:
        names = ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so")
        # MuJoCo's look-up must see it, and find it before an EGL that did not work.
        self._library = _library(names, _OSMESA_SIGNATURES, visible=True)

    def create(self, size: tuple[int, int]) -> tuple[int, Any, tuple[int, int]]:
        """A new context, not current."""
        context = self._library.OSMesaCreateContextExt(_OSMESA_RGBA, 24, 8, 0, None)
        if not context:
            raise RenderError("OSMesa could not create a context")
        width, height = size
        return context, (ctypes.c_ubyte * (4 * width * height))(), (width, height)

    def destroy(self, handle: tuple[int, Any, tuple[int, int]]) -> None:
        """Free a context that is current nowhere."""
        self._library.OSMesaDestroyContext(handle[0])

    def make_current(self, handle: tuple[int, Any, tuple[int, int]]) -> None:
        """Draw in this context from now on, in this thread."""
        context, buffer, size = handle
        if not self._library.OSMesaMakeCurrent(context, buffer, _GL_UNSIGNED_BYTE, *size):
            raise RenderError("OSMesa could not make the context current")

    def restore(self, before: Any) -> None:
        """Make current what was, or nothing."""
        self._library.OSMesaMakeCurrent(None, None, _GL_UNSIGNED_BYTE, 0, 0)

    def address(self, function: bytes) -> int | None:
        """Address of an OpenGL function."""
        return self._library.OSMesaGetProcAddress(function)


class Native(Platform):
    """MuJoCo's own wrapper of CGL (macOS) or of a hidden GLFW window (Windows)."""

    def __init__(self, name: str) -> None:
        self.name = name
        module = importlib.import_module("mujoco.cgl" if name == "cgl" else "mujoco.glfw")
        self._make: Any = module.GLContext

    def create(self, size: tuple[int, int]) -> Any:
        """A new context, not current."""
        try:
            return self._make(*size)
        except Exception as error:
            raise RenderError(f"{self.name} could not create a context ({error})") from error

    def destroy(self, handle: Any) -> None:
        """Free a context that is current nowhere."""
        handle.free()

    def make_current(self, handle: Any) -> None:
        """Draw in this context from now on, in this thread."""
        handle.make_current()

    def restore(self, before: Any) -> None:
        """Nothing: neither wrapper can tell what was current before."""

    def strings(self) -> tuple[str, str, str]:
        """Vendor, renderer and version of the current context."""
        gl = importlib.import_module("OpenGL.GL")
        vendor, renderer, version = ((gl.glGetString(name) or b"unknown").decode() for name in _GL_STRINGS)
        return vendor, renderer, version


_platforms: dict[str, Platform] = {}


def platform_of(name: str) -> Platform:
    """The one instance per process: a display is opened once and lasts as long as the process."""
    if name not in _platforms:
        _platforms[name] = Egl() if name == "egl" else OsMesa() if name == "osmesa" else Native(name)
    return _platforms[name]


def _load(name: str, mode: int) -> ctypes.CDLL:
    """Load a shared library; in one place, so that a test can hide them all."""
    return ctypes.CDLL(name, mode=mode)


def _library(
    names: tuple[str, ...], signatures: dict[str, tuple[Any, tuple[Any, ...]]], *, visible: bool = False
) -> ctypes.CDLL:
    """The first library that loads, its functions typed.

    Args:
        names: File names, tried in order.
        signatures: Result type and argument types by function.
        visible: Whether its symbols are visible to the whole process.

    Raises:
        RenderError: None loads.
    """
    for name in names:
        try:
            library = _load(name, ctypes.RTLD_GLOBAL if visible else ctypes.RTLD_LOCAL)
        except OSError:
            continue
        for function, (result, arguments) in signatures.items():
            pointer = getattr(library, function)
            pointer.restype, pointer.argtypes = result, arguments
        return library
    raise RenderError(f"{names[0]} is not installed")


def _gl_string(name: int, address: int | None) -> str:
    """What `glGetString` says in the current context."""
    if not address:
        return "unknown"
    text = ctypes.CFUNCTYPE(ctypes.c_char_p, ctypes.c_uint)(address)(name)
    return text.decode(errors="replace") if text else "unknown"
