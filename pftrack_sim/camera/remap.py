"""From a drawing to the image: every pixel fetches its light along its own ray, at its own time.

A drawing shows the scene through a pinhole at one instant, with a margin. Turned about its centre, a camera sees the
same light from elsewhere on the plane (Hartley and Zisserman, Multiple View Geometry, 2nd ed., section 8.4: the
homography K R K'). So the lens and the turning of the camera while a row is read are one map from pixels of the image
to places on the drawing, and each drawing is resampled once.

The map is smooth: it is computed on every fourth or eighth pixel and interpolated, which is exact within 0.03 px.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.distortion import Lens
from pftrack_sim.camera.pinhole import focal_and_centre

Array = NDArray[np.float64]
Map = NDArray[np.float32]
Light = NDArray[np.unsignedinteger[Any]]
"""Display-coded, 8 bits, or linear, 16 bits."""

_LOWEST_M = 0.1
"""A camera below this height sees no ground."""

_BENT_CELL_PX, _STRAIGHT_CELL_PX = 4, 8
"""Distance of the pixels for which rays are computed, with a lens that bends them and without."""


class Rays:
    """The rays of an image's pixels, on a coarse grid that reaches one cell beyond it.

    Args:
        lens: Bends them.
    """

    def __init__(self, lens: Lens) -> None:
        width, height = lens.size
        cell = _BENT_CELL_PX if lens.bends else _STRAIGHT_CELL_PX
        self.cell_px = cell
        """Height of a band of rows, and width of the grid's cells [px]."""
        self.columns, self.bands = -(-width // cell), -(-height // cell)
        self._size = lens.size
        x = cell * (np.arange(self.columns + 2) - 0.5)
        self.y_px: Array = cell * (np.arange(self.bands + 2, dtype=np.float64) - 0.5)
        """`(bands + 2,)` heights of the grid's rows [px]; the first and last are beside the image."""
        grid = np.stack(np.broadcast_arrays(x, self.y_px[:, None]), axis=-1)
        rays = lens.slopes(grid)
        self._rays = np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=-1)

    def turned(self, first: int, last: int, rotations: Array) -> Array:
        """Slopes of the rays in the axes of a drawing.

        Args:
            first: First band of rows wanted.
            last: One past the last.
            rotations: `(last - first + 2, 3, 3)` from the camera at each of the grid's rows to the drawing; or one
                `(3, 3)` for all.

        Returns:
            `(last - first + 2, columns + 2, 2)`
        """
        rays = self._rays[first : last + 2] @ np.swapaxes(rotations, -1, -2)
        return rays[..., :2] / rays[..., 2:]

    def carried(self, first: int, last: int, poses: Array, T_world_drawing: Array) -> Array:
        """The same for a camera that also travels over level ground.

        What a ray sees is taken to lie on the ground z = 0, and above the horizon infinitely far away. (The
        homography of a plane: Hartley and Zisserman, 2nd ed., section 13.1.)

        Args:
            first: First band of rows wanted.
            last: One past the last.
            poses: `(last - first + 2, 4, 4)` of the camera at each of the grid's rows; or one `(4, 4)` for all.
            T_world_drawing: `(4, 4)` pose of the drawing's camera.
        """
        axes = T_world_drawing[:3, :3]
        rays = self._rays[first : last + 2] @ np.swapaxes(poses[..., :3, :3], -1, -2)
        nearness = ground_nearness(rays, poses[..., None, :3, 3])
        travelled = (poses[..., None, :3, 3] - T_world_drawing[:3, 3]) * nearness[..., None]
        local = (rays + travelled) @ axes
        return local[..., :2] / local[..., 2:]

    def places(self, first: int, last: int, slopes: Array, K_drawing: Array, top: int = 0) -> Map:
        """`(rows, W, 2)` where on a drawing each pixel of some bands looks, as indices of pixels (x, y).

        Args:
            first: First band.
            last: One past the last.
            slopes: Of `turned`.
            K_drawing: `(3, 3)` of the drawing [px].
            top: The row of the drawing that y counts from.
        """
        fx, fy, cx, cy = focal_and_centre(K_drawing)
        coarse = (slopes * (fx, fy) + (cx - 0.5, cy - 0.5 - top)).astype(np.float32)
        whole = ((self.columns + 2) * self.cell_px, (last - first + 2) * self.cell_px)
        fine = np.asarray(cv2.resize(coarse, whole, interpolation=cv2.INTER_LINEAR), dtype=np.float32)
        rows = min(self._size[1], last * self.cell_px) - first * self.cell_px
        return fine[self.cell_px : self.cell_px + rows, self.cell_px : self.cell_px + self._size[0]]

    @staticmethod
    def fetch(light: Light, places: Map) -> Light:
        """`(rows, W, 3)` the light of a drawing at some places, interpolated."""
        # The stub knows no map in one piece.
        one_map: Any = None
        if light.dtype == np.uint8:
            # A map of fixed-point numbers is quicker, and no coarser: to a 1/32 px, as OpenCV rounds any map.
            fixed, shares = cv2.convertMaps(places, one_map, cv2.CV_16SC2)
            fetched = cv2.remap(light, fixed, shares, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            return np.asarray(fetched, dtype=np.uint8)
        fetched = cv2.remap(light, places, one_map, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(fetched, dtype=light.dtype)

    def rows(self, first: int, last: int) -> slice:
        """The rows of the image in some bands."""
        return slice(first * self.cell_px, min(self._size[1], last * self.cell_px))


def ground_nearness(rays: Array, eyes: Array) -> Array:
    """`(...,)` inverse of how many times its length each ray goes until it meets the ground z = 0; 0 if it never does.

    Args:
        rays: `(..., 3)` world frame.
        eyes: `(..., 3)` where they begin [m]. Of one that is hardly above the ground, no ray meets it.
    """
    height = eyes[..., 2]
    return np.where(height > _LOWEST_M, np.maximum(-rays[..., 2], 0.0) / np.maximum(height, _LOWEST_M), 0.0)


class RadianceAccumulator:
    """Averages pictures in linear light, as a pixel that collects photons does.

    Pixels are display-coded by the sRGB curve (IEC 61966-2-1). A mean of codes would make a bright thing that passes
    over a dark one fade too early.

    Args:
        count: How many pictures will be added to each pixel.
        shape: Of the picture: `(H, W, 3)`.
    """

    def __init__(self, count: int, shape: tuple[int, int, int]) -> None:
        self._decode = np.rint(_LINEAR * (_FULL / count)).astype(np.uint16) if count > 1 else None
        self._sum: NDArray[np.uint16] | None = np.zeros(shape, dtype=np.uint16) if count > 1 else None
        self._only: NDArray[np.uint8] | None = None if count > 1 else np.empty(shape, dtype=np.uint8)

    def light(self, drawing: NDArray[np.uint8]) -> Light:
        """A drawing as it may be resampled and added."""
        return drawing if self._decode is None else np.asarray(cv2.LUT(drawing, self._decode), dtype=np.uint16)

    def add(self, rows: slice, light: Light) -> None:
        """Add to some rows."""
        if self._sum is None:
            assert self._only is not None
            self._only[rows] = light
        else:
            total = self._sum[rows]
            cv2.add(total, light, dst=total)

    def read(self) -> NDArray[np.uint8]:
        """`(H, W, 3)` the mean, display-coded."""
        if self._sum is None:
            assert self._only is not None
            return self._only
        from pftrack_sim.camera.lookup_table import look_up  # numba: imported when it is used

        return look_up(self._sum, _ENCODE)


_FULL = 65535.0


def _linear(codes: Array) -> Array:
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


_LINEAR: Array = _linear(np.arange(256, dtype=np.float64) / 255.0)
_ENCODE: NDArray[np.uint8] = np.searchsorted(
    _linear((np.arange(255, dtype=np.float64) + 0.5) / 255.0), np.arange(65536, dtype=np.float64) / _FULL, side="right"
).astype(np.uint8)
