"""Which geom each pixel shows and how far it is, on the processor: the source of the truth, with and without images.

A pixel shows the triangle at its centre, as in OpenGL, from which it differs by the rounding of edges only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.pinhole import Intrinsics
from pftrack_sim.camera.projection import Triangles
from pftrack_sim.core.compiled import kernel, part_of_kernel
from pftrack_sim.core.types import FloatArray, IntArray
from pftrack_sim.render.culling import PixelRect, View
from pftrack_sim.render.renderer import clip_depths_m, geoms_drawn
from pftrack_sim.render.triangles import Detail, model_triangles

_SUBPIXEL = 1e-6  # Rounding of the places where a row crosses the edges of a triangle [px]


@dataclass(frozen=True, eq=False)
class Segmentation:
    """The geom at each pixel of a rectangle.

    Attributes:
        rect: Where in the image.
        ids: `(h, w)` int32 geom ids, -1 where there is none.
        inverse_depth: `(h, w)` float32 1 / depth along the optical axis, through a wide `Lens` 1 / distance [1/m]; that
            of the far plane where there is no geom. Of two geoms at equal depth, the larger id is in front.
    """

    rect: PixelRect
    ids: NDArray[np.int32]
    inverse_depth: NDArray[np.float32]

    def depth_m(self) -> NDArray[np.float32]:
        """`(h, w)` depth along the optical axis [m]; infinite where there is no geom."""
        return np.where(self.ids < 0, np.float32(np.inf), np.float32(1.0) / self.inverse_depth)


class Segmenter:
    """Segments one model; see `render.renderer.geoms_drawn` for the geoms.

    It costs by the triangles of the geoms asked for and by their pixels in the rectangle, not by the image.

    Attributes:
        near_m: Depth of the near plane.
        far_m: Depth of the far plane.
        drawn: `(ngeom,)` geoms that are drawn at all.
        triangles: Triangles of their shapes, see `Detail`.
    """

    def __init__(self, model: Any) -> None:
        self.near_m, self.far_m = clip_depths_m(model)
        self.drawn = geoms_drawn(model)
        self.detail = Detail(model)
        self.triangles = model_triangles(model, self.drawn, self.detail.meshes)

    def nothing(self, rect: PixelRect) -> Segmentation:
        """Segmentation of a rectangle of pixels in which nothing is drawn yet."""
        shape = rect.height, rect.width
        ids = np.full(shape, -1, dtype=np.int32)
        return Segmentation(rect, ids, np.full(shape, 1.0 / self.far_m, dtype=np.float32))

    def segment(self, view: View, rect: PixelRect, geoms: IntArray | None = None) -> Segmentation:
        """Segment a rectangle of pixels, in which only the given geoms are drawn; None draws all."""
        found = self.nothing(rect)
        self.add(found, view, np.flatnonzero(self.drawn) if geoms is None else geoms)
        return found

    def add(self, found: Segmentation, view: View, geoms: IntArray) -> None:
        """Draw more geoms into a segmentation of the same view."""
        fx, fy, cx, cy = view.intrinsics
        window = fx, fy, cx - found.rect.left, cy - found.rect.top
        # A copy: for a read-only pose, the kernel would be compiled once more.
        poses = view.geom_xpos, view.geom_xmat.reshape(-1, 3, 3), np.array(view.T_world_camera, order="C")
        shapes = self.detail.shapes(view, geoms)
        draw_triangles(shapes, self.triangles, *poses, window, self.near_m, found.ids, found.inverse_depth)


@kernel
def draw_triangles(
    shapes: IntArray,
    triangles: Triangles,
    positions: FloatArray,
    rotations: FloatArray,
    pose: FloatArray,
    intrinsics: Intrinsics,
    near_m: float,
    ids: NDArray[np.int32],
    inverse_depth: NDArray[np.float32],
) -> None:
    """Draw geoms into `(h, w)` ids and inverse depths; a triangle that faces away has no pixels.

    Args:
        shapes: `(N,)` which to draw, see `Detail`.
        triangles: Their triangles and those of others.
        positions: `(ngeom, 3)` of the geoms [m].
        rotations: `(ngeom, 3, 3)` of the geoms.
        pose: `(4, 4)` T_world_camera.
        intrinsics: fx, fy, cx, cy [px]; the principal point is counted from the corner of the arrays.
        near_m: Depth of the near plane, at which triangles are cut.
        ids: `(h, w)` geom at the centre of each pixel.
        inverse_depth: `(h, w)` 1 / depth there [1/m].
    """
    fx, fy, cx, cy = intrinsics
    vertices, faces, vertex_starts, face_starts = triangles
    axes, corners = np.empty((3, 4)), np.empty((4, 3))
    most = 0
    for shape in shapes:
        most = max(most, vertex_starts[shape + 1] - vertex_starts[shape])
    local, pixels = np.empty((most, 3)), np.empty((most, 3))
    for shape in shapes:
        geom = shape % len(positions)
        for axis in range(3):
            axes[axis, 3] = 0.0
            for column in range(3):
                axes[axis, column] = 0.0
                axes[axis, 3] += pose[column, axis] * (positions[geom, column] - pose[column, 3])
                for along in range(3):
                    axes[axis, column] += pose[along, axis] * rotations[geom, along, column]
        first = vertex_starts[shape]
        for index in range(vertex_starts[shape + 1] - first):
            x, y, z = vertices[first + index, 0], vertices[first + index, 1], vertices[first + index, 2]
            for axis in range(3):
                local[index, axis] = axes[axis, 0] * x + axes[axis, 1] * y + axes[axis, 2] * z + axes[axis, 3]
            inverse = 1.0 / local[index, 2]
            pixels[index, 0] = fx * local[index, 0] * inverse + cx
            pixels[index, 1] = fy * local[index, 1] * inverse + cy
            pixels[index, 2] = inverse
        for face in range(face_starts[shape], face_starts[shape + 1]):
            count = 0
            for side in range(3):
                here, after = faces[face, side], faces[face, (side + 1) % 3]
                if local[here, 2] >= near_m:
                    for axis in range(3):
                        corners[count, axis] = pixels[here, axis]
                    count += 1
                if (local[here, 2] >= near_m) != (local[after, 2] >= near_m):
                    # Where the side of the triangle passes through the near plane.
                    share = (near_m - local[here, 2]) / (local[after, 2] - local[here, 2])
                    x = local[here, 0] + share * (local[after, 0] - local[here, 0])
                    y = local[here, 1] + share * (local[after, 1] - local[here, 1])
                    corners[count, 0], corners[count, 1] = fx * x / near_m + cx, fy * y / near_m + cy
                    corners[count, 2] = 1.0 / near_m
                    count += 1
            for last in range(2, count):
                _fill(corners, last, geom, ids, inverse_depth)


@part_of_kernel
def _fill(
    corners: FloatArray, last: int, geom: int, ids: NDArray[np.int32], inverse_depth: NDArray[np.float32]
) -> None:
    """Fill the pixels whose centres lie in a triangle, where it is in front.

    `(4, 3)` corners are x, y [px], 1 / depth [1/m]; those of the triangle are the first, and the `last` two.
    """
    ax, ay, az = corners[0, 0], corners[0, 1], corners[0, 2]
    bx, by, bz = corners[last - 1, 0], corners[last - 1, 1], corners[last - 1, 2]
    cx, cy, cz = corners[last, 0], corners[last, 1], corners[last, 2]
    doubled = (by - ay) * (cx - ax) - (bx - ax) * (cy - ay)  # Twice the area; y is down
    if not doubled > 0.0:
        return
    height, width = ids.shape
    top, bottom = max(_pixel(min(ay, by, cy)), 0), min(_pixel(max(ay, by, cy)), height)
    # Most triangles are smaller than a pixel: many lie between the centres of two rows or columns.
    narrow = max(_pixel(min(ax, bx, cx) - _SUBPIXEL), 0) >= min(_pixel(max(ax, bx, cx) + _SUBPIXEL), width)
    if top >= bottom or narrow:
        return
    per_x = ((by - ay) * (cz - az) - (cy - ay) * (bz - az)) / doubled
    per_y = ((cx - ax) * (bz - az) - (bx - ax) * (cz - az)) / doubled
    for row in range(top, bottom):
        y = row + 0.5
        # All three edges, without branches: which of them the row crosses cannot be predicted.
        a_above, b_above, c_above = ay <= y, by <= y, cy <= y
        on_ab = ax + (y - ay) / (by - ay) * (bx - ax)
        on_bc = bx + (y - by) / (cy - by) * (cx - bx)
        on_ca = cx + (y - cy) / (ay - cy) * (ax - cx)
        low = on_ab if a_above != b_above else np.inf
        high = on_ab if a_above != b_above else -np.inf
        low = on_bc if b_above != c_above and on_bc < low else low
        high = on_bc if b_above != c_above and on_bc > high else high
        low = on_ca if c_above != a_above and on_ca < low else low
        high = on_ca if c_above != a_above and on_ca > high else high
        left, right = max(_pixel(low), 0), min(_pixel(high), width)
        value = az + per_x * (left + 0.5 - ax) + per_y * (y - ay)
        for column in range(left, right):
            single = np.float32(value)
            present = inverse_depth[row, column]
            if single > present or (single == present and geom > ids[row, column]):
                inverse_depth[row, column] = single
                ids[row, column] = geom
            value += per_x


@part_of_kernel
def _pixel(coordinate: float) -> int:
    """The first pixel whose centre is at a coordinate or after it, for coordinates about an image."""
    return int(np.ceil(min(max(coordinate, -1.0), 1e6) - 0.5))
