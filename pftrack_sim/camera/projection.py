"""Where points of moving geoms fall in a frame: through the lens, at the instant at which their row is exposed.

The poses of geoms in the camera's axes are known at some instants of a frame and interpolated linearly in between. A
point is seen at mid-exposure of the row on which it lies then: the instant is the root of one equation, which the
secant method solves between the first row and the last.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.compiled import kernel, part_of_kernel
from pftrack_sim.core.types import FloatArray, IntArray

LensNumbers: TypeAlias = tuple[float, ...]
"""14: fx, fy, cx, cy [px]; k1, k2, p1, p2, k3, k4, k5, k6, or k1 to k4 of an equidistant lens and zeros; radius up to
which the polynomial is used, of an equidistant lens the angle [rad]; and 1 for an equidistant one, 2 for a wide one,
else 0."""

_STEP = 1e-6  # Relative step of the derivative along a ray
_ROW_TOLERANCE_PX, _MOST_STEPS = 1e-3, 32
_SWEEP_INSTANTS = 5  # Instants of each point's exposure whose extent is the swept one
_LARGE = 0.25  # Share of the width from which triangles through a wide lens may reach anywhere
_SMALL_PX, _SMALL_BEND_PX = 8.0, 0.1  # How far, at most, the sides of triangles up to that size bend


class Triangles(NamedTuple):
    """Triangles of shapes; those of shape s are `faces[face_starts[s]:face_starts[s + 1]]`.

    Of G geoms, shape s belongs to geom s mod G: each has several, one for each level of detail.

    Attributes:
        vertices: `(V, 3)` in the frame of their geom [m].
        faces: `(F, 3)` vertices of each triangle, counted from the shape's first, counter-clockwise from outside.
        vertex_starts: `(S + 1,)` first vertex of each shape.
        face_starts: `(S + 1,)` first triangle of each shape.
    """

    vertices: FloatArray
    faces: NDArray[np.int32]
    vertex_starts: IntArray
    face_starts: IntArray


class Readout(NamedTuple):
    """How the rows of one frame see the geoms of a model.

    Attributes:
        times_s: `(K,)` instants relative to the frame's time stamp, ascending.
        poses: `(K, 3, G, 4)` rotation and position [m] of each geom in the camera's axes at these.
        exposure_s: Exposure of each row.
        readout_s: Delay between the top and the bottom of the image.
        size: Width and height of the image [px].
        lens: See `LensNumbers`.
        near_m: Depth of the near plane.
    """

    times_s: FloatArray
    poses: FloatArray
    exposure_s: float
    readout_s: float
    size: tuple[int, int]
    lens: LensNumbers
    near_m: float


@kernel
def project(normalized: FloatArray, lens: LensNumbers) -> FloatArray:
    """`(N, 2)` pixels of `(N, 2)` normalized image coordinates."""
    pixels = np.empty(normalized.shape)
    for index in range(len(normalized)):
        pixels[index, 0], pixels[index, 1] = _project(normalized[index, 0], normalized[index, 1], lens)
    return pixels


@kernel
def place_vertices(
    shapes: IntArray, vertices: FloatArray, vertex_starts: IntArray, readout: Readout, places: FloatArray
) -> FloatArray:
    """Place the vertices of some shapes in a frame.

    Args:
        shapes: `(N,)` which.
        vertices: `(V, 3)` of all shapes, in the frame of the geom of each [m].
        vertex_starts: `(S + 1,)` each shape's first vertex.
        readout: The frame.
        places: `(V, 4)` x, y [px], depth [m] and instant [s] of each vertex, filled for these shapes.

    Returns:
        `(N, 10)` left, top, right, bottom of each shape [px], the same over the exposure of all its points, and
        smallest and largest depth [m]. Points before the near plane are left out of the extents, which are infinite
        without any.
    """
    extents = np.empty((len(shapes), 10))
    for index in range(len(shapes)):
        shape, geom = shapes[index], shapes[index] % readout.poses.shape[2]
        for first in (0, 4, 8):
            extents[index, first], extents[index, first + 1] = np.inf, np.inf if first < 8 else -np.inf
        for first in (2, 6):
            extents[index, first], extents[index, first + 1] = -np.inf, -np.inf
        for vertex in range(vertex_starts[shape], vertex_starts[shape + 1]):
            x, y, z = vertices[vertex, 0], vertices[vertex, 1], vertices[vertex, 2]
            across, down, depth, when_s = _place(x, y, z, geom, readout)
            places[vertex, 0], places[vertex, 1], places[vertex, 2], places[vertex, 3] = across, down, depth, when_s
            extents[index, 8], extents[index, 9] = min(extents[index, 8], depth), max(extents[index, 9], depth)
            if depth >= readout.near_m:
                _enclose(extents, index, 0, across, down)
                _enclose(extents, index, 4, across, down)
            if readout.exposure_s > 0.0:
                for instant in range(_SWEEP_INSTANTS):
                    offset_s = (instant / (_SWEEP_INSTANTS - 1) - 0.5) * readout.exposure_s
                    across, down, depth = _see(x, y, z, geom, when_s + offset_s, readout)
                    if depth >= readout.near_m:
                        _enclose(extents, index, 4, across, down)
    return extents


@kernel
def bound_triangles(
    shapes: IntArray, triangles: Triangles, readout: Readout, places: FloatArray, bounds: NDArray[np.int32]
) -> None:
    """Find the pixels of a frame in which the triangles of some shapes may be seen.

    Args:
        shapes: `(N,)` which, placed by `place_vertices`.
        triangles: Their triangles and those of others.
        readout: The frame.
        places: As there.
        bounds: `(F, 4)` first column and row, and one past the last column and row, in the image, filled for these.
    """
    width, height = readout.size
    vertices, faces, vertex_starts, face_starts = triangles
    for shape in shapes:
        first, geom = vertex_starts[shape], shape % readout.poses.shape[2]
        for face in range(face_starts[shape], face_starts[shape + 1]):
            left, top, right, bottom, ahead = np.inf, np.inf, -np.inf, -np.inf, 0
            for corner in range(3):
                vertex = first + faces[face, corner]
                if places[vertex, 2] >= readout.near_m:
                    ahead += 1
                    left, right = min(left, places[vertex, 0]), max(right, places[vertex, 0])
                    top, bottom = min(top, places[vertex, 1]), max(bottom, places[vertex, 1])
            bend = _SMALL_BEND_PX
            size = max(right - left, bottom - top)
            if 0 < ahead < 3 or (readout.lens[13] > 1.0 and size > _LARGE * width):
                bend = np.inf
            elif size > _SMALL_PX:
                for corner in range(3):
                    one, two = first + faces[face, corner], first + faces[face, (corner + 1) % 3]
                    x = 0.5 * (vertices[one, 0] + vertices[two, 0])
                    y = 0.5 * (vertices[one, 1] + vertices[two, 1])
                    z = 0.5 * (vertices[one, 2] + vertices[two, 2])
                    across, down, _, _ = _place(x, y, z, geom, readout)
                    # Twice, since a side need not bend most in its middle.
                    bend = max(bend, abs(2.0 * across - places[one, 0] - places[two, 0]))
                    bend = max(bend, abs(2.0 * down - places[one, 1] - places[two, 1]))
            bounds[face, 0], bounds[face, 1] = _pixel(left - bend, width), _pixel(top - bend, height)
            bounds[face, 2], bounds[face, 3] = _pixel(right + bend, width), _pixel(bottom + bend, height)


@part_of_kernel
def _pixel(coordinate: float, most: int) -> int:
    """The first pixel of an image whose centre is at a coordinate or after it."""
    return math.ceil(min(max(coordinate - 0.5, 0.0), float(most)))


@part_of_kernel
def _enclose(extents: FloatArray, index: int, first: int, across: float, down: float) -> None:
    """Let four of the columns of a row enclose a point."""
    extents[index, first] = min(extents[index, first], across)
    extents[index, first + 1] = min(extents[index, first + 1], down)
    extents[index, first + 2] = max(extents[index, first + 2], across)
    extents[index, first + 3] = max(extents[index, first + 3], down)


@part_of_kernel
def _place(x: float, y: float, z: float, geom: int, readout: Readout) -> tuple[float, float, float, float]:
    """Pixel, depth and instant at which a point of a geom is seen at mid-exposure of its row.

    A point above the image or below it belongs to the first row or the last.
    """
    first_s = -0.5 * readout.exposure_s - readout.readout_s
    height = float(readout.size[1])
    row_s = readout.readout_s / height
    before_s, after_s = first_s, first_s + readout.readout_s
    when_s = before_s + 0.5 * readout.readout_s
    across, down, depth = _see(x, y, z, geom, when_s, readout)
    tried_s, missed_s = 0.0, 0.0
    for step in range(_MOST_STEPS):
        due_s = first_s + row_s * min(max(down, 0.0), height)
        late_s = due_s - when_s
        if abs(late_s) <= _ROW_TOLERANCE_PX * row_s:
            break
        if late_s > 0.0:
            before_s = when_s
        else:
            after_s = when_s
        following_s = due_s
        if step and late_s != missed_s:
            following_s = when_s - late_s * (when_s - tried_s) / (late_s - missed_s)
        if not before_s <= following_s <= after_s:
            following_s = 0.5 * (before_s + after_s)
        tried_s, missed_s, when_s = when_s, late_s, following_s
        across, down, depth = _see(x, y, z, geom, when_s, readout)
    return across, down, depth, when_s


@part_of_kernel
def _see(x: float, y: float, z: float, geom: int, when_s: float, readout: Readout) -> tuple[float, float, float]:
    """Pixel and depth of a point of a geom at an instant; a point before the near plane is projected as if on it.

    Of a wide lens it is the distance in the place of the depth, and -1 of a point farther off its axis than it sees.
    """
    times_s, poses = readout.times_s, readout.poses
    last = len(times_s) - 1
    index, share = 0, 0.0
    if last:
        while index < last - 1 and times_s[index + 1] <= when_s:
            index += 1
        share = (when_s - times_s[index]) / (times_s[index + 1] - times_s[index])
        share = min(max(share, 0.0), 1.0)
    after = min(index + 1, last)
    right = (1.0 - share) * _along(poses, index, 0, geom, x, y, z) + share * _along(poses, after, 0, geom, x, y, z)
    below = (1.0 - share) * _along(poses, index, 1, geom, x, y, z) + share * _along(poses, after, 1, geom, x, y, z)
    depth = (1.0 - share) * _along(poses, index, 2, geom, x, y, z) + share * _along(poses, after, 2, geom, x, y, z)
    if readout.lens[13] > 1.0:
        aside = math.sqrt(right * right + below * below)
        angle = math.atan2(aside, depth)
        across, down = _project_angle(right, below, aside, angle, readout.lens)
        return across, down, math.sqrt(aside * aside + depth * depth) if angle <= readout.lens[12] else -1.0
    inverse = 1.0 / max(depth, readout.near_m)
    across, down = _project(right * inverse, below * inverse, readout.lens)
    return across, down, depth


@part_of_kernel
def _along(poses: FloatArray, index: int, axis: int, geom: int, x: float, y: float, z: float) -> float:
    """Coordinate of a point along an axis of the camera [m]."""
    turned = poses[index, axis, geom, 0] * x + poses[index, axis, geom, 1] * y + poses[index, axis, geom, 2] * z
    return turned + poses[index, axis, geom, 3]


@part_of_kernel
def _project(x: float, y: float, lens: LensNumbers) -> tuple[float, float]:
    """Pixel of a ray; beyond the radius of the lens it moves on along its tangent."""
    fx, fy, cx, cy = lens[:4]
    aside = math.sqrt(x * x + y * y)
    if lens[13] > 0.0:
        return _project_angle(x, y, aside, math.atan(aside), lens)
    beyond = max(1.0, aside / lens[12])
    inside_x, inside_y = x / beyond, y / beyond
    across, down = _distort(inside_x, inside_y, lens)
    if beyond > 1.0:
        more_x, more_y = _distort(inside_x * (1.0 + _STEP), inside_y * (1.0 + _STEP), lens)
        less_x, less_y = _distort(inside_x * (1.0 - _STEP), inside_y * (1.0 - _STEP), lens)
        across += (beyond - 1.0) * (more_x - less_x) / (2.0 * _STEP)
        down += (beyond - 1.0) * (more_y - less_y) / (2.0 * _STEP)
    return across * fx + cx, down * fy + cy


@part_of_kernel
def _project_angle(x: float, y: float, radius: float, angle: float, lens: LensNumbers) -> tuple[float, float]:
    """Pixel of a ray at an angle to the axis, which lies at x and y beside it, at the distance `radius` from it.

    The image height of an equidistant lens is a polynomial of the angle; beyond its limit it is linear.
    """
    fx, fy, cx, cy, k1, k2, k3, k4 = lens[:8]
    inside = min(angle, lens[12])
    square = inside * inside
    height = inside * (1.0 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
    slope = 1.0 + square * (3.0 * k1 + square * (5.0 * k2 + square * (7.0 * k3 + square * 9.0 * k4)))
    scale = (height + slope * (angle - inside)) / radius if radius > 0.0 else 1.0
    return scale * x * fx + cx, scale * y * fy + cy


@part_of_kernel
def _distort(x: float, y: float, lens: LensNumbers) -> tuple[float, float]:
    """Brown and Conrady's polynomial of normalized coordinates, or the quotient of two."""
    k1, k2, p1, p2, k3, k4, k5, k6 = lens[4:12]
    square = x * x + y * y
    radial = 1.0 + square * (k1 + square * (k2 + square * k3))
    radial /= 1.0 + square * (k4 + square * (k5 + square * k6))
    across = x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x)
    return across, y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y
