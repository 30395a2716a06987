"""Remapping of rendered images to the camera image, and averaging of radiance.

A rendered image shows the scene through a pinhole at one instant, with a margin. A camera that rotates about its centre
sees the same light elsewhere on the image plane (Hartley and Zisserman, Multiple View Geometry, 2nd ed., section 8.4:
the homography K R K'). Lens distortion and camera rotation during readout are therefore one map from pixels of the
camera image to places on the rendered image, which is resampled once.

The map is smooth: it is computed on every second to eighth pixel and interpolated, which is exact within 0.03 px.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.distortion import Lens
from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray

PixelMap: TypeAlias = NDArray[np.float32]
"""`(rows, W, 2)` place x, y on a rendered image for each pixel, as pixel indices."""

Radiance: TypeAlias = NDArray[np.unsignedinteger[Any]]  # Display-coded with 8 bits, or linear with 16 bits
_LOWEST_EYE_M = 0.1  # Camera height below which no ground is assumed to be in view
_FISHEYE_CELL_PX, _DISTORTED_CELL_PX, _STRAIGHT_CELL_PX = 2, 4, 8  # Grid spacing by lens


class RayGrid:
    """Rays of the pixels of a lens's image on a coarse grid that extends one cell beyond the image."""

    def __init__(self, lens: Lens) -> None:
        width, height = lens.size
        straight = _DISTORTED_CELL_PX if lens.distorts else _STRAIGHT_CELL_PX
        cell = _FISHEYE_CELL_PX if lens.equidistant else straight
        self.cell_px = cell
        """Height of a band of rows, and width of the grid cells [px]."""
        self.columns, self.bands = -(-width // cell), -(-height // cell)
        self._size = lens.size
        x = cell * (np.arange(self.columns + 2) - 0.5)
        self.y_px: FloatArray = cell * (np.arange(self.bands + 2, dtype=np.float64) - 0.5)
        """`(bands + 2,)` heights of the grid rows [px]; the first and last are outside the image."""
        grid = np.stack(np.broadcast_arrays(x, self.y_px[:, None]), axis=-1)
        self._rays = lens.rays(grid)

    @property
    def normalized(self) -> FloatArray:
        """`(bands + 2, columns + 2, 2)` normalized coordinates of all rays."""
        return normalized(self._rays)

    def directions(self, first: int, last: int, poses: FloatArray, T_world_render: FloatArray) -> FloatArray:
        """`(rows, columns + 2, 3)` rays of some bands of rows in the axes of the camera of a rendered image.

        The camera may rotate and travel over level ground: what a ray sees is assumed to lie on the ground z = 0, and
        above the horizon at infinity (homography of a plane: Hartley and Zisserman, 2nd ed., section 13.1).

        Args:
            first: First band.
            last: One past the last band; `rows` is last - first + 2.
            poses: `(rows, 4, 4)` T_world_camera for each grid row, or one `(4, 4)` for all.
            T_world_render: `(4, 4)` camera pose of the rendered image.
        """
        rays = self._rays[first : last + 2] @ np.swapaxes(poses[..., :3, :3], -1, -2)
        positions = poses[..., None, :3, 3]
        inverse_ranges = inverse_ground_range(rays, positions)
        travelled = (positions - T_world_render[:3, 3]) * inverse_ranges[..., None]
        return (rays + travelled) @ T_world_render[:3, :3]

    def pixel_map(self, first: int, last: int, normalized: FloatArray, K: FloatArray, top: int = 0) -> PixelMap:
        """`(rows, W, 2)` map from the pixels of bands `first` to `last` - 1 to places on a rendered image.

        `normalized` are coordinates of the grid's rays on that image, `K` is its `(3, 3)` camera matrix [px], and `top`
        the row of it that y counts from.
        """
        fx, fy, cx, cy = focal_and_centre(K)
        return self.interpolated(first, last, normalized * (fx, fy) + (cx - 0.5, cy - 0.5 - top))

    def interpolated(self, first: int, last: int, grid: FloatArray) -> NDArray[np.float32]:
        """`(rows, W, C)` values of the pixels of some bands, from `(rows, columns + 2, C)` values on the grid."""
        coarse = grid.astype(np.float32)
        cell, whole = self.cell_px, ((self.columns + 2) * self.cell_px, (last - first + 2) * self.cell_px)
        fine = np.asarray(cv2.resize(coarse, whole, interpolation=cv2.INTER_LINEAR), dtype=np.float32)
        rows = self.rows(first, last)
        return fine[cell : cell + rows.stop - rows.start, cell : cell + self._size[0]]

    def rows(self, first: int, last: int) -> slice:
        """Image rows of the bands first to last - 1."""
        return slice(first * self.cell_px, min(self._size[1], last * self.cell_px))


def normalized(rays: FloatArray) -> FloatArray:
    """`(..., 2)` normalized coordinates of `(..., 3)` rays."""
    return rays[..., :2] / rays[..., 2:]


def resample(radiance: Radiance, pixel_map: PixelMap) -> Radiance:
    """`(rows, W, 3)` radiance of a rendered image at the places of a map, interpolated bilinearly."""
    single_map: Any = None  # The stub does not know a map in one array.
    if radiance.dtype == np.uint8:
        # A fixed-point map is faster and equally fine: OpenCV rounds every map to 1/32 px.
        fixed, fractions = cv2.convertMaps(pixel_map, single_map, cv2.CV_16SC2)
        resampled = cv2.remap(radiance, fixed, fractions, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(resampled, dtype=np.uint8)
    resampled = cv2.remap(radiance, pixel_map, single_map, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(resampled, dtype=radiance.dtype)


def inverse_ground_range(rays: FloatArray, positions: FloatArray) -> FloatArray:
    """`(...,)` inverse distance to the ground z = 0 along each ray, in lengths of the ray; 0 where it meets none.

    Rays are `(..., 3)` directions and positions `(..., 3)` those of the camera [m], world frame; from below 0.1 m no
    ray meets the ground.
    """
    height = positions[..., 2]
    return np.where(height > _LOWEST_EYE_M, np.maximum(-rays[..., 2], 0.0) / np.maximum(height, _LOWEST_EYE_M), 0.0)


class RadianceAccumulator:
    """Averages `count` images in linear light into one of `shape`, as a pixel integrates photons.

    Images are display-coded by the sRGB curve (IEC 61966-2-1). A single image is passed through unchanged.
    """

    def __init__(self, count: int, shape: tuple[int, int, int]) -> None:
        self._decode = np.rint(_LINEAR * (_FULL_SCALE / count)).astype(np.uint16) if count > 1 else None
        self._sum: Radiance = np.zeros(shape, dtype=np.uint16 if count > 1 else np.uint8)

    def decode(self, image: Image) -> Radiance:
        """Convert a rendered image to what may be resampled and added."""
        return image if self._decode is None else np.asarray(cv2.LUT(image, self._decode), dtype=np.uint16)

    def add(self, rows: slice, radiance: Radiance) -> None:
        """Add to some rows of the result."""
        total = self._sum[rows]
        cv2.add(total, radiance, dst=total)

    def mean(self) -> Image:
        """`(H, W, 3)` mean, display-coded."""
        return np.asarray(self._sum if self._decode is None else cv2.LUT(self._sum, _ENCODE), dtype=np.uint8)


def _srgb_to_linear(codes: FloatArray) -> FloatArray:
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


_FULL_SCALE = 65535.0
_LINEAR: FloatArray = _srgb_to_linear(np.arange(256, dtype=np.float64) / 255.0)
_THRESHOLDS = _srgb_to_linear((np.arange(255, dtype=np.float64) + 0.5) / 255.0)
_ENCODE = np.searchsorted(_THRESHOLDS, np.arange(65536) / _FULL_SCALE, side="right").astype(np.uint8)
