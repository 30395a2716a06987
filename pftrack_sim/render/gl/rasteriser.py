"""MuJoCo's classic OpenGL renderer, looked through from any camera pose: colour images and geom ids.

Differences to `mujoco.Renderer`: the camera's pose and matrix are given rather than taken from the model, its OpenGL
needs no environment variable, ids are decoded by one table look-up, and a context survives a change of model.
"""

from __future__ import annotations

import copy
import weakref
from typing import Any

import cv2
import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.camera.pinhole import camera_matrix, frustum
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.records import Image
from pftrack_sim.render.backend import DRAWN_GROUPS, PixelRect, Segmentation, geoms_drawn
from pftrack_sim.render.culling import Bounds
from pftrack_sim.render.gl.context import GLContext, GLInfo, open_context
from pftrack_sim.render.gl.sky import Sky
from pftrack_sim.scene.layout import SCENERY_GROUP

_NEVER_DRAWN = 5
"""A geom group that no option of ours shows."""

_GEOMS_ONLY = int(mujoco.mjtCatBit.mjCAT_STATIC) | int(mujoco.mjtCatBit.mjCAT_DYNAMIC)
_NOT_DRAWN = int(mujoco.mjtGeom.mjGEOM_NONE)
_GL_RGBA = 0x1908
_SPARE_GEOMS = 64
_CODE_BITS = np.uint32(0xFFFFFF)


class Rasteriser:
    """Draws one model off screen; see `pftrack_sim.render.backend.Renderer`.

    Geom groups 0, 1 and 2 are drawn; sites, joints and the rest of MuJoCo's decoration never are. Any thread may use
    it, one at a time. Several may live in one process.

    Args:
        model: What to draw. Its `vis` settings hold for multisampling, shadow size, near and far plane and fog's
            colour and range; its off-screen size is ignored.
        width_px: Image width.
        height_px: Image height.
        backend: `"egl"`, `"osmesa"`, or None for the first that works.
        fog: Whether distant things fade into the model's fog.

    Raises:
        ParameterError: An empty image, or an unknown backend.
        RenderError: No OpenGL library can draw.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        width_px: int,
        height_px: int,
        backend: str | None = None,
        *,
        fog: bool = False,
    ) -> None:
        if width_px < 1 or height_px < 1:
            raise ParameterError(f"an image needs a width and height >= 1, got {width_px} x {height_px}")
        self._width, self._height = int(width_px), int(height_px)
        self._fog = fog
        self._options = _options()
        self._context = open_context(backend, (self._width, self._height))
        self._info = self._context.info()
        self._drawing: list[mujoco.MjrContext] = []
        self._finalizer = weakref.finalize(self, _free, self._context, self._drawing)
        self._pixels = np.empty((self._height, self._width, 4), dtype=np.uint8)
        self.rebind(model)

    @property
    def model(self) -> mujoco.MjModel:
        """What is drawn."""
        return self._model

    @property
    def width_px(self) -> int:
        """Image width."""
        return self._width

    @property
    def height_px(self) -> int:
        """Image height."""
        return self._height

    @property
    def near_m(self) -> float:
        """Depth below which nothing is drawn."""
        return self._near_m

    @property
    def far_m(self) -> float:
        """Depth beyond which nothing is drawn."""
        return self._far_m

    @property
    def visible_geoms(self) -> NDArray[np.bool_]:
        """`(ngeom,)` which geoms are drawn at all: those of groups 0, 1 and 2 that are not wholly transparent."""
        return self._visible.copy()

    @property
    def info(self) -> GLInfo:
        """Which OpenGL draws."""
        return self._info

    @property
    def description(self) -> str:
        """The same in one line."""
        return f"{self._info.backend}: {self._info.renderer}, {self._info.vendor}, OpenGL {self._info.version}"

    def rebind(self, model: mujoco.MjModel) -> None:
        """Draw another model from now on. Textures and meshes of the last one are freed; the context stays.

        Which geoms are drawn at all, and the near and far plane, are read now; poses, lights and colours when drawing.

        Raises:
            RenderError: Closed.
        """
        with self._context:
            self._free_drawing()
            drawing = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50)
            self._drawing.append(drawing)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, drawing)
            if (drawing.offWidth, drawing.offHeight) != (self._width, self._height):
                mujoco.mjr_resizeOffscreen(self._width, self._height, drawing)
            drawing.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR  # nearness as it is kept, without a conversion
            drawing.readPixelFormat = _GL_RGBA  # the buffer's own format: ten times quicker to read than RGB
        self._model = model
        extent = float(model.stat.extent)
        self._near_m, self._far_m = float(model.vis.map.znear) * extent, float(model.vis.map.zfar) * extent
        self._scene = mujoco.MjvScene(model, model.ngeom + _SPARE_GEOMS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = self._fog
        self._ids_model: mujoco.MjModel | None = None
        self._ids_scene: mujoco.MjvScene | None = None
        self._sky = Sky(model)
        self._visible = geoms_drawn(model)
        self._bounds = Bounds(model)
        self._scene_geoms = list(self._scene.geoms)

    def color(
        self, data: mujoco.MjData, T_world_camera: ArrayLike, K: ArrayLike | float, *, rows: slice | None = None
    ) -> Image:
        """Draw a picture.

        Args:
            data: Positions, up to date (`mj_forward` or `mj_kinematics` and `mj_camlight`).
            T_world_camera: `(4, 4)` camera pose, OpenCV axes.
            K: `(3, 3)` camera matrix of the whole image [px], or a vertical field of view [rad].
            rows: The rows wanted, by start and stop; None is the whole image. Edges may differ from the same rows of
                the whole image by the rounding of subpixels.

        Returns:
            A new `(H, W, 3)` uint8 RGB image, or its rows.

        Raises:
            ParameterError: A pose or camera matrix that is none.
            RenderError: Closed.
        """
        matrix, height = camera_matrix(K, self._width, self._height), self._height
        if rows is not None:
            matrix = matrix - np.array([[0.0, 0.0, 0.0], [0.0, 0.0, rows.start], [0.0, 0.0, 0.0]])
            height = rows.stop - rows.start
        self._compose(self._scene, self._model, data, T_world_camera, matrix, height)
        mujoco.mjv_makeLights(self._model, data, self._scene)
        self._leave_out_unseen(data, T_world_camera, matrix, height)
        area = mujoco.MjrRect(0, 0, self._width, height)
        pixels = self._pixels[:height]
        with self._context:
            drawing = self._drawing[0]
            self._sky.update(drawing)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, drawing)
            mujoco.mjr_render(area, self._scene, drawing)
            mujoco.mjr_readPixels(pixels, None, area, drawing)
        # OpenGL counts rows from the bottom.
        return np.asarray(cv2.flip(cv2.cvtColor(pixels, cv2.COLOR_RGBA2RGB), 0), dtype=np.uint8)

    def ids(
        self,
        data: mujoco.MjData,
        T_world_camera: ArrayLike,
        K: ArrayLike | float,
        *,
        geoms: NDArray[np.bool_] | None = None,
        rect: PixelRect | None = None,
    ) -> Segmentation:
        """Which geom each pixel shows: hard edges, whatever the multisampling, light or fog.

        The whole image is rasterised whatever is wanted of it: clipped to a smaller view, triangles would be rounded
        to other subpixels, and a rectangle would differ from the same pixels of the whole image.

        Args:
            data: Positions, up to date.
            T_world_camera: `(4, 4)` camera pose, OpenCV axes.
            K: `(3, 3)` camera matrix of the whole image [px], or a vertical field of view [rad].
            geoms: `(ngeom,)` the geoms to draw; None draws all that are drawn at all.
            rect: The rectangle wanted; None is the whole image.

        Raises:
            ParameterError: A pose, camera matrix, mask or rectangle that is none.
            RenderError: Closed.
        """
        rect = PixelRect(0, 0, self._width, self._height) if rect is None else rect
        if not (
            rect.width > 0
            and rect.height > 0
            and 0 <= rect.left <= self._width - rect.width
            and 0 <= rect.top <= self._height - rect.height
        ):
            raise ParameterError(f"the rectangle must lie in the {self._width} x {self._height} image, got {rect}")
        wanted = self._visible if geoms is None else self._visible & geoms
        model, scene = self._ids_kit()
        # Hiding is by group, in a copy of the model: several threads may share the caller's.
        model.geom_group[:] = np.where(wanted, SCENERY_GROUP, _NEVER_DRAWN)
        self._compose(scene, model, data, T_world_camera, K, self._height)
        geom_of_code = np.concatenate([[-1], _drawn_geoms(scene, wanted)]).astype(np.int32)
        pixels = self._pixels.reshape(-1)[: 4 * rect.width * rect.height].reshape(rect.height, rect.width, 4)
        nearness = np.empty((rect.height, rect.width), dtype=np.float32)
        area = mujoco.MjrRect(rect.left, self._height - rect.top - rect.height, rect.width, rect.height)
        with self._context:
            drawing = self._drawing[0]
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, drawing)
            mujoco.mjr_render(mujoco.MjrRect(0, 0, self._width, self._height), scene, drawing)
            mujoco.mjr_readPixels(pixels, nearness, area, drawing)
        codes = pixels.view("<u4")[:, :, 0] & _CODE_BITS
        return Segmentation(rect, geom_of_code.take(codes)[::-1], nearness[::-1])

    def close(self) -> None:
        """Free everything; a second call does nothing."""
        self._finalizer()

    def __enter__(self) -> Rasteriser:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _compose(
        self,
        scene: mujoco.MjvScene,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        T_world_camera: ArrayLike,
        K: Any,
        height_px: int,
    ) -> None:
        """Put the camera, then what it sees, into a scene.

        MuJoCo's own `mjv_updateScene` places the camera last, so that whatever depends on it (the headlight, the
        tiles of an infinite plane) would come from the camera of the frame before.
        """
        self._place_camera(scene, np.asarray(T_world_camera, dtype=np.float64), K, height_px)
        scene.ngeom = 0
        mujoco.mjv_addGeoms(model, data, self._options, _NO_PERTURBATION, _GEOMS_ONLY, scene)

    def _leave_out_unseen(
        self, data: mujoco.MjData, T_world_camera: ArrayLike, matrix: NDArray[np.float64], height_px: int
    ) -> None:
        """Take what lies out of view out of the scene of the picture, where that changes nothing.

        MuJoCo hands everything to OpenGL, and software OpenGL transforms every vertex of it.
        """
        model, scene = self._model, self._scene
        order = np.flatnonzero(self._visible)
        if scene.ngeom != order.size or (model.mat_reflectance > 0.0).any():
            return
        pose = np.asarray(T_world_camera, dtype=np.float64)
        needed = self._bounds.in_view(data, pose, matrix, (self._width, height_px), self.near_m)
        if (model.light_active & model.light_castshadow).any():
            needed |= model.geom_castshadow
        for index in np.flatnonzero(~needed[order]):
            self._scene_geoms[index].type = _NOT_DRAWN

    def _place_camera(self, scene: mujoco.MjvScene, pose: NDArray[np.float64], K: Any, height_px: int) -> None:
        if pose.shape != (4, 4) or not np.isfinite(pose).all():
            raise ParameterError(f"T_world_camera must be a finite (4, 4) matrix, got {pose.tolist()}")
        matrix = camera_matrix(K, self._width, height_px)
        view = frustum(matrix, self._width, height_px, self.near_m, self.far_m)
        # MuJoCo draws the average of a left and a right eye: give both the same.
        for eye in scene.camera:
            eye.pos[:] = pose[:3, 3]
            eye.forward[:] = pose[:3, 2]
            eye.up[:] = -pose[:3, 1]
            eye.frustum_center = 0.5 * (view.left + view.right)
            eye.frustum_width = 0.5 * (view.right - view.left)
            eye.frustum_bottom, eye.frustum_top = view.bottom, view.top
            eye.frustum_near, eye.frustum_far = view.near, view.far
            eye.orthographic = 0

    def _ids_kit(self) -> tuple[mujoco.MjModel, mujoco.MjvScene]:
        """The model and scene that ids are drawn from, made when first needed."""
        if self._ids_model is None or self._ids_scene is None:
            scene = mujoco.MjvScene(self._model, self._model.ngeom + _SPARE_GEOMS)
            scene.flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = True
            scene.flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = True
            self._ids_model, self._ids_scene = copy.copy(self._model), scene
        return self._ids_model, self._ids_scene

    def _free_drawing(self) -> None:
        while self._drawing:
            self._drawing.pop().free()


_NO_PERTURBATION = mujoco.MjvPerturb()


def _options() -> mujoco.MjvOption:
    """Geoms of the drawn groups, and nothing else."""
    options = mujoco.MjvOption()
    for groups in (
        options.geomgroup,
        options.sitegroup,
        options.jointgroup,
        options.tendongroup,
        options.actuatorgroup,
        options.flexgroup,
        options.skingroup,
    ):
        groups[:] = 0
    options.geomgroup[list(DRAWN_GROUPS)] = 1
    return options


def _drawn_geoms(scene: mujoco.MjvScene, wanted: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Geom ids in the order of the scene, whose place there is the code they are drawn with."""
    order = np.flatnonzero(wanted)
    if scene.ngeom != order.size:
        # MuJoCo left some out or put others in: ask each.
        order = np.array([geom.objid for geom in list(scene.geoms)[: scene.ngeom]], dtype=np.intp)
    return order


def _free(context: GLContext, drawing: list[mujoco.MjrContext]) -> None:
    """What `close`, garbage collection and the interpreter's end all do."""
    if context.closed:
        return
    if context.usable:
        with context:
            while drawing:
                drawing.pop().free()
    context.close()
