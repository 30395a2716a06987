"""A renderer of segmentations alone, on the processor and without any OpenGL library."""

from __future__ import annotations

from typing import NoReturn

import mujoco
import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.camera.pinhole import camera_matrix, focal_and_centre
from pftrack_sim.core.errors import RenderError
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.render.backend import PixelRect, Renderer, Segmentation, checked_poses
from pftrack_sim.render.cpu.triangles import Triangles, model_triangles


class IdRasteriser(Renderer):
    """Draws the ids and depths of a model's geoms, no colours; see `pftrack_sim.render.backend.Renderer`.

    A pixel shows the triangle at its centre, as in OpenGL, from which it differs by the rounding of edges only. The
    inverse depth is 1 / depth [1/m]. It costs by the triangles and pixels of the geoms asked for, not by the image.
    """

    description = "ids and depths on the processor, no colours"
    draws_color = False

    def __init__(self, model: mujoco.MjModel, width_px: int, height_px: int) -> None:
        super().__init__(width_px, height_px)
        self.rebind(model)

    def rebind(self, model: mujoco.MjModel) -> None:
        """See `Renderer.rebind`."""
        self._read_model(model)
        self._triangles: Triangles | None = model_triangles(model, self.visible_geoms)
        self._projected = np.empty((int(np.diff(self._triangles.vertex_starts).max()), 3))

    def unbind(self) -> None:
        """See `Renderer.unbind`."""
        self._triangles = None

    close = unbind

    def color(
        self, data: mujoco.MjData, T_world_camera: ArrayLike, K: ArrayLike | float, *, rows: slice | None = None
    ) -> NoReturn:
        """Raise `RenderError`: there are no colours."""
        raise RenderError("this renderer draws no colours: it was opened for the truth without images")

    def ids(
        self,
        data: mujoco.MjData,
        T_world_camera: ArrayLike,
        K: ArrayLike | float,
        *,
        geoms: BoolArray | None = None,
        rect: PixelRect | None = None,
    ) -> Segmentation:
        """Find the geom at each pixel; see `Renderer.ids`."""
        if self._triangles is None:
            raise RenderError("this renderer has no model: rebind it")
        geoms, rect = self._geoms_and_rect(geoms, rect)
        ids = np.full((rect.height, rect.width), -1, dtype=np.int32)
        found = Segmentation(rect, ids, np.zeros((rect.height, rect.width), dtype=np.float32))
        matrix = camera_matrix(K, self.width_px, self.height_px)
        self.draw_into(found, data, checked_poses(T_world_camera), matrix, np.flatnonzero(geoms))
        return found

    def draw_into(
        self,
        found: Segmentation,
        data: mujoco.MjData,
        T_world_camera: FloatArray,
        K: FloatArray,
        geoms: IntArray,
        *,
        farthest_m: float = np.inf,
        above_m: float = -np.inf,
    ) -> None:
        """Draw further geoms into a segmentation, which is modified.

        Geoms that lie wholly beyond the depth `farthest_m`, or below the height `above_m`, are left out. Other
        arguments are as for `ids`, with the ids of the geoms.
        """
        if self._triangles is None:
            raise RenderError("this renderer has no model: rebind it")
        fx, fy, cx, cy = focal_and_centre(K)
        intrinsics = fx, fy, cx - found.rect.left, cy - found.rect.top
        _draw(
            geoms, data.geom_xpos, data.geom_xmat.reshape(-1, 3, 3), *self._triangles, T_world_camera, intrinsics,
            (self.near_m, farthest_m, above_m), self._projected, found.ids, found.inverse_depth,
        )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _draw(
    geoms: IntArray,
    positions: FloatArray,
    rotations: FloatArray,
    vertices: FloatArray,
    faces: NDArray[np.int32],
    vertex_starts: IntArray,
    face_starts: IntArray,
    radii_m: FloatArray,
    pose: FloatArray,
    intrinsics: tuple[float, float, float, float],
    limits_m: tuple[float, float, float],
    projected: FloatArray,
    ids: NDArray[np.int32],
    inverse_depth: NDArray[np.float32],
) -> None:
    """Draw geoms into `(h, w)` ids and inverse depths; `projected` is scratch for the vertices of one geom.

    The limits are the near plane, the depth beyond which and the height below which whole geoms are left out.
    """
    near_m, farthest_m, above_m = limits_m
    fx, fy, cx, cy = intrinsics
    height, width = ids.shape
    clipped = np.empty((4, 3))
    rotation, centre = np.empty((3, 3)), np.empty(3)
    for geom in geoms:
        radius = float(radii_m[geom])
        for axis in range(3):
            centre[axis] = 0.0
            for along in range(3):
                centre[axis] += pose[along, axis] * (positions[geom, along] - pose[along, 3])
        if centre[2] + radius < near_m or centre[2] - radius > farthest_m:
            continue
        if not _sphere_in_view(centre, radius, intrinsics, width, height):
            continue
        first, count = vertex_starts[geom], vertex_starts[geom + 1] - vertex_starts[geom]
        if positions[geom, 2] - radius <= above_m and _top_m(vertices[first : first + count], rotations[geom]) <= (
            above_m - positions[geom, 2]
        ):
            continue
        for axis in range(3):
            for column in range(3):
                rotation[axis, column] = 0.0
                for along in range(3):
                    rotation[axis, column] += pose[along, axis] * rotations[geom, along, column]
        cut = centre[2] - radius < near_m
        for index in range(count):
            x, y, z = vertices[first + index, 0], vertices[first + index, 1], vertices[first + index, 2]
            depth = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + centre[2]
            across = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + centre[0]
            down = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + centre[1]
            if cut:
                projected[index, 0], projected[index, 1], projected[index, 2] = across, down, depth
            else:
                projected[index, 2] = 1.0 / depth
                projected[index, 0] = fx * across * projected[index, 2] + cx
                projected[index, 1] = fy * down * projected[index, 2] + cy
        for face in range(face_starts[geom], face_starts[geom + 1]):
            a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
            if not cut:
                _fill(projected, a, b, c, geom, ids, inverse_depth)
                continue
            corners = _clip_near(projected, (a, b, c), near_m, clipped)
            for corner in range(corners):
                clipped[corner, 2] = 1.0 / clipped[corner, 2]
                clipped[corner, 0] = fx * clipped[corner, 0] * clipped[corner, 2] + cx
                clipped[corner, 1] = fy * clipped[corner, 1] * clipped[corner, 2] + cy
            for corner in range(2, corners):
                _fill(clipped, 0, corner - 1, corner, geom, ids, inverse_depth)


@njit(cache=True, nogil=True)
def _top_m(vertices: FloatArray, rotation: FloatArray) -> float:
    """Height of the highest of `(V, 3)` vertices above the origin of their frame."""
    top_m = -np.inf
    for index in range(len(vertices)):
        x, y, z = vertices[index, 0], vertices[index, 1], vertices[index, 2]
        top_m = max(top_m, rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z)
    return top_m


@njit(cache=True, nogil=True, inline="always")
def _sphere_in_view(
    centre: FloatArray, radius: float, intrinsics: tuple[float, float, float, float], width: int, height: int
) -> bool:
    """Whether a sphere in camera axes may reach into the view of an image."""
    fx, fy, cx, cy = intrinsics
    left, right = cx / fx, (width - cx) / fx
    top, bottom = cy / fy, (height - cy) / fy
    x, y, z = centre
    return (
        x + left * z > -radius * np.sqrt(1.0 + left * left)
        and right * z - x > -radius * np.sqrt(1.0 + right * right)
        and y + top * z > -radius * np.sqrt(1.0 + top * top)
        and bottom * z - y > -radius * np.sqrt(1.0 + bottom * bottom)
    )


@njit(cache=True, nogil=True)
def _clip_near(points: FloatArray, corners: tuple[int, int, int], near_m: float, clipped: FloatArray) -> int:
    """Cut a triangle in camera axes at the near plane; returns the number of corners left, 0, 3 or 4."""
    count = 0
    for corner in range(3):
        here, after = points[corners[corner]], points[corners[(corner + 1) % 3]]
        if here[2] >= near_m:
            clipped[count] = here
            count += 1
        if (here[2] >= near_m) != (after[2] >= near_m):
            clipped[count] = here + (near_m - here[2]) / (after[2] - here[2]) * (after - here)
            clipped[count, 2] = near_m
            count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _fill(
    points: FloatArray,
    a: int,
    b: int,
    c: int,
    geom: int,
    ids: NDArray[np.int32],
    inverse_depth: NDArray[np.float32],
) -> None:
    """Fill the pixels whose centres lie in a triangle where it is in front; a triangle that faces away has none.

    `(V, 3)` points are x, y, 1 / depth.
    """
    ax, ay, az = points[a, 0], points[a, 1], points[a, 2]
    bx, by, bz = points[b, 0], points[b, 1], points[b, 2]
    cx, cy, cz = points[c, 0], points[c, 1], points[c, 2]
    doubled = (by - ay) * (cx - ax) - (bx - ax) * (cy - ay)  # Twice the area; y is down
    height, width = ids.shape
    top, bottom = max(_pixel(min(ay, by, cy)), 0), min(_pixel(max(ay, by, cy)), height)
    if not (doubled > 0.0 and top < bottom):
        return
    per_x = ((by - ay) * (cz - az) - (cy - ay) * (bz - az)) / doubled
    per_y = ((cx - ax) * (bz - az) - (bx - ax) * (cz - az)) / doubled
    for row in range(top, bottom):
        y = row + 0.5
        low, high = np.inf, -np.inf
        if (ay <= y) != (by <= y):
            x = ax + (y - ay) / (by - ay) * (bx - ax)
            low, high = x, x
        if (by <= y) != (cy <= y):
            x = bx + (y - by) / (cy - by) * (cx - bx)
            low, high = min(low, x), max(high, x)
        if (cy <= y) != (ay <= y):
            x = cx + (y - cy) / (ay - cy) * (ax - cx)
            low, high = min(low, x), max(high, x)
        left, right = max(_pixel(low), 0), min(_pixel(high), width)
        value = az + per_x * (left + 0.5 - ax) + per_y * (y - ay)
        for column in range(left, right):
            single = np.float32(value)
            present = inverse_depth[row, column]
            if single > present or (single == present and geom > ids[row, column]):
                inverse_depth[row, column] = single
                ids[row, column] = geom
            value += per_x


@njit(cache=True, nogil=True, inline="always")
def _pixel(coordinate: float) -> int:
    """The first pixel whose centre is at a coordinate or after it, for coordinates about an image."""
    return int(np.ceil(min(max(coordinate, -1.0), 1e6) - 0.5))
