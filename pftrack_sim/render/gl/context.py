"""Off-screen OpenGL contexts for MuJoCo: EGL, else OSMesa; CGL on macOS, GLFW on Windows.

The contexts are MuJoCo's own (`mujoco.egl`, `mujoco.osmesa`, `mujoco.cgl`, `mujoco.glfw`). This module adds what they
lack: it tries one library after the other, names a shared library that is missing, leaves environment variables as
they were, detects a fork, and shares one context among all that draw in a thread.

MuJoCo loads OpenGL's functions once per process, so that a process uses a single OpenGL library.
"""

from __future__ import annotations

import ctypes
import importlib
import os
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import mujoco

from pftrack_sim.core.errors import RenderError

BACKENDS = ("egl", "osmesa")  # OpenGL libraries that can be asked for by name

INSTALL_HINTS = """\
  Debian, Ubuntu:  apt-get install libegl1 libgl1 libgl1-mesa-dri     (EGL)
              or:  apt-get install libosmesa6                         (OSMesa)
  Fedora:          dnf install mesa-libEGL mesa-libGL mesa-dri-drivers
              or:  dnf install mesa-compat-libOSMesa
  macOS:           needs a session that may use the window server (CGL)
  Windows:         needs a graphics driver with OpenGL 1.5 or newer (GLFW)"""

_SHARED_LIBRARIES: dict[str, tuple[tuple[str, ...], ...]] = {
    "egl": (("libEGL.so.1",), ("libGL.so.1", "libOpenGL.so.0")),
    "osmesa": (("libOSMesa.so.8", "libOSMesa.so.6"),),
}
"""What each backend loads on Linux: one file of each group."""

_FORKED = (
    "this process was forked from one that draws, and OpenGL does not survive a fork: start workers with "
    "multiprocessing's 'spawn' or 'forkserver' (AsyncVectorEnv: context='forkserver')"
)
_GL_VENDOR, _GL_RENDERER, _GL_VERSION = 0x1F00, 0x1F01, 0x1F02
_SIZE = (16, 16)  # Default framebuffer, which some libraries need, and in which nothing is drawn [px]


@dataclass(frozen=True)
class OpenGLInfo:
    """An OpenGL library: its backend name, and vendor, renderer (graphics card or llvmpipe) and version it reports."""

    backend: str
    vendor: str
    renderer: str
    version: str


class GLContext:
    """One OpenGL context, made by `open_context`. Any thread may use it; others wait for it meanwhile.

    Attributes:
        info: The OpenGL library.
    """

    def __init__(self, context: Any, info: OpenGLInfo) -> None:
        self.info = info
        self._context: Any = context
        self._pid = os.getpid()
        self._lock = threading.RLock()
        self._left: list[Callable[[], None]] = []

    @property
    def closed(self) -> bool:
        """Whether it has been freed."""
        return self._context is None

    @property
    def usable(self) -> bool:
        """Whether it is neither closed nor inherited through a fork."""
        return not self.closed and self._pid == os.getpid()

    @contextmanager
    def current(self) -> Generator[None]:
        """Make it current in this thread, and restore the thread's previous context at the end; blocks may be nested.

        Raises:
            RenderError: It is closed or inherited through a fork.
        """
        if self.closed:
            raise RenderError("this renderer has been closed")
        if not self.usable:
            raise RenderError(_FORKED)
        outer = getattr(_thread, "context", None)
        if outer is self:
            yield
            return
        with self._lock, ExitStack() as stack:
            try:
                stack.enter_context(self._context.as_current())
            except Exception as error:  # PyOpenGL and the four backends each raise types of their own
                raise RenderError(f"the OpenGL context is not available: {error}") from error
            _thread.context = self
            try:
                while self._left:
                    self._left.pop()()
                yield
            finally:
                _thread.context = outer

    def free_soon(self, free: Callable[[], None]) -> None:
        """Call what frees memory of this context: now, or before it next draws where it is in use.

        It never waits for another thread, as a garbage collection may call it at any place.
        """
        self._left.append(free)
        if self.usable and self._lock.acquire(blocking=False):
            try:
                with self.current():
                    pass
            finally:
                self._lock.release()

    def close(self) -> None:
        """Free it; a second call does nothing."""
        if self.usable:
            self._context.free()
        self._context = None


def open_context(backend: str | None = None) -> GLContext:
    """The off-screen OpenGL context of this thread for MuJoCo, which is opened when it is first asked for.

    It stays open as long as the thread lives or something draws with it: a new one compiles its shaders anew, which
    takes software OpenGL longer than a reset.

    Args:
        backend: One of `BACKENDS`; None takes the library this process already uses, else the first of `candidates`
            that works.

    Raises:
        RenderError: No library works; the message gives the reasons and what to install.
    """
    if forked():
        raise RenderError(_FORKED)
    if _process.backend is not None and backend not in (None, _process.backend):
        raise RenderError(
            f"this process already draws with {_process.backend}, and MuJoCo loads OpenGL once per process: "
            f"use {backend} in a new one"
        )
    kept: GLContext | None = getattr(_thread, "kept", None)
    if kept is not None and kept.usable:
        return kept
    failures: dict[str, RenderError] = {}
    wanted = backend or _process.backend
    for name in candidates() if wanted is None else (wanted,):
        try:
            _thread.kept = opened = _open(name)
        except RenderError as error:
            failures[name] = error
        else:
            return opened
    tried = "\n".join(f"  {name}: {error}" for name, error in failures.items())
    raise RenderError(f"no OpenGL library can draw. Tried:\n{tried}\nInstall one of:\n{INSTALL_HINTS}")


def candidates() -> tuple[str, ...]:
    """Backends to try on this system, in order."""
    if sys.platform == "darwin":
        return ("cgl",)
    if sys.platform == "win32":
        return ("glfw",)
    return ("osmesa", "egl") if os.environ.get("MUJOCO_GL", "").strip().lower() == "osmesa" else ("egl", "osmesa")


def forked() -> bool:
    """Whether this process was forked from one that had opened a context."""
    return _process.pid not in (None, os.getpid())


def probe(backend: str) -> OpenGLInfo:
    """Open and close a context of one of the `candidates`; `RenderError` is the reason why it cannot draw."""
    context = _open(backend)
    context.close()
    return context.info


@dataclass
class _Process:
    """The OpenGL library that this process uses, and its process id when it opened the first context."""

    backend: str | None = None
    pid: int | None = None


_process = _Process()
_thread = threading.local()
"""Its `context` is the one that a block of `GLContext.current` has made current in this thread; `kept` stays open."""
_opening = threading.Lock()


def _open(backend: str) -> GLContext:
    for files in _SHARED_LIBRARIES.get(backend, ()):
        # PyOpenGL would report a missing library only as an attribute that None lacks.
        if not any(_loads(file) for file in files):
            raise RenderError(f"{files[0]} is not installed")
    if _process.backend is None:
        _import_triton()
    # `mujoco.egl` and `mujoco.osmesa` set PYOPENGL_PLATFORM for the whole process. MuJoCo needs MUJOCO_GL where both
    # libraries are loaded: after an EGL without a device it would otherwise not find OSMesa.
    # The lock keeps threads from restoring each other's values.
    with _opening, _environment({"PYOPENGL_PLATFORM": backend, "MUJOCO_GL": backend} if backend in BACKENDS else {}):
        try:
            context = _backend_module(backend).GLContext(*_SIZE)
            with context.as_current():
                if _process.backend is None:
                    # The first context of a process binds MuJoCo to OpenGL: make sure that it works.
                    empty = mujoco.MjModel.from_xml_string("<mujoco/>")
                    mujoco.MjrContext(empty, mujoco.mjtFontScale.mjFONTSCALE_50).free()
                info = OpenGLInfo(backend, *(_gl_string(name) for name in (_GL_VENDOR, _GL_RENDERER, _GL_VERSION)))
        except Exception as error:  # PyOpenGL and the four backends each raise types of their own
            raise RenderError(f"{error}") from error
    if _process.backend is None:
        _process.backend, _process.pid = backend, os.getpid()
        if backend == "egl":
            os.register_at_fork(after_in_child=_forget_egl_display)
    return GLContext(context, info)


def _import_triton() -> None:
    """Import Triton before Mesa where PyTorch is loaded, which imports it when it makes an optimiser.

    Both bring an LLVM; Triton's, loaded as the second, ends the process with a segmentation fault.
    """
    if "torch" in sys.modules:
        with suppress(ImportError):
            importlib.import_module("triton")


def _forget_egl_display() -> None:
    """Keep MuJoCo from terminating the display in a forked child at its exit: without the driver's threads it hangs."""
    sys.modules["mujoco.egl"].EGL_DISPLAY = None  # pyright: ignore[reportAttributeAccessIssue]


def _loads(file_name: str) -> bool:
    try:
        ctypes.CDLL(file_name)
    except OSError:
        return False
    return True


@contextmanager
def _environment(variables: dict[str, str]) -> Generator[None]:
    """Set environment variables and restore them afterwards."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _backend_module(backend: str) -> Any:
    """MuJoCo's module of a backend."""
    module = f"mujoco.{backend}"
    if backend in BACKENDS and module not in sys.modules:
        # PyOpenGL is bound to one library when it is first imported, even if that library cannot draw: import it anew.
        for name in [name for name in sys.modules if name.partition(".")[0] == "OpenGL"]:
            del sys.modules[name]
    return importlib.import_module(module)


def gl_function(name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
    """A function of OpenGL in the current context, without PyOpenGL's own, whose import takes 0.15 s."""
    library = importlib.import_module("OpenGL.platform").PLATFORM.GL
    return ctypes.CFUNCTYPE(result, *arguments)((name, library))


def _gl_string(name: int) -> str:
    text = gl_function("glGetString", ctypes.c_char_p, ctypes.c_uint)(name)
    return text.decode(errors="replace") if text else "unknown"
