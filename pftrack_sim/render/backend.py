"""What the truth needs of a renderer, and nothing else: OpenGL, or a ray caster where there is none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.records import Image
from pftrack_sim.scene.layout import PEOPLE_GROUP, ROBOT_GROUP, SCENERY_GROUP

DRAWN_GROUPS = (SCENERY_GROUP, PEOPLE_GROUP, ROBOT_GROUP)
"""Geom groups that renderers draw."""

_UNSET_RGBA = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)


def geoms_drawn(model: Any) -> NDArray[np.bool_]:
    """`(ngeom,)` which geoms are drawn at all: those of the drawn groups that are not wholly transparent."""
    opacity = model.geom_rgba[:, 3].copy()
    # MuJoCo's rule: a geom's own colour holds unless it was left at grey 0.5 and there is a material.
    by_material = (model.geom_matid >= 0) & (model.geom_rgba == _UNSET_RGBA).all(axis=1)
    opacity[by_material] = model.mat_rgba[model.geom_matid[by_material], 3]
    return np.isin(model.geom_group, DRAWN_GROUPS) & (opacity > 0.0)


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
        return (
            self.left < other.left + other.width
            and other.left < self.left + self.width
            and self.top < other.top + other.height
            and other.top < self.top + self.height
        )

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
    """Some of the scene's geoms, drawn alone.

    Attributes:
        rect: Where in the image.
        ids: `(h, w)` int32 geom id of each pixel, -1 where there is none.
        inverse_depth: `(h, w)` float32, affine in 1 / depth, 0 where there is none; compares between layers of the same
            renderer and camera. On equal nearness the larger id is on top.
    """

    rect: PixelRect
    ids: NDArray[np.int32]
    inverse_depth: NDArray[np.float32]


class Renderer(Protocol):
    """Pictures and ids of a model from a given camera.

    `data` is an `MjData` of the model whose positions are up to date; `T_world_camera` `(4, 4)` maps camera axes
    (x right, y down, z forward) to the world's; `K` is the `(3, 3)` camera matrix [px].
    """

    @property
    def width_px(self) -> int:
        """Image width."""
        ...

    @property
    def height_px(self) -> int:
        """Image height."""
        ...

    @property
    def near_m(self) -> float:
        """Depth below which nothing is drawn."""
        ...

    @property
    def description(self) -> str:
        """Name of the library, graphics card and version, in one line."""
        ...

    @property
    def visible_geoms(self) -> NDArray[np.bool_]:
        """`(ngeom,)` which geoms are drawn at all."""
        ...

    def color(
        self,
        data: Any,
        T_world_camera: NDArray[np.float64],
        K: NDArray[np.float64],
        *,
        rows: slice | None = None,
    ) -> Image:
        """A new `(H, W, 3)` uint8 RGB image; with `rows` (start and stop within it), those alone."""
        ...

    def ids(
        self,
        data: Any,
        T_world_camera: NDArray[np.float64],
        K: NDArray[np.float64],
        *,
        geoms: NDArray[np.bool_] | None = None,
        rect: PixelRect | None = None,
    ) -> Segmentation:
        """Which geom each pixel shows.

        Args:
            data: Positions.
            T_world_camera: Camera pose.
            K: Camera matrix of the whole image.
            geoms: `(ngeom,)` the geoms to draw; None draws all that are drawn at all.
            rect: The rectangle wanted; None is the whole image. Its pixels are those of the whole image, to the bit.
        """
        ...

    def rebind(self, model: Any) -> None:
        """Go on with another model, freeing what was kept of the last."""
        ...

    def close(self) -> None:
        """Free everything; a second call does nothing."""
        ...
