"""Kernels of the pedestrians' avoidance: distances, and where two people will be nearest to each other.

The steps and their order are those of formulas on arrays. Exponentials and sums over neighbours are left to numpy,
whose results differ from those of a kernel in the last bit.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pftrack_sim.core.types import FloatArray

SENTINEL_M = 1e6
"""Position of an absent robot and distance of a pedestrian from itself: too far to matter to the avoidance."""

# See `avoidance`: these are used here alone.
FORCE_RADIUS_M = 0.62
FORCE_RANGE_M = 0.24
FORCE_DECAY_S = 1.3
LOOKAHEAD_S = 4.0
PASS_RIGHT_M = 0.18  # Lateral offset assumed between two people on a collision course: both step to their right.
WEIGHT_BEHIND = 0.25  # Weight of neighbours directly behind (anisotropy of Helbing and Molnar).


@njit(cache=True, nogil=True)
def rectangle_distances(
    xy_m: FloatArray, centre: FloatArray, half: FloatArray, cos: FloatArray, sin: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """See `ObstacleMap.distances`: of `(2, N)` points from F rectangles with `(2, F)` centres and half sizes."""
    points, count = xy_m.shape[1], len(cos)
    distance, away = np.empty((points, count)), np.empty((2, points, count))
    for point in range(points):
        for index in range(count):
            x, y = xy_m[0, point] - centre[0, index], xy_m[1, point] - centre[1, index]
            u, v = cos[index] * x + sin[index] * y, cos[index] * y - sin[index] * x
            over_u, over_v = abs(u) - half[0, index], abs(v) - half[1, index]
            away_u, away_v = max(over_u, 0.0), max(over_v, 0.0)
            length = math.hypot(away_u, away_v)
            distance[point, index] = length
            if length <= 0.0:
                nearer_u = over_u > over_v
                away_u, away_v, length = (1.0, 0.0, 1.0) if nearer_u else (0.0, 1.0, 1.0)
                distance[point, index] = over_u if nearer_u else over_v
            u, v = math.copysign(away_u / length, u), math.copysign(away_v / length, v)
            away[0, point, index] = cos[index] * u - sin[index] * v
            away[1, point, index] = sin[index] * u + cos[index] * v
    return distance, away


@njit(cache=True, nogil=True)
def offsets_between(state: FloatArray, reactive: int) -> tuple[FloatArray, FloatArray]:
    """`(2, M, N)` vectors to the first M columns of a `(4, N)` state from all N, and their `(M, N)` lengths [m]."""
    count = state.shape[1]
    offset, distance = np.empty((2, reactive, count)), np.empty((reactive, count))
    for person in range(reactive):
        for other in range(count):
            x, y = state[0, person] - state[0, other], state[1, person] - state[1, other]
            if person == other:
                x += SENTINEL_M
            offset[0, person, other], offset[1, person, other] = x, y
            distance[person, other] = math.sqrt(x * x + y * y)
    return offset, distance


@njit(cache=True, nogil=True, error_model="numpy")
def closest_approach(
    state: FloatArray, facing: FloatArray, extra_m: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of M people who face along `(2, M)` vectors and their N neighbours, the first M columns of a `(4, N)` state.

    Args:
        state: x, y [m], vx, vy [m/s].
        facing: Unit vectors.
        extra_m: `(N,)` see `Neighbours`.
        weight: `(N,)` see `Neighbours`.

    Returns:
        `(M, N)` logarithm of the strength of each repulsion, `(M, N)` its weight per metre, `(2, M, N)` the vector [m]
        along which it acts: from a neighbour to the person at the time of closest approach.
    """
    reactive, count = facing.shape[1], state.shape[1]
    logarithm, factor = np.empty((reactive, count)), np.empty((reactive, count))
    nearest = np.empty((2, reactive, count))
    offset, distance = offsets_between(state, reactive)
    for person in range(reactive):
        for other in range(count):
            x, y = offset[0, person, other], offset[1, person, other]
            vx, vy = state[2, person] - state[2, other], state[3, person] - state[3, other]
            speed2 = vx * vx + vy * vy + 1e-4
            ahead_s = min(max(-(x * vx + y * vy) / speed2, 0.0), LOOKAHEAD_S)
            bias = (PASS_RIGHT_M if ahead_s > 0.0 else 0.0) / math.sqrt(speed2)
            near_x, near_y = x + vx * ahead_s + vy * bias, y + vy * ahead_s - vx * bias
            miss = math.sqrt(near_x * near_x + near_y * near_y) + 1e-6
            close = min((FORCE_RADIUS_M + extra_m[other] - miss) / FORCE_RANGE_M, 1.5)
            logarithm[person, other] = close - ahead_s / FORCE_DECAY_S
            in_front = -(x * facing[0, person] + y * facing[1, person]) / distance[person, other]
            seen = WEIGHT_BEHIND + (1.0 - WEIGHT_BEHIND) * 0.5 * (1.0 + in_front)
            factor[person, other] = max(seen, weight[other] - 1.0) * weight[other] / miss
            nearest[0, person, other], nearest[1, person, other] = near_x, near_y
    return logarithm, factor, nearest
