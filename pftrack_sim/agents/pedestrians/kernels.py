"""Kernels of the reactive pedestrians: a social force, and barriers on the velocity.

The social force (Zanlungo, Ikeda and Kanda, "Social force model with explicit collision prediction", EPL 93, 2011) is
the repulsion of Helbing and Molnar (1995) between the predicted positions of closest approach. The barriers let a
distance shrink only at a rate proportional to the room left, so that it never falls below its minimum.

The steps and their order are those of formulas on arrays. Exponentials and arctangents are left to numpy between the
kernels: its results differ from those of a kernel in the last bit. `M` reactive pedestrians are the first of `N`
neighbours; vectors have their x and y on the first axis.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numba import njit

from pftrack_sim.core.types import BoolArray, FloatArray, IntArray

SENTINEL_M = 1e6
"""Position of an absent robot and distance of a pedestrian from itself: too far to matter to the avoidance."""

# Distances that the barriers keep between the centres of two people, from walls, and more from the robot and carts.
PERSON_DISTANCE_M = 0.52
WALL_DISTANCE_M = 0.30
VEHICLE_EXTRA_M = 0.28
BARRIER_RATE_S = 2.6  # Share of the room left by which a distance may shrink per second [1/s].

# Repulsion between people.
FORCE_M_S2 = 2.6
FORCE_RADIUS_M = 0.62
FORCE_RANGE_M = 0.24
FORCE_DECAY_S = 1.3
LOOKAHEAD_S = 4.0
PASS_RIGHT_M = 0.18  # Lateral offset assumed between two people on a collision course: both step to their right.
WEIGHT_BEHIND = 0.25  # Weight of neighbours directly behind (anisotropy of Helbing and Molnar).
NON_REACTIVE_WEIGHT = 1.7  # Weight of neighbours that do not react: the reactive pedestrian does all the avoiding.
WALL_FORCE_M_S2 = 1.4
WALL_FORCE_RANGE_M = 0.14

RELAXATION_S = 0.5  # Time constant of taking up the desired velocity (Helbing and Molnar 1995).
MAX_ACCELERATION_M_S2 = 2.6
MAX_TURN_RATE_RAD_S = math.radians(120.0)
MAX_SPEED_M_S = 2.0
MAX_HEADING_OFFSET_RAD = 1.1  # Largest angle from the heading to the desired velocity; the rest is turned on the way.
TURN_TIME_CONSTANT_S = 0.2
MAX_BACKWARD_M_S = 0.15
WAITING_FORCE_SHARE = 0.2  # Waiting positions are out of the way: waiting pedestrians give way only at close range.

# Distances restored by shifting positions where the barriers could not keep them.
MIN_PERSON_DISTANCE_M = 0.47
MIN_WALL_DISTANCE_M = 0.27

Rectangles: TypeAlias = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""`(2, F)` centres and half sizes [m], `(F,)` cosines and sines of the yaw."""


@njit(cache=True, nogil=True)
def rectangle_distances(xy_m: FloatArray, points: int, rectangles: Rectangles) -> tuple[FloatArray, FloatArray]:
    """See `ObstacleMap.distances`: of the first columns, x and y in the first rows."""
    centre, half, cos, sin = rectangles
    count = len(cos)
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


@njit(cache=True, nogil=True, error_model="numpy")
def sense(
    state: FloatArray,
    order: IntArray,
    reactive: int,
    vehicle: int,
    headings: FloatArray,
    waypoint_m: FloatArray,
    rectangles: Rectangles,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """What M reactive pedestrians react to.

    Args:
        state: `(4, C)` x, y [m], vx, vy [m/s] of everything that moves.
        order: `(N,)` columns, the M reactive ones first.
        reactive: M.
        vehicle: The first column of the robot and the carts.
        headings: `(P,)` of all pedestrians.
        waypoint_m: `(2, P)` of all pedestrians.
        rectangles: Obstacles.

    Returns:
        `(4, N)` state in this order; `(2, M)` offsets of the waypoints [m]; `(M, N + F)` logarithms of the strength of
        each repulsion, of neighbours and of walls; `(M, N)` weights per metre and `(2, M, N)` vectors [m] along which
        neighbours repel: from them to the person at the time of closest approach; `(M, F)` distances from the walls and
        `(2, M, F)` directions away from them.
    """
    near = np.empty((4, len(order)))
    for row in range(4):
        for index in range(len(order)):
            near[row, index] = state[row, order[index]]
    distance, away = rectangle_distances(near, reactive, rectangles)
    walls, count = distance.shape[1], len(order)
    offset, logarithm = np.empty((2, reactive)), np.empty((reactive, count + walls))
    factor, nearest = np.empty((reactive, count)), np.empty((2, reactive, count))
    for person in range(reactive):
        column = order[person]
        facing_x, facing_y = math.cos(headings[column]), math.sin(headings[column])
        offset[0, person] = waypoint_m[0, column] - near[0, person]
        offset[1, person] = waypoint_m[1, column] - near[1, person]
        for other in range(count):
            extra_m, weight = _extra_m(order[other], vehicle), 1.0 if other < reactive else NON_REACTIVE_WEIGHT
            x, y, apart_m = _offset(near, person, other)
            vx, vy = near[2, person] - near[2, other], near[3, person] - near[3, other]
            speed2 = vx * vx + vy * vy + 1e-4
            ahead_s = min(max(-(x * vx + y * vy) / speed2, 0.0), LOOKAHEAD_S)
            bias = (PASS_RIGHT_M if ahead_s > 0.0 else 0.0) / math.sqrt(speed2)
            near_x, near_y = x + vx * ahead_s + vy * bias, y + vy * ahead_s - vx * bias
            miss = math.sqrt(near_x * near_x + near_y * near_y) + 1e-6
            close = min((FORCE_RADIUS_M + extra_m - miss) / FORCE_RANGE_M, 1.5)
            logarithm[person, other] = close - ahead_s / FORCE_DECAY_S
            in_front = -(x * facing_x + y * facing_y) / apart_m
            seen = WEIGHT_BEHIND + (1.0 - WEIGHT_BEHIND) * 0.5 * (1.0 + in_front)
            factor[person, other] = max(seen, weight - 1.0) * weight / miss
            nearest[0, person, other], nearest[1, person, other] = near_x, near_y
        for wall in range(walls):
            logarithm[person, count + wall] = min((WALL_DISTANCE_M - distance[person, wall]) / WALL_FORCE_RANGE_M, 0.5)
    return near, offset, logarithm, factor, nearest, distance, away


@njit(cache=True, nogil=True, error_model="numpy")
def move(
    dt_s: float,
    state: FloatArray,
    order: IntArray,
    vehicle: int,
    headings: FloatArray,
    speeds_m_s: FloatArray,
    pace: FloatArray,
    waiting: BoolArray,
    rectangles: Rectangles,
    near: FloatArray,
    offset: FloatArray,
    bearings: FloatArray,
    strength: FloatArray,
    factor: FloatArray,
    nearest: FloatArray,
    distance: FloatArray,
    away: FloatArray,
) -> None:
    """Move the M reactive pedestrians by one tick: overwrite their columns of the state.

    Args:
        dt_s: Length of the tick.
        state: As in `sense`, like all that is not described here.
        order: Columns.
        vehicle: Column.
        headings: Of all pedestrians.
        speeds_m_s: `(P,)` desired speeds.
        pace: `(P,)` factors on these.
        waiting: `(M,)` whether each stays at its waiting position.
        rectangles: Obstacles.
        near: State of the neighbours.
        offset: Of the waypoints.
        bearings: `(M,)` directions of the waypoints [rad].
        strength: `(M, N + F)` exponentials of the logarithms.
        factor: Of the repulsions.
        nearest: Vectors of the repulsions.
        distance: From the walls.
        away: From the walls.
    """
    reactive, count = len(waiting), len(order)
    velocity, terms = np.empty((2, reactive)), np.empty((2, max(count, distance.shape[1])))
    for person in range(reactive):
        column = order[person]
        heading = headings[column]
        facing_x, facing_y = math.cos(heading), math.sin(heading)
        # Towards the next waypoint, along an arc that a walking body can turn.
        error = _wrapped(bearings[person] - heading)
        speed = speeds_m_s[column] * pace[column] * max(math.cos(error), 0.4)
        if waiting[person]:
            # It comes to rest at its waiting position, and returns to it after stepping aside.
            left_m = math.sqrt(offset[0, person] * offset[0, person] + offset[1, person] * offset[1, person])
            speed = speed * min(max((left_m - 0.15) / 0.8, 0.0), 1.0)
        direction = heading + min(max(error, -MAX_HEADING_OFFSET_RAD), MAX_HEADING_OFFSET_RAD)
        desired = speed * math.cos(direction), speed * math.sin(direction)
        for other in range(count):
            force = FORCE_M_S2 * strength[person, other] * factor[person, other]
            terms[0, other], terms[1, other] = force * nearest[0, person, other], force * nearest[1, person, other]
        social = _sum(terms, 0, count), _sum(terms, 1, count)
        for wall in range(distance.shape[1]):
            force = WALL_FORCE_M_S2 * strength[person, count + wall]
            terms[0, wall], terms[1, wall] = force * away[0, person, wall], force * away[1, person, wall]
        share = WAITING_FORCE_SHARE if waiting[person] else 1.0
        walls = distance.shape[1]
        vx, vy = near[2, person], near[3, person]
        ax = (desired[0] - vx) / RELAXATION_S + (social[0] + _sum(terms, 0, walls)) * share
        ay = (desired[1] - vy) / RELAXATION_S + (social[1] + _sum(terms, 1, walls)) * share
        gain = _limit_factor(ax, ay, MAX_ACCELERATION_M_S2) * dt_s
        vx, vy = vx + ax * gain, vy + ay * gain
        backward = max(-MAX_BACKWARD_M_S - (vx * facing_x + vy * facing_y), 0.0)
        shorter = _limit_factor(vx, vy, MAX_SPEED_M_S)
        velocity[0, person], velocity[1, person] = (
            vx * shorter + backward * facing_x,
            vy * shorter + backward * facing_y,
        )
    _keep_apart(near, order, vehicle, velocity, terms)
    _keep_off_walls(distance, away, velocity)
    for person in range(reactive):
        for axis in range(2):
            state[axis, order[person]] = near[axis, person] + velocity[axis, person] * dt_s
            state[2 + axis, order[person]] = velocity[axis, person]
    near_wall = distance.min() < MIN_WALL_DISTANCE_M + MAX_SPEED_M_S * dt_s
    _separate(dt_s, state, order, reactive, vehicle, rectangles, near, near_wall, terms)


@njit(cache=True, nogil=True)
def _keep_apart(near: FloatArray, order: IntArray, vehicle: int, velocity: FloatArray, terms: FloatArray) -> None:
    """Change `(2, M)` velocities [m/s] as little as keeps people apart."""
    reactive, count = velocity.shape[1], near.shape[1]
    room, away, least = np.empty((reactive, count)), np.empty((2, reactive, count)), np.inf
    for person in range(reactive):
        for other in range(count):
            x, y, apart_m = _offset(near, person, other)
            away[0, person, other], away[1, person, other] = x / apart_m, y / apart_m
            room[person, other] = apart_m - (PERSON_DISTANCE_M + _extra_m(order[other], vehicle))
            least = min(least, room[person, other])
    if least > 1.2:
        return
    lack = np.empty((reactive, count))
    for _ in range(3):
        most = -np.inf
        for person in range(reactive):
            for other in range(count):
                vx = velocity[0, person] - (velocity[0, other] if other < reactive else near[2, other])
                vy = velocity[1, person] - (velocity[1, other] if other < reactive else near[3, other])
                opening = away[0, person, other] * vx + away[1, person, other] * vy
                lack[person, other] = -BARRIER_RATE_S * room[person, other] - opening
                most = max(most, lack[person, other])
        if most <= 1e-9:
            break
        for person in range(reactive):
            for other in range(count):
                push = max(lack[person, other], 0.0) * (0.5 if other < reactive else 1.0)
                terms[0, other], terms[1, other] = push * away[0, person, other], push * away[1, person, other]
            _add_sums(terms, count, velocity, person)


@njit(cache=True, nogil=True)
def _keep_off_walls(distance: FloatArray, away: FloatArray, velocity: FloatArray) -> None:
    """Change `(2, M)` velocities [m/s] as little as keeps people off walls at `(M, F)` distances."""
    if distance.min() - WALL_DISTANCE_M > 0.8:
        return
    for _ in range(3):
        pushed = False
        for person in range(len(distance)):
            vx, vy = velocity[0, person], velocity[1, person]
            worst, most = 0, -np.inf
            for wall in range(distance.shape[1]):
                opening = away[0, person, wall] * vx + away[1, person, wall] * vy
                lack = -BARRIER_RATE_S * (distance[person, wall] - WALL_DISTANCE_M) - opening
                if lack > most:
                    worst, most = wall, lack
            if most > 0.0:
                velocity[0, person] = vx + most * away[0, person, worst]
                velocity[1, person] = vy + most * away[1, person, worst]
                pushed = True
        if not pushed:
            break


@njit(cache=True, nogil=True)
def _separate(
    dt_s: float,
    state: FloatArray,
    order: IntArray,
    reactive: int,
    vehicle: int,
    rectangles: Rectangles,
    start: FloatArray,
    near_wall: bool,
    terms: FloatArray,
) -> None:
    """Shift people out of walls and out of each other where the barriers could not keep the least distances."""
    moved, count = False, len(order)
    near, position, lack = np.empty((2, count)), np.empty((2, reactive)), np.empty((reactive, count))
    for _ in range(6):
        for index in range(count):
            near[0, index], near[1, index] = state[0, order[index]], state[1, order[index]]
        most = -np.inf
        for person in range(reactive):
            position[0, person], position[1, person] = near[0, person], near[1, person]
            for other in range(count):
                least_m = MIN_PERSON_DISTANCE_M + _extra_m(order[other], vehicle)
                lack[person, other] = least_m - _offset(near, person, other)[2]
                most = max(most, lack[person, other])
        crowded = most > 1e-6
        if not crowded and not near_wall:
            break
        if crowded:
            for person in range(reactive):
                for other in range(count):
                    x, y, apart_m = _offset(near, person, other)
                    push = max(lack[person, other], 0.0) * (0.5 if other < reactive else 1.0) / max(apart_m, 1e-6)
                    terms[0, other], terms[1, other] = push * x, push * y
                _add_sums(terms, count, position, person)
        distance, away = rectangle_distances(position, reactive, rectangles)
        if not crowded and MIN_WALL_DISTANCE_M - distance.min() <= 1e-6:
            break
        walls = distance.shape[1]
        for person in range(reactive):
            for wall in range(walls):
                push = max(MIN_WALL_DISTANCE_M - distance[person, wall], 0.0)
                terms[0, wall], terms[1, wall] = push * away[0, person, wall], push * away[1, person, wall]
            _add_sums(terms, walls, position, person)
            state[0, order[person]], state[1, order[person]] = position[0, person], position[1, person]
        moved = near_wall = True
    if moved:
        for person in range(reactive):
            for axis in range(2):
                state[2 + axis, order[person]] = (state[axis, order[person]] - start[axis, person]) / dt_s


@njit(cache=True, nogil=True)
def turn(dt_s: float, velocity: FloatArray, bearings: FloatArray, heading_rad: FloatArray) -> None:
    """Turn `(N,)` headings in place towards `(2, N)` velocities and their directions, at a limited rate."""
    for person in range(len(heading_rad)):
        error = _wrapped(bearings[person] - heading_rad[person])
        vx, vy = velocity[0, person], velocity[1, person]
        share = min(math.sqrt(vx * vx + vy * vy) / 0.4, 1.0)
        rate = max(share * error / TURN_TIME_CONSTANT_S, -MAX_TURN_RATE_RAD_S)
        heading_rad[person] += min(rate, MAX_TURN_RATE_RAD_S) * dt_s


@njit(cache=True, nogil=True, inline="always")
def _offset(near: FloatArray, person: int, other: int) -> tuple[float, float, float]:
    """Vector to a person from a neighbour and its length [m]; a person is far from itself."""
    x, y = near[0, person] - near[0, other], near[1, person] - near[1, other]
    if person == other:
        x += SENTINEL_M
    return x, y, math.sqrt(x * x + y * y)


@njit(cache=True, nogil=True, inline="always")
def _extra_m(column: int, vehicle: int) -> float:
    """Distance to keep from what moves in a column, in addition to that from a person."""
    return VEHICLE_EXTRA_M if column >= vehicle else 0.0


@njit(cache=True, nogil=True)
def _limit_factor(x: float, y: float, limit: float) -> float:
    """The factor that shortens a vector to a length."""
    return min(1.0, limit / math.sqrt(x * x + y * y + 1e-9))


@njit(cache=True, nogil=True)
def _wrapped(angle: float) -> float:
    """The angle in [-pi, pi) [rad]."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@njit(cache=True, nogil=True)
def _add_sums(terms: FloatArray, count: int, vectors: FloatArray, person: int) -> None:
    for axis in range(2):
        vectors[axis, person] += _sum(terms, axis, count)


@njit(cache=True, nogil=True)
def _sum(terms: FloatArray, row: int, count: int) -> float:
    """Sum of a row's first values, in numpy's order up to 128 of them: in eight parts from eight values on."""
    whole = count - count % 8
    total = 0.0
    if whole:
        parts = np.zeros(8)
        for index in range(whole):
            parts[index % 8] += terms[row, index]
        total = ((parts[0] + parts[1]) + (parts[2] + parts[3])) + ((parts[4] + parts[5]) + (parts[6] + parts[7]))
    for index in range(whole, count):
        total += terms[row, index]
    return total
