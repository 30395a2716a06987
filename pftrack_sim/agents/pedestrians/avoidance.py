"""Collision avoidance between pedestrians: a social force, and barriers on the velocity.

The social force (Zanlungo, Ikeda and Kanda, "Social force model with explicit collision prediction", EPL 93, 2011) is
the repulsion of Helbing and Molnar (1995) between the predicted positions of closest approach. The barriers let a
distance shrink only at a rate proportional to the room left, so that it never falls below its minimum.

The functions are vectorised over `M` reactive pedestrians and their `N` neighbours: the same `M`, then everything that
does not react. Vectors have their x and y on the first axis.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pftrack_sim.agents.pedestrians.kernels import closest_approach, offsets_between
from pftrack_sim.core.types import FloatArray

# Distances that the barriers keep between the centres of two people, from walls, and more from the robot and carts.
PERSON_DISTANCE_M = 0.52
WALL_DISTANCE_M = 0.30
VEHICLE_EXTRA_M = 0.28
BARRIER_RATE_S = 2.6  # Share of the room left by which a distance may shrink per second [1/s].

# Repulsion between people; contact distance, range and decay with the time to closest approach are in `kernels`.
FORCE_M_S2 = 2.6
NON_REACTIVE_WEIGHT = 1.7  # Weight of neighbours that do not react: the reactive pedestrian does all the avoiding.
WALL_FORCE_M_S2 = 1.4
WALL_FORCE_RANGE_M = 0.14


class Neighbours(NamedTuple):
    """Neighbours of the reactive pedestrians.

    Attributes:
        state: `(4, N)` x, y [m], vx, vy [m/s], world frame; the first `M` columns are the reactive pedestrians.
        extra_m: `(N,)` distance to keep in addition to that from a person.
        weight: `(N,)` factor of the social force: 1, or `NON_REACTIVE_WEIGHT`.
        share: `(N,)` share of a correction that the reactive pedestrian makes: 0.5, or 1 for non-reactive ones.
        reactive: M.
    """

    state: FloatArray
    extra_m: FloatArray
    weight: FloatArray
    share: FloatArray
    reactive: int

    def offsets(self) -> tuple[FloatArray, FloatArray]:
        """`(2, M, N)` vectors from each neighbour to each reactive pedestrian, and their `(M, N)` lengths [m]."""
        return offsets_between(self.state, self.reactive)


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Scalar products of vectors on the first axis; faster than a product and a sum over two elements."""
    return a[0] * b[0] + a[1] * b[1]


def social_force(neighbours: Neighbours, facing: FloatArray) -> FloatArray:
    """Acceleration `(2, M)` [m/s^2] away from predicted collisions of pedestrians that face along `(2, M)` vectors."""
    logarithm, factor, nearest = closest_approach(neighbours.state, facing, neighbours.extra_m, neighbours.weight)
    strength = FORCE_M_S2 * np.exp(logarithm) * factor
    return (strength * nearest).sum(axis=2)


def wall_force(distance: FloatArray, away: FloatArray) -> FloatArray:
    """Acceleration `(2, M)` [m/s^2] away from walls at `(M, F)` distances, along `(2, M, F)` unit vectors."""
    strength = WALL_FORCE_M_S2 * np.exp(np.minimum((WALL_DISTANCE_M - distance) / WALL_FORCE_RANGE_M, 0.5))
    return (strength * away).sum(axis=2)


def person_barrier(neighbours: Neighbours, velocity: FloatArray) -> FloatArray:
    """Velocities `(2, M)` [m/s] nearest to the given ones that keep people apart."""
    offset, distance = neighbours.offsets()
    room = distance - (PERSON_DISTANCE_M + neighbours.extra_m)
    if room.min() > 1.2:
        return velocity
    away = offset / distance
    slowest = -BARRIER_RATE_S * room
    all_velocities = neighbours.state[2:].copy()
    for _ in range(3):
        all_velocities[:, : velocity.shape[1]] = velocity
        opening = dot(away, velocity[..., None] - all_velocities[:, None])
        lack = slowest - opening
        if lack.max() <= 1e-9:
            break
        push = np.maximum(lack, 0.0) * neighbours.share
        velocity = velocity + (push * away).sum(axis=2)
    return velocity


def wall_barrier(distance: FloatArray, away: FloatArray, velocity: FloatArray) -> FloatArray:
    """Velocities `(2, M)` [m/s] nearest to the given ones that stay off walls at `(M, F)` distances."""
    room = distance - WALL_DISTANCE_M
    if room.min() > 0.8:
        return velocity
    slowest = -BARRIER_RATE_S * room
    rows = np.arange(len(room))
    for _ in range(3):
        lack = slowest - dot(away, velocity[..., None])
        worst = lack.argmax(axis=1)
        push = np.maximum(lack[rows, worst], 0.0)
        if not push.any():
            break
        velocity = velocity + push * away[:, rows, worst]
    return velocity


def wall_barrier_active(distance: FloatArray, away: FloatArray, velocity: FloatArray) -> bool:
    """Whether the wall barrier would change `(2, M)` velocities."""
    opening = dot(away, velocity[..., None])
    return bool((opening < -BARRIER_RATE_S * (distance - WALL_DISTANCE_M)).any())
