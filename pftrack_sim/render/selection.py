"""Which renderer draws: OpenGL where a library loads, else MuJoCo Warp's ray caster where it is installed."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from pftrack_sim.core.errors import RenderError, UnknownNameError
from pftrack_sim.render.backend import Renderer
from pftrack_sim.render.gl.context import BACKENDS, REMEDIES, forked, open_context

NAMES = ("gl", *BACKENDS, "warp")
"""What a user may ask for: any OpenGL library, a certain one, or the ray caster."""

WARP_REMEDY = """\
  anywhere:        pip install 'pftrack-sim[warp]'     (no OpenGL: a ray caster, slower, 400 MB)"""


def check_name(backend: str | None) -> None:
    """Refuse what no renderer is called.

    Raises:
        UnknownNameError: No such renderer.
    """
    if backend is not None and backend not in NAMES:
        raise UnknownNameError("renderer", backend, NAMES)


def warp_installed() -> bool:
    """Whether the extra is there; nothing of it is imported."""
    return all(find_spec(name) is not None for name in ("mujoco_warp", "warp"))


def open_renderer(model: Any, width_px: int, height_px: int, backend: str | None = None) -> Renderer:
    """A renderer of a model.

    Args:
        model: What to draw.
        width_px: Image width.
        height_px: Image height.
        backend: One of `NAMES`; None takes OpenGL where a library loads, else the ray caster where it is installed.

    Raises:
        UnknownNameError: No such renderer.
        RenderError: It cannot draw here; the message says what to install.
    """
    check_name(backend)
    if backend == "warp":
        return _warp(model, width_px, height_px)
    try:
        # A first look without the model: what OpenGL says of the model itself is no reason to turn to another renderer.
        open_context(None if backend == "gl" else backend, (16, 16)).close()
    except RenderError as error:
        if forked():
            # Other pixels than the parent's, without a word, would be no help.
            raise
        if backend is None and warp_installed():
            return _warp(model, width_px, height_px)
        raise RenderError(f"{error}\nor, without OpenGL:\n{WARP_REMEDY}") from error
    from pftrack_sim.render.gl.rasteriser import Rasteriser

    return Rasteriser(model, width_px, height_px, None if backend == "gl" else backend)


def _warp(model: Any, width_px: int, height_px: int) -> Renderer:
    if not warp_installed():
        raise RenderError(
            f"the renderer warp is not installed. Install it:\n{WARP_REMEDY}\nor OpenGL, one of:\n{REMEDIES}"
        )
    from pftrack_sim.render.warp.raycaster import Raycaster

    return Raycaster(model, width_px, height_px)
