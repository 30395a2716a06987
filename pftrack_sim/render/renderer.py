"""What draws colour images: the interface, and the choice between OpenGL and MuJoCo Warp's ray caster."""

from __future__ import annotations

from abc import ABC, abstractmethod
from importlib.util import find_spec
from typing import Any, Self

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import ParameterError, RenderError, UnknownNameError
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.render.gl.context import BACKENDS, INSTALL_HINTS, forked, open_context
from pftrack_sim.scene.layout import PEOPLE_GROUP, ROBOT_GROUP, SCENERY_GROUP, SKY

NAMES = ("gl", *BACKENDS, "warp")  # Names of the renderers: any OpenGL library, one of them, or the ray caster

WARP_INSTALL_HINT = """\
  anywhere:        pip install 'pftrack-sim[warp]'     (no OpenGL: a ray caster, slower, 400 MB)"""

DRAWN_GROUPS = (SCENERY_GROUP, PEOPLE_GROUP, ROBOT_GROUP)  # Geom groups that renderers draw

_UNSET_RGBA = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)


class Renderer(ABC):
    """Draws colour images of a model from any camera pose.

    `color` raises `ParameterError` for an invalid pose or camera matrix, and `RenderError` if the renderer is closed or
    unbound.

    Attributes:
        description: Library, graphics card and version, in one line.
    """

    description: str

    def __init__(self, width_px: int, height_px: int) -> None:
        self.width_px, self.height_px = width_px, height_px

    @abstractmethod
    def color(
        self, data: mujoco.MjData, T_world_camera: ArrayLike, K: ArrayLike, *, rows: slice | None = None
    ) -> Image:
        """Draw a new `(H, W, 3)` uint8 RGB image, or only its `rows` (start and stop).

        `data` is an `MjData` of the model with up-to-date poses (`mj_forward`, or `mj_kinematics` and `mj_camlight`),
        `T_world_camera` the `(4, 4)` camera pose (x right, y down, z forward), and `K` the `(3, 3)` camera matrix of
        the whole image [px].
        """

    @abstractmethod
    def rebind(self, model: mujoco.MjModel) -> None:
        """Draw another model from now on. Poses, lights and colours are read when drawing."""

    @abstractmethod
    def unbind(self) -> None:
        """Release the model and everything derived from it, until the next `rebind`."""

    @abstractmethod
    def close(self) -> None:
        """Free everything; a second call does nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def check_name(backend: str | None) -> None:
    """Raise `UnknownNameError` if there is no such renderer; None is one."""
    if backend is not None and backend not in NAMES:
        raise UnknownNameError("renderer", backend, NAMES)


def warp_installed() -> bool:
    """Whether the extra `warp` is installed; nothing of it is imported."""
    return all(find_spec(name) is not None for name in ("mujoco_warp", "warp"))


def open_renderer(model: Any, width_px: int, height_px: int, backend: str | None = None) -> Renderer:
    """Open a renderer of a model with an image of this width and height.

    `backend` is one of `NAMES`; None takes OpenGL where a library can draw, else the ray caster where it is installed.

    Raises:
        UnknownNameError: No such renderer.
        RenderError: It cannot draw here; the message says what to install.
    """
    check_name(backend)
    if backend == "warp":
        return _open_raycaster(model, width_px, height_px)
    try:
        context = open_context(None if backend == "gl" else backend)
    except RenderError as error:
        if forked():
            raise  # the ray caster would draw other pixels here than the parent process
        if backend is None and warp_installed():
            return _open_raycaster(model, width_px, height_px)
        raise RenderError(f"{error}\nor, without OpenGL:\n{WARP_INSTALL_HINT}") from error
    from pftrack_sim.render.gl.rasteriser import Rasteriser

    return Rasteriser(model, width_px, height_px, context)


def _open_raycaster(model: Any, width_px: int, height_px: int) -> Renderer:
    if not warp_installed():
        raise RenderError(
            f"the renderer warp is not installed. Install it:\n{WARP_INSTALL_HINT}\nor OpenGL, one of:\n{INSTALL_HINTS}"
        )
    from pftrack_sim.render.warp.raycaster import Raycaster

    return Raycaster(model, width_px, height_px)


def geoms_drawn(model: Any) -> BoolArray:
    """`(ngeom,)` geoms that are drawn at all: those of the drawn groups that are not fully transparent."""
    opacity = model.geom_rgba[:, 3].copy()
    # MuJoCo's rule: a material holds where the geom's own colour was left at grey 0.5.
    by_material = (model.geom_matid >= 0) & (model.geom_rgba == _UNSET_RGBA).all(axis=1)
    opacity[by_material] = model.mat_rgba[model.geom_matid[by_material], 3]
    return np.isin(model.geom_group, DRAWN_GROUPS) & (opacity > 0.0)


def clip_depths_m(model: Any) -> tuple[float, float]:
    """Depths of the near and far plane."""
    extent = float(model.stat.extent)
    return float(model.vis.map.znear) * extent, float(model.vis.map.zfar) * extent


def sky_material(model: Any) -> int:
    """Index of the material whose emission is the brightness of the sky; -1 where there is none."""
    return int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MATERIAL, SKY))


def checked_poses(T_world_camera: ArrayLike) -> FloatArray:
    """`(..., 4, 4)` camera poses; another shape, or a number that is not finite, raises `ParameterError`."""
    poses = np.asarray(T_world_camera, dtype=np.float64)
    if poses.shape[-2:] != (4, 4) or not np.isfinite(poses).all():
        raise ParameterError(f"T_world_camera must be a finite (4, 4) matrix, got {poses.tolist()}")
    return poses
