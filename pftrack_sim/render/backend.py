"""The interface of all renderers, and what they share: which geoms are drawn, rectangles of pixels, segmentations."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scene.layout import PEOPLE_GROUP, ROBOT_GROUP, SCENERY_GROUP, SKY

DRAWN_GROUPS = (SCENERY_GROUP, PEOPLE_GROUP, ROBOT_GROUP)  # Geom groups that renderers draw

_UNSET_RGBA = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)


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


class PixelRect(NamedTuple):
    """A rectangle of whole pixels: columns left .. left + width - 1, rows top .. top + height - 1."""

    left: int
    top: int
    width: int
    height: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns, to index an image with."""
        return slice(self.top, self.top + self.height), slice(self.left, self.left + self.width)

    def relative_to(self, outer: PixelRect) -> PixelRect:
        """The same pixels, counted from the corner of another rectangle."""
        return PixelRect(self.left - outer.left, self.top - outer.top, self.width, self.height)

    def intersects(self, other: PixelRect) -> bool:
        """Whether they share a pixel."""
        left, top, width, height = self
        x, y, w, h = other
        return left < x + w and x < left + width and top < y + h and y < top + height

    def intersection(self, other: PixelRect) -> PixelRect:
        """The pixels they share, if they intersect."""
        left, top = max(self.left, other.left), max(self.top, other.top)
        right = min(self.left + self.width, other.left + other.width)
        bottom = min(self.top + self.height, other.top + other.height)
        return PixelRect(left, top, right - left, bottom - top)


def bounding_rect(rects: Sequence[PixelRect]) -> PixelRect:
    """The smallest rectangle around one or several."""
    left, top = min(rect.left for rect in rects), min(rect.top for rect in rects)
    right, bottom = max(rect.left + rect.width for rect in rects), max(rect.top + rect.height for rect in rects)
    return PixelRect(left, top, right - left, bottom - top)


@dataclass(frozen=True, eq=False)
class Segmentation:
    """The geom at each pixel of a rectangle, of some or all geoms of the scene.

    Attributes:
        rect: Where in the image.
        ids: `(h, w)` int32 geom ids, -1 where there is none.
        inverse_depth: `(h, w)` float32, affine in 1 / depth, 0 where there is no geom; comparable between
            segmentations of the same renderer and camera. Of two geoms at equal depth, the larger id is in front.
    """

    rect: PixelRect
    ids: NDArray[np.int32]
    inverse_depth: NDArray[np.float32]


class Renderer(ABC):
    """Draws color images and segmentations of a model from any camera pose.

    In all methods, `data` is an `MjData` of the model with up-to-date poses (`mj_forward`, or `mj_kinematics` and
    `mj_camlight`), `T_world_camera` the `(4, 4)` camera pose (x right, y down, z forward), and `K` the `(3, 3)` camera
    matrix of the whole image [px] or the vertical field of view [rad]. They raise `ParameterError` for an invalid pose,
    matrix or rectangle, and `RenderError` if the renderer is closed or unbound.

    Attributes:
        near_m: Depth of the near plane.
        far_m: Depth of the far plane.
        visible_geoms: `(ngeom,)` geoms that are drawn at all.
        description: Library, graphics card and version, in one line.
        draws_color: Whether it draws colours; if not, `color` raises `RenderError`.

    Raises:
        ParameterError: An empty image.
    """

    near_m: float
    far_m: float
    visible_geoms: BoolArray
    description: str
    draws_color: bool = True

    def __init__(self, width_px: int, height_px: int) -> None:
        if width_px < 1 or height_px < 1:
            raise ParameterError(f"an image needs a width and height >= 1, got {width_px} x {height_px}")
        self.width_px, self.height_px = int(width_px), int(height_px)

    @abstractmethod
    def color(
        self, data: mujoco.MjData, T_world_camera: ArrayLike, K: ArrayLike | float, *, rows: slice | None = None
    ) -> Image:
        """Draw a new `(H, W, 3)` uint8 RGB image, or only its `rows` (start and stop)."""

    def ids(
        self,
        data: mujoco.MjData,
        T_world_camera: ArrayLike,
        K: ArrayLike | float,
        *,
        geoms: BoolArray | None = None,
        rect: PixelRect | None = None,
    ) -> Segmentation:
        """Find the geom at each pixel, without anti-aliasing.

        Of the visible geoms those in the `(ngeom,)` mask are drawn; None draws all. The rectangle wanted is the whole
        image if None; its pixels equal those of the whole image to the bit.

        Raises:
            ParameterError: A rectangle that is not inside the image, or an invalid pose.
            RenderError: There is no model.
        """
        image = PixelRect(0, 0, self.width_px, self.height_px)
        rect = image if rect is None else rect
        if rect.width < 1 or rect.height < 1 or bounding_rect([rect, image]) != image:
            raise ParameterError(f"the rectangle must lie in the {self.width_px} x {self.height_px} image, got {rect}")
        drawn = self.visible_geoms if geoms is None else self.visible_geoms & geoms
        return self._ids(data, checked_poses(T_world_camera), K, drawn, rect)

    @abstractmethod
    def _ids(
        self, data: mujoco.MjData, pose: FloatArray, K: ArrayLike | float, geoms: BoolArray, rect: PixelRect
    ) -> Segmentation:
        """As `ids`, of these geoms in this rectangle."""

    def drawing(self) -> AbstractContextManager[None]:
        """A block in which several images are drawn: what they need is prepared once."""
        return nullcontext()

    @abstractmethod
    def rebind(self, model: mujoco.MjModel) -> None:
        """Draw another model from now on.

        Visible geoms, near and far plane are read now; poses, lights and colours when drawing.
        """

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

    def depth_m(self, found: Segmentation) -> NDArray[np.float32]:
        """`(h, w)` depth along the optical axis of what `ids` found [m]; infinite where there is no geom."""
        with np.errstate(divide="ignore"):
            return np.where(found.ids < 0, np.float32(np.inf), 1.0 / self._reciprocal_depth(found)).astype(np.float32)

    def _reciprocal_depth(self, found: Segmentation) -> NDArray[np.float32]:
        return found.inverse_depth

    def _read_model(self, model: mujoco.MjModel) -> None:
        """Read visible geoms, near and far plane."""
        self.near_m, self.far_m = clip_depths_m(model)
        self.visible_geoms = geoms_drawn(model)
        self.visible_geoms.setflags(write=False)


def checked_poses(T_world_camera: ArrayLike) -> FloatArray:
    """`(..., 4, 4)` camera poses; another shape, or a number that is not finite, raises `ParameterError`."""
    poses = np.asarray(T_world_camera, dtype=np.float64)
    if poses.shape[-2:] != (4, 4) or not np.isfinite(poses).all():
        raise ParameterError(f"T_world_camera must be a finite (4, 4) matrix, got {poses.tolist()}")
    return poses
