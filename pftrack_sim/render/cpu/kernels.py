"""Kernels that draw ids and depths of triangles, and from them silhouettes of people.

All in one module: the cache of a kernel does not see that a kernel in another module has changed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.camera.pinhole import Intrinsics
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.render.cpu.triangles import Triangles

_UNSEEN, _IN_FRONT, _CUT = 0, 1, 2  # States of a geom: not yet projected, whole beyond the near plane, reaching over it
_SUBPIXEL = 1e-6  # Rounding of the places where a row crosses the edges of a triangle [px]


class Projected(NamedTuple):
    """Geoms as one camera sees them, each projected when it is first drawn.

    Attributes:
        state: `(ngeom,)` whether a geom has been projected, and whether the near plane cuts it.
        centres: `(ngeom, 3)` origins in camera axes [m].
        rotations: `(ngeom, 3, 3)` from the geom's frame to camera axes.
        vertices: `(V, 3)` x and y without the principal point [px], 1 / depth [1/m]; of a cut geom only vertices beyond
            the near plane are set, and others have a 1 / depth of 0.
        extents: `(ngeom, 5)` smallest and largest x, smallest and largest y [px] as above, and smallest depth [m].
        tops_m: `(ngeom,)` height of the highest vertex above the origin; NaN until it is first needed.
    """

    state: NDArray[np.int8]
    centres: FloatArray
    rotations: FloatArray
    vertices: FloatArray
    extents: FloatArray
    tops_m: FloatArray


def scratch(triangles: Triangles) -> Projected:
    """Arrays for the geoms of a model."""
    count = len(triangles.radii_m)
    return Projected(
        np.zeros(count, dtype=np.int8),
        np.empty((count, 3)),
        np.empty((count, 3, 3)),
        np.empty((len(triangles.vertices), 3)),
        np.empty((count, 5)),
        np.empty(count),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def begin(projected: Projected, positions: FloatArray, pose: FloatArray) -> None:
    """Place the geoms at `(ngeom, 3)` positions [m] before a camera at a `(4, 4)` pose, and forget earlier vertices."""
    for geom in range(len(positions)):
        projected.state[geom] = _UNSEEN
        projected.tops_m[geom] = np.nan
        for axis in range(3):
            centre = 0.0
            for along in range(3):
                centre += pose[along, axis] * (positions[geom, along] - pose[along, 3])
            projected.centres[geom, axis] = centre


@njit(cache=True, nogil=True, error_model="numpy")
def draw(
    geoms: IntArray,
    projected: Projected,
    triangles: Triangles,
    positions: FloatArray,
    rotations: FloatArray,
    pose: FloatArray,
    intrinsics: Intrinsics,
    limits_m: tuple[float, float, float],
    ids: NDArray[np.int32],
    inverse_depth: NDArray[np.float32],
) -> None:
    """Draw geoms into `(h, w)` ids and inverse depths.

    The principal point of the intrinsics is counted from the corner of the arrays. The limits are the near plane, the
    depth beyond which and the height below which whole geoms are left out.
    """
    near_m, farthest_m, above_m = limits_m
    fx, fy, cx, cy = intrinsics
    height, width = ids.shape
    left, right, top, bottom = cx / fx, (width - cx) / fx, cy / fy, (height - cy) / fy
    slopes = (
        np.sqrt(1.0 + left * left),
        np.sqrt(1.0 + right * right),
        np.sqrt(1.0 + top * top),
        np.sqrt(1.0 + bottom * bottom),
    )
    faces, points, clipped = triangles.faces, projected.vertices, np.empty((4, 3))
    for geom in geoms:
        radius = triangles.radii_m[geom]
        x, y, z = projected.centres[geom, 0], projected.centres[geom, 1], projected.centres[geom, 2]
        # Its sphere has to reach into the view.
        if (
            z + radius < near_m
            or z - radius > farthest_m
            or x + left * z <= -radius * slopes[0]
            or right * z - x <= -radius * slopes[1]
            or y + top * z <= -radius * slopes[2]
            or bottom * z - y <= -radius * slopes[3]
        ):
            continue
        first, last = triangles.vertex_starts[geom], triangles.vertex_starts[geom + 1]
        if positions[geom, 2] - radius <= above_m:
            if np.isnan(projected.tops_m[geom]):
                projected.tops_m[geom] = _top_m(triangles.vertices[first:last], rotations[geom])
            if projected.tops_m[geom] <= above_m - positions[geom, 2]:
                continue
        if projected.state[geom] == _UNSEEN:
            _project(geom, projected, triangles, rotations[geom], pose, fx, fy, near_m)
        if projected.state[geom] == _IN_FRONT:
            low_x, high_x, low_y, high_y, nearest_m = projected.extents[geom]
            if (
                low_x + cx > width + 1.0
                or high_x + cx < -1.0
                or low_y + cy > height + 1.0
                or high_y + cy < -1.0
                or nearest_m > 1.001 * farthest_m
            ):
                continue
        in_front = projected.state[geom] == _IN_FRONT
        for face in range(triangles.face_starts[geom], triangles.face_starts[geom + 1]):
            a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
            beyond = 3
            if not in_front:
                beyond = (points[first + a, 2] > 0.0) + (points[first + b, 2] > 0.0) + (points[first + c, 2] > 0.0)
            if beyond == 3:
                _fill(points, first + a, first + b, first + c, cx, cy, geom, ids, inverse_depth)
            if beyond in (0, 3):
                continue
            corners = _clip_near(
                triangles.vertices[first:last],
                (a, b, c),
                projected.rotations[geom],
                projected.centres[geom],
                near_m,
                clipped,
            )
            for corner in range(corners):
                clipped[corner, 2] = 1.0 / clipped[corner, 2]
                clipped[corner, 0] = fx * clipped[corner, 0] * clipped[corner, 2]
                clipped[corner, 1] = fy * clipped[corner, 1] * clipped[corner, 2]
            for corner in range(2, corners):
                _fill(clipped, 0, corner - 1, corner, cx, cy, geom, ids, inverse_depth)


@njit(cache=True, nogil=True)
def silhouettes(
    wanted: BoolArray,
    boxes: FloatArray,
    farthest_m: FloatArray,
    above_m: FloatArray,
    own: IntArray,
    own_ends: IntArray,
    others: IntArray,
    other_ends: IntArray,
    projected: Projected,
    triangles: Triangles,
    positions: FloatArray,
    rotations: FloatArray,
    pose: FloatArray,
    intrinsics: Intrinsics,
    size: tuple[int, int],
    near_m: float,
) -> tuple[IntArray, IntArray, BoolArray, BoolArray, NDArray[np.int32]]:
    """Silhouettes of the wanted people: each alone, and with all other geoms before it.

    Args:
        wanted: `(P,)` whom to find.
        boxes: `(P, 4)` amodal boxes [px].
        farthest_m: `(P,)` depth of each person's farthest point.
        above_m: `(P,)` height below which geoms occlude nothing of a person.
        own: Geoms of all people, those of person p from `own_ends[p]` to `own_ends[p + 1]`.
        own_ends: `(P + 1,)`.
        others: All other drawn geoms for each person, divided by `other_ends` in the same way.
        other_ends: `(P + 1,)`.
        projected: Scratch.
        triangles: Of the model.
        positions: `(ngeom, 3)` of the geoms [m].
        rotations: `(ngeom, 3, 3)` of the geoms.
        pose: `(4, 4)` T_world_camera.
        intrinsics: Focal lengths and principal point [px].
        size: Width and height of the image [px].
        near_m: Depth of the near plane.

    Returns:
        `(P, 4)` rectangles left, top, width, height around people; `(P, 2)` first and last of each person's pixels in
        the three flat arrays that follow, equal for a person without any: amodal, visible, id of the geom in front.
    """
    fx, fy, cx, cy = intrinsics
    rects, ends = np.zeros((len(wanted), 4), dtype=np.intp), np.zeros((len(wanted), 2), dtype=np.intp)
    total = 0
    for person in range(len(wanted)):
        if wanted[person]:
            rects[person] = _pixels_around(boxes[person], size)
        total += rects[person, 2] * rects[person, 3]
    amodal, visible = np.empty(total, dtype=np.bool_), np.empty(total, dtype=np.bool_)
    top, inverse_depth = np.full(total, -1, dtype=np.int32), np.zeros(total, dtype=np.float32)
    begin(projected, positions, pose)
    end = 0
    for person in range(len(wanted)):
        left, above, width, height = rects[person]
        pixels = slice(end, end + width * height)
        shape = (height, width)
        window = fx, fy, cx - left, cy - above
        ids = top[pixels].reshape(shape), inverse_depth[pixels].reshape(shape)
        draw(
            own[own_ends[person] : own_ends[person + 1]], projected, triangles, positions, rotations, pose, window,
            (near_m, np.inf, -np.inf), *ids,
        )  # fmt: skip
        alone = top[pixels].copy()
        amodal[pixels] = alone >= 0
        if not amodal[pixels].any():
            continue
        ends[person, 0], ends[person, 1], end = end, end + len(alone), end + len(alone)
        draw(
            others[other_ends[person] : other_ends[person + 1]], projected, triangles, positions, rotations, pose,
            window, (near_m, farthest_m[person], above_m[person]), *ids,
        )  # fmt: skip
        visible[pixels] = amodal[pixels] & (alone == top[pixels])
    return rects, ends, amodal, visible, top


@njit(cache=True, nogil=True)
def _pixels_around(box: FloatArray, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Left, top, width and height of `silhouettes.pixels_around`; zeros where there are no pixels."""
    x, y, w, h = box
    if not np.isfinite(x + y + w + h):
        return 0, 0, 0, 0
    left, top = max(np.floor(x) - 1.0, 0.0), max(np.floor(y) - 1.0, 0.0)
    right, bottom = min(np.ceil(x + w) + 1.0, size[0]), min(np.ceil(y + h) + 1.0, size[1])
    if left >= right or top >= bottom:
        return 0, 0, 0, 0
    return int(left), int(top), int(right - left), int(bottom - top)


@njit(cache=True, nogil=True, error_model="numpy")
def _project(
    geom: int,
    projected: Projected,
    triangles: Triangles,
    rotation: FloatArray,
    pose: FloatArray,
    fx: float,
    fy: float,
    near_m: float,
) -> None:
    """Project the vertices of a geom."""
    turned, centre, vertices = projected.rotations[geom], projected.centres[geom], projected.vertices
    for axis in range(3):
        for column in range(3):
            turned[axis, column] = 0.0
            for along in range(3):
                turned[axis, column] += pose[along, axis] * rotation[along, column]
    cut = centre[2] - triangles.radii_m[geom] < near_m
    low_x, high_x, low_y, high_y, nearest = np.inf, -np.inf, np.inf, -np.inf, np.inf
    for index in range(triangles.vertex_starts[geom], triangles.vertex_starts[geom + 1]):
        across, down, depth = _in_camera(triangles.vertices[index], turned, centre)
        if cut and depth < near_m:
            vertices[index, 2] = 0.0
            continue
        inverse = 1.0 / depth
        x, y = fx * across * inverse, fy * down * inverse
        vertices[index, 0], vertices[index, 1], vertices[index, 2] = x, y, inverse
        low_x, high_x, low_y, high_y = min(low_x, x), max(high_x, x), min(low_y, y), max(high_y, y)
        nearest = min(nearest, depth)
    projected.extents[geom] = low_x, high_x, low_y, high_y, nearest
    projected.state[geom] = _CUT if cut else _IN_FRONT


@njit(cache=True, nogil=True, inline="always")
def _in_camera(vertex: FloatArray, rotation: FloatArray, centre: FloatArray) -> tuple[float, float, float]:
    """x, y and depth [m] of a vertex in camera axes."""
    x, y, z = vertex[0], vertex[1], vertex[2]
    return (
        rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + centre[0],
        rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + centre[1],
        rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + centre[2],
    )


@njit(cache=True, nogil=True)
def _top_m(vertices: FloatArray, rotation: FloatArray) -> float:
    """Height of the highest of `(V, 3)` vertices above the origin of their frame."""
    top_m = -np.inf
    for index in range(len(vertices)):
        x, y, z = vertices[index, 0], vertices[index, 1], vertices[index, 2]
        top_m = max(top_m, rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z)
    return top_m


@njit(cache=True, nogil=True)
def _clip_near(
    vertices: FloatArray,
    corners: tuple[int, int, int],
    rotation: FloatArray,
    centre: FloatArray,
    near_m: float,
    clipped: FloatArray,
) -> int:
    """Cut a triangle in camera axes at the near plane; returns the number of corners left, 0, 3 or 4."""
    count = 0
    here, after = np.empty(3), np.empty(3)
    for corner in range(3):
        here[0], here[1], here[2] = _in_camera(vertices[corners[corner]], rotation, centre)
        after[0], after[1], after[2] = _in_camera(vertices[corners[(corner + 1) % 3]], rotation, centre)
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
    offset_x: float,
    offset_y: float,
    geom: int,
    ids: NDArray[np.int32],
    inverse_depth: NDArray[np.float32],
) -> None:
    """Fill the pixels whose centres lie in a triangle where it is in front; a triangle that faces away has none.

    `(V, 3)` points are x, y, 1 / depth; the offset is added to x and y.
    """
    ax, ay = points[a, 0] + offset_x, points[a, 1] + offset_y
    bx, by = points[b, 0] + offset_x, points[b, 1] + offset_y
    cx, cy = points[c, 0] + offset_x, points[c, 1] + offset_y
    doubled = (by - ay) * (cx - ax) - (bx - ax) * (cy - ay)  # Twice the area; y is down
    if not doubled > 0.0:
        return
    height, width = ids.shape
    top, bottom = max(_pixel(min(ay, by, cy)), 0), min(_pixel(max(ay, by, cy)), height)
    if top >= bottom:
        return
    # Most triangles are smaller than a pixel: many lie between the centres of two columns.
    if max(_pixel(min(ax, bx, cx) - _SUBPIXEL), 0) >= min(_pixel(max(ax, bx, cx) + _SUBPIXEL), width):
        return
    az, bz, cz = points[a, 2], points[b, 2], points[c, 2]
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
        if left >= right:
            continue
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
