"""Choice of the renderer: OpenGL where a library can draw, else MuJoCo Warp's ray caster where it is installed."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from pftrack_sim.core.errors import RenderError, UnknownNameError
from pftrack_sim.render.backend import Renderer
from pftrack_sim.render.gl.context import BACKENDS, INSTALL_HINTS, forked, open_context

NAMES = ("gl", *BACKENDS, "warp")  # Names of the renderers: any OpenGL library, one of them, or the ray caster

WARP_INSTALL_HINT = """\
  anywhere:        pip install 'pftrack-sim[warp]'     (no OpenGL: a ray caster, slower, 400 MB)"""


def check_name(backend: str | None) -> None:
    """Raise `UnknownNameError` if there is no such renderer; None is one."""
    if backend is not None and backend not in NAMES:
        raise UnknownNameError("renderer", backend, NAMES)


def warp_installed() -> bool:
    """Whether the extra `warp` is installed; nothing of it is imported."""
    return all(find_spec(name) is not None for name in ("mujoco_warp", "warp"))


def open_renderer(model: Any, width_px: int, height_px: int, backend: str | None = None) -> Renderer:
    """Open a renderer of a model with an image of this width and height.

    Args:
        model: What to draw.
        width_px: Image width.
        height_px: Image height.
        backend: One of `NAMES`; None takes OpenGL where a library can draw, else the ray caster where it is installed.

    Raises:
        UnknownNameError: No such renderer.
        RenderError: It cannot draw here; the message says what to install.
    """
    check_name(backend)
    if backend == "warp":
        return _open_raycaster(model, width_px, height_px)
    try:
        context = open_context(None if backend == "gl" else backend, (width_px, height_px))
    except RenderError as error:
        if forked():
            raise  # the ray caster would draw other pixels here than the parent process
        if backend is None and warp_installed():
            return _open_raycaster(model, width_px, height_px)
        raise RenderError(f"{error}\nor, without OpenGL:\n{WARP_INSTALL_HINT}") from error
    from pftrack_sim.render.gl.rasteriser import Rasteriser

    return Rasteriser(model, width_px, height_px, context)


def open_id_renderer(model: Any, width_px: int, height_px: int) -> Renderer:
    """Open a renderer of ids and depths alone, which needs no OpenGL."""
    from pftrack_sim.render.id_rasteriser import IdRasteriser  # numba: imported when it is used

    return IdRasteriser(model, width_px, height_px)


def _open_raycaster(model: Any, width_px: int, height_px: int) -> Renderer:
    if not warp_installed():
        raise RenderError(
            f"the renderer warp is not installed. Install it:\n{WARP_INSTALL_HINT}\nor OpenGL, one of:\n{INSTALL_HINTS}"
        )
    from pftrack_sim.render.warp.raycaster import Raycaster

    return Raycaster(model, width_px, height_px)
