"""Off-screen OpenGL without a display: EGL, else OSMesa, else an error that says what to install.

On Linux the contexts are made straight from `libEGL.so.1` and `libOSMesa.so.8`: MuJoCo's own wrappers choose one of
them by an environment variable at import, set another, and then cannot fall back. On macOS and Windows its wrappers
have no such limit and are used.

MuJoCo looks up OpenGL's functions once per process, in the first library that works: so one process keeps to one
library. A context is current only while something is drawn in it, so any thread may use it, one at a time.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from types import TracebackType
from typing import Any

from pftrack_sim.core.errors import RenderError, UnknownNameError
from pftrack_sim.render.gl.platforms import Platform, platform_of

BACKENDS = ("egl", "osmesa")
"""What a user may ask for by name."""

REMEDIES = """\
  Debian, Ubuntu:  apt-get install libegl1 libgl1 libgl1-mesa-dri     (EGL)
              or:  apt-get install libosmesa6                         (OSMesa)
  Fedora:          dnf install mesa-libEGL mesa-libGL mesa-dri-drivers
              or:  dnf install mesa-compat-libOSMesa
  macOS:           needs a session that may use the window server (CGL)
  Windows:         needs a graphics driver with OpenGL 1.5 or newer (WGL, by way of the package glfw)"""


@dataclass(frozen=True)
class GLInfo:
    """What draws.

    Attributes:
        backend: `"egl"`, `"osmesa"`, `"cgl"` or `"wgl"`.
        vendor: As OpenGL tells it.
        renderer: As OpenGL tells it; names the graphics card, or llvmpipe for software.
        version: OpenGL's version.
    """

    backend: str
    vendor: str
    renderer: str
    version: str


class GLContext:
    """One OpenGL context; `with context:` makes it current and afterwards gives the thread back what it had.

    Made by `open_context`. `close` it when done; using it afterwards is an error.
    """

    def __init__(self, platform: Platform, handle: Any) -> None:
        self._platform = platform
        self._handle = handle
        self._before: list[Any] = []
        self._pid = os.getpid()

    @property
    def backend(self) -> str:
        """Which library made it."""
        return self._platform.name

    @property
    def closed(self) -> bool:
        """Whether it has been freed."""
        return self._handle is None

    @property
    def usable(self) -> bool:
        """Whether it may be made current: neither closed nor inherited by a fork."""
        return self._handle is not None and self._pid == os.getpid()

    def __enter__(self) -> GLContext:
        if self._handle is None:
            raise RenderError("this renderer has been closed")
        if self._pid != os.getpid():
            raise RenderError(_FORKED)
        before = self._platform.current()
        self._platform.make_current(self._handle)
        self._before.append(before)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._platform.restore(self._before.pop())

    def close(self) -> None:
        """Free it; a second call does nothing."""
        handle, self._handle = self._handle, None
        # A forked child shares the parent's handles but not its driver threads: freeing there would hang.
        if handle is not None and self._pid == os.getpid():
            self._platform.destroy(handle)

    def info(self) -> GLInfo:
        """Vendor, renderer and version as OpenGL tells them."""
        with self:
            vendor, renderer, version = self._platform.strings()
        return GLInfo(self.backend, vendor, renderer, version)


def open_context(backend: str | None = None, size: tuple[int, int] = (640, 480)) -> GLContext:
    """A new off-screen OpenGL context that MuJoCo can draw in.

    Args:
        backend: One of `BACKENDS`; None takes the one this process already draws with, else EGL, else OSMesa (on macOS
            CGL and on Windows WGL).
        size: Width and height of the default buffer [px], for libraries that need one.

    Raises:
        UnknownNameError: No such backend.
        RenderError: None works; the message says why not and what to install.
    """
    wanted = candidates(backend)
    if forked():
        raise RenderError(_FORKED)
    if _process.backend is not None and backend not in (None, _process.backend):
        raise RenderError(
            f"this process already draws with {_process.backend}, and MuJoCo looks up OpenGL once per process: "
            f"use {backend} in a new one"
        )
    failures: dict[str, str] = {}
    for name in wanted if _process.backend is None else (_process.backend,):
        try:
            return _opened(name, size)
        except RenderError as error:
            failures[name] = str(error)
    tried = "\n".join(f"  {name}: {why}" for name, why in failures.items())
    raise RenderError(f"no OpenGL library could draw. Tried:\n{tried}\nInstall one of:\n{REMEDIES}")


def forked() -> bool:
    """Whether this process was forked from one that had drawn: OpenGL is there, but not to be had."""
    return _process.pid not in (None, os.getpid())


def probe(name: str) -> GLInfo:
    """What one of the `candidates` says of itself.

    Raises:
        RenderError: It cannot draw; the message says why, without a remedy.
    """
    context = _opened(name, (16, 16))
    try:
        return context.info()
    finally:
        context.close()


def candidates(backend: str | None = None) -> tuple[str, ...]:
    """Libraries to try on this system, in order.

    Raises:
        UnknownNameError: No such backend.
    """
    if backend is not None:
        if backend not in BACKENDS:
            raise UnknownNameError("OpenGL backend", backend, BACKENDS)
        return (backend,)
    if sys.platform == "darwin":
        return ("cgl",)
    if sys.platform == "win32":
        return ("wgl",)
    # Where the user has told MuJoCo which library to use, it looks up OpenGL's functions there: follow.
    asked = os.environ.get("MUJOCO_GL", "").strip().lower()
    return ("osmesa", "egl") if asked == "osmesa" else ("egl", "osmesa")


@dataclass
class _Process:
    """What this process has settled on."""

    backend: str | None = None
    pid: int | None = None


_process = _Process()
_FORKED = (
    "this process was forked from one that draws, and OpenGL does not survive a fork: start workers with "
    "multiprocessing's 'spawn' or 'forkserver' (AsyncVectorEnv: context='forkserver')"
)


def _opened(name: str, size: tuple[int, int]) -> GLContext:
    """A context of one backend, proven to work the first time this process makes one.

    Raises:
        RenderError: It does not work; the message says why, without a remedy.
    """
    try:
        platform = platform_of(name)
    except (OSError, AttributeError, ImportError) as error:
        raise RenderError(f"{error}") from error
    context = GLContext(platform, platform.create(size))
    if _process.backend is None:
        try:
            _prove(context)
        except BaseException:
            context.close()
            raise
        _process.backend, _process.pid = name, os.getpid()
    return context


def _prove(context: GLContext) -> None:
    """Let MuJoCo bind OpenGL in this context.

    Raises:
        RenderError: MuJoCo cannot.
    """
    import mujoco

    with context:
        try:
            mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), mujoco.mjtFontScale.mjFONTSCALE_50).free()
        except mujoco.FatalError as error:
            raise RenderError(f"MuJoCo cannot use it ({error})") from error
