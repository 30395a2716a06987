"""Kernels that project a point onto the pieces of a path: lines, and arcs of circles.

The arctangents are taken between the two kernels by numpy, whose own differ from those of a kernel in the last bit.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pftrack_sim.core.types import FloatArray

_EPSILON = float(np.finfo(np.float64).eps)


@njit(cache=True, nogil=True)
def seen_from_starts(pieces: FloatArray, first: int, last: int, x: float, y: float) -> tuple[FloatArray, FloatArray]:
    """How far a point is ahead of the starts of pieces [m], and on arcs, the sine and cosine of its angle about them.

    Args:
        pieces: `(8, N)` first and last arc length, origin, x, y, curvature, cosine and sine of the heading at it.
        first: The first of these pieces.
        last: The one after the last.
        x: Of the point [m].
        y: Of the point [m].

    Returns:
        `(M,)` and `(2, M)`, both scaled by the same positive number.
    """
    ahead, angle = np.empty(last - first), np.empty((2, last - first))
    for index in range(last - first):
        piece = first + index
        bend, cos, sin = pieces[5, piece], pieces[6, piece], pieces[7, piece]
        dx, dy = x - pieces[3, piece], y - pieces[4, piece]
        ahead[index] = cos * dx + sin * dy
        angle[0, index], angle[1, index] = bend * ahead[index], 1.0 - bend * (cos * dy - sin * dx)
    return ahead, angle


@njit(cache=True, nogil=True)
def nearest(
    pieces: FloatArray,
    headings: FloatArray,
    first: int,
    ahead: FloatArray,
    angles: FloatArray,
    x: float,
    y: float,
    low_m: float,
    high_m: float,
) -> float:
    """Arc length in an interval of the point of some pieces that is nearest to x, y.

    Args:
        pieces: As above.
        headings: `(N,)` at their origins [rad].
        first: The first piece that reaches into the interval.
        ahead: `(M,)` as above.
        angles: `(M,)` of the point about the centres of arcs [rad].
        x: Of the point [m].
        y: Of the point [m].
        low_m: First arc length of the interval.
        high_m: Last arc length of the interval.
    """
    best_m, least = low_m, np.inf
    # The nearest point of each piece first; on an arc, the nearer end is not always the one to which it was clipped.
    for kind in range(3):
        for index in range(len(ahead)):
            piece = first + index
            start, end = max(pieces[0, piece], low_m), min(pieces[1, piece], high_m)
            if kind == 0:
                bend = pieces[5, piece]
                s = pieces[2, piece] + (ahead[index] if bend == 0.0 else angles[index] / bend)
                s = min(max(s, start), end)
            else:
                s = start if kind == 1 else end
            squared = _squared_distance(pieces, headings, s, x, y)
            if squared < least:
                best_m, least = s, squared
    return best_m


@njit(cache=True, nogil=True)
def _squared_distance(pieces: FloatArray, headings: FloatArray, s_m: float, x: float, y: float) -> float:
    """From x, y to the point of the path at an arc length, see `Path.pose` [m^2]."""
    piece = max(np.searchsorted(pieces[0], s_m, side="right") - 1, 0)
    run = s_m - pieces[2, piece]
    half = 0.5 * run * pieces[5, piece]
    angle = math.pi * (half / math.pi)
    if angle == 0.0:
        angle = _EPSILON
    chord, middle = run * (math.sin(angle) / angle), headings[piece] + half
    dx, dy = pieces[3, piece] + chord * math.cos(middle) - x, pieces[4, piece] + chord * math.sin(middle) - y
    return dx * dx + dy * dy
