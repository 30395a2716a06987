"""Kernels of lofted meshes: normals, and texture coordinates of cloth, with the rounding of formulas on arrays."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.core.types import BoolArray, FloatArray


@njit(cache=True, nogil=True)
def closed_rings(rings: FloatArray) -> tuple[FloatArray, BoolArray]:
    """`(R (N + 1), 3)` points of `(R, N, 3)` rings with the first of each repeated, and `(R,)` rings that are poles."""
    ring_count, count, _ = rings.shape
    vertices, poles = np.empty((ring_count * (count + 1), 3)), np.empty(ring_count, np.bool_)
    for ring in range(ring_count):
        start, extent = ring * (count + 1), 0.0
        for axis in range(3):
            low = high = rings[ring, 0, axis]
            for point in range(count):
                value = rings[ring, point, axis]
                vertices[start + point, axis] = value
                low, high = min(low, value), max(high, value)
            vertices[start + count, axis] = rings[ring, 0, axis]
            extent = max(extent, high - low)
        poles[ring] = extent < 1e-9
    return vertices, poles


@njit(cache=True, nogil=True)
def vertex_normals(
    vertices: FloatArray, corners: NDArray[np.intp], welded: NDArray[np.intp]
) -> tuple[FloatArray, bool]:
    """`(V, 3)` unit normals that point outwards, weighted by area, and whether the `(F, 3)` corners are clockwise.

    `welded` `(V,)` is the one of the coinciding points that `corners` refers to.
    """
    count = len(corners)
    areas, volume = np.empty((count, 3)), 0.0
    for face in range(count):
        first, second, third = vertices[corners[face, 0]], vertices[corners[face, 1]], vertices[corners[face, 2]]
        a, b, c = second[0] - first[0], second[1] - first[1], second[2] - first[2]
        d, e, f = third[0] - first[0], third[1] - first[1], third[2] - first[2]
        areas[face, 0], areas[face, 1], areas[face, 2] = b * f - c * e, c * d - a * f, a * e - b * d
        volume += first[0] * areas[face, 0] + first[1] * areas[face, 1] + first[2] * areas[face, 2]
    clockwise = volume < 0.0
    sums = np.zeros_like(vertices)
    # Over the first corners of all faces, then over the second and the third.
    for corner in range(3):
        for face in range(count):
            for axis in range(3):
                area = areas[face, axis]
                sums[corners[face, corner], axis] += -area if clockwise else area
    normals = np.empty_like(vertices)
    for vertex in range(len(vertices)):
        x, y, z = sums[welded[vertex]]
        length = math.sqrt(x * x + y * y + z * z)
        if length > 1e-12:
            normals[vertex, 0], normals[vertex, 1], normals[vertex, 2] = x / length, y / length, z / length
        else:
            normals[vertex, 0], normals[vertex, 1], normals[vertex, 2] = 0.0, 0.0, 1.0
    return normals, clockwise


@njit(cache=True, nogil=True)
def arc_lengths(rings: FloatArray) -> FloatArray:
    """`(R, N + 1)` lengths along `(R, N, 3)` closed rings, from the first point to each and back to the first."""
    ring_count, count, _ = rings.shape
    lengths = np.empty((ring_count, count + 1))
    for ring in range(ring_count):
        total = 0.0
        lengths[ring, 0] = 0.0
        for point in range(count):
            here, there = rings[ring, point], rings[ring, (point + 1) % count]
            dx, dy, dz = there[0] - here[0], there[1] - here[1], there[2] - here[2]
            total += math.sqrt(dx * dx + dy * dy + dz * dz)
            lengths[ring, point + 1] = total
    return lengths


@njit(cache=True, nogil=True)
def cloth_pixels(
    rings: FloatArray,
    lengths: FloatArray,
    even: FloatArray,
    region: tuple[int, int, int, int],
    front_column: float,
    girth_px: tuple[float, float],
    top_row: tuple[float, float, float],
) -> FloatArray:
    """`(R, N + 1, 2)` columns and rows of the texture that the points of `(R, N, 3)` rings show.

    Args:
        rings: Points [m].
        lengths: Their `arc_lengths`.
        even: `(N + 1,)` shares of the circumference where it is zero.
        region: Column, row, width and height of the cloth in the texture.
        front_column: Column of the region at the front.
        girth_px: Girth of all rings and size of a pixel [m].
        top_row: Row of the region, the height that it shows, and the height of a row [m].
    """
    ring_count, count, _ = rings.shape
    pixels = np.empty((ring_count, count + 1, 2))
    shares = np.empty(count + 1)
    for ring in range(ring_count):
        girth = lengths[ring, count]
        for point in range(count + 1):
            shares[point] = lengths[ring, point] / girth if girth > 1e-9 else even[point]
        for point in range(count + 1):
            column = front_column + (shares[point] - shares[count // 2]) * girth_px[0] / girth_px[1]
            row = top_row[0] + (top_row[1] - rings[ring, point % count, 2]) / top_row[2]
            pixels[ring, point, 0] = region[0] + min(max(column, 1.0), region[2] - 1.0)
            pixels[ring, point, 1] = region[1] + min(max(row, 1.0), region[3] - 1.0)
    return pixels
